//! A figure as a file: SVG, PDF or PNG.
//!
//! An SVG names its font; what shows it without that font takes Arial or Helvetica, whose letters are as wide.

use std::path::Path;
use study::output::{OutputError, ending};

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
