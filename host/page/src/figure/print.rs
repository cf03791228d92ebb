//! A figure as the content of its file: SVG, PDF or PNG.
//!
//! An SVG names its font. A viewer without that font takes Arial or Helvetica, whose letters have the same widths. PDF and PNG
//! contain the shapes of the letters.

use crate::PageError;
use resvg::{tiny_skia, usvg};
use std::path::Path;
use std::sync::Arc;
use study::output::{OutputError, ending};

/// Liberation Sans 2.1.5 (SIL Open Font License 1.1).
const FONT: &[u8] = include_bytes!("font/LiberationSans-Regular.ttf");

/// Pixels of a PNG for each point: 600 dpi.
const PNG_SCALE: f32 = 600.0 / 72.0;

/// The format of a file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Format {
    /// Vectors, with editable text.
    Svg,
    /// Vectors, with the font inside.
    Pdf,
    /// Pixels, 600 per inch.
    Png,
}

impl Format {
    /// The endings of their names, in the order of the formats.
    pub const ENDINGS: &[&str] = &["svg", "pdf", "png"];

    /// Returns the format that a file's name ends with.
    ///
    /// # Errors
    /// [`OutputError::Ending`].
    pub fn of(path: &Path) -> Result<Self, OutputError> {
        Ok([Self::Svg, Self::Pdf, Self::Png][ending(path, Self::ENDINGS)?])
    }
}

/// Returns the content of a figure's file.
///
/// # Errors
/// [`PageError::Convert`] if the figure cannot be converted, for instance because a PNG would be too large.
pub(super) fn convert(svg: &str, format: Format) -> Result<Vec<u8>, PageError> {
    if format == Format::Svg {
        return Ok(svg.as_bytes().to_vec());
    }
    let failed = |reason: String| PageError::Convert { reason };
    let mut fonts = usvg::fontdb::Database::new();
    fonts.load_font_source(usvg::fontdb::Source::Binary(Arc::new(FONT)));
    let options = usvg::Options { dpi: 72.0, fontdb: Arc::new(fonts), ..usvg::Options::default() };
    let tree = usvg::Tree::from_str(svg, &options).map_err(|error| failed(error.to_string()))?;
    if format == Format::Pdf {
        let page = svg2pdf::PageOptions { dpi: 72.0 };
        return svg2pdf::to_pdf(&tree, svg2pdf::ConversionOptions::default(), page)
            .map_err(|error| failed(error.to_string()));
    }
    let [width, height] = [tree.size().width(), tree.size().height()].map(|pt| (pt * PNG_SCALE).round() as u32);
    let pixels = tiny_skia::Pixmap::new(width, height);
    let mut pixels = pixels.ok_or_else(|| failed(format!("{width} by {height} pixels are too many")))?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(PNG_SCALE, PNG_SCALE), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| failed(error.to_string()))
}
