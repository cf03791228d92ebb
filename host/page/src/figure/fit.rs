//! The 95 % intervals of fitted parameters: a row for each parameter, a bar for each fit, and the initial value of the fit.

use super::panel::{Axis, tick_text};
use super::sheet::{FLAGELLA, FONT_PT, GRID, INK, MEASURED, MM, MODEL, Sheet, Stroke, short};
use study::plan::{Fit, FittedParameter};
use study::text::figure;

const LEFT_MM: f64 = 3.0;
const RIGHT_MM: f64 = 3.0;

/// Height of a bar's line.
const BAR_MM: f64 = 2.6;

/// The colours of the fits. The places of their marks differ, too.
const COLOURS: [&str; 4] = [MEASURED, MODEL, FLAGELLA[1], FLAGELLA[0]];

/// Largest number of fits that a figure distinguishes.
pub(super) const MOST_FITS: usize = COLOURS.len();

/// A fit, and the name of its file.
pub(super) struct Named {
    pub name: String,
    pub fit: Fit,
}

impl Named {
    /// Returns why the intervals of a parameter do not hold.
    pub(super) fn doubt(&self, parameter: &FittedParameter) -> Option<&'static str> {
        if !self.fit.is_described {
            return Some("the model does not describe the trials");
        }
        self.fit.short_of_minimum.contains(&parameter.name).then_some("the fit did not reach its minimum")
    }
}

/// Draws fits.
pub(super) fn draw(fits: &[Named], width_mm: f64) -> String {
    let mut sheet = Sheet::new(width_mm);
    let (left, width) = (LEFT_MM * MM, sheet.width - (LEFT_MM + RIGHT_MM) * MM);
    let mut top = 2.0 * MM;
    if fits.len() > 1 {
        for (named, colour) in fits.iter().zip(COLOURS) {
            sheet.legend(left, top + 0.7 * FONT_PT, &[(Stroke(colour, 1.2, ""), &named.name)]);
            top += 1.3 * FONT_PT;
        }
        top += 1.0 * MM;
    }
    for (name, unit) in parameters(fits) {
        let of_fits: Vec<_> = fits
            .iter()
            .zip(COLOURS)
            .filter_map(|(named, colour)| {
                let parameter = named.fit.parameters.iter().find(|parameter| parameter.name == name)?;
                Some((named, parameter, colour))
            })
            .collect();
        let ends = of_fits.iter().flat_map(|(_, p, _)| [p.start, p.value, p.interval_95[0], p.interval_95[1]]);
        let axis = Axis::about(ends, 1e-12, "");
        let at = |value: f64| left + (value - axis.low) / (axis.high - axis.low) * width;
        let unit = if matches!(unit, "" | "1") { String::new() } else { format!(" ({unit})") };
        sheet.text(left, top + 0.8 * FONT_PT, "start", &format!("{}{unit}", name.replace('_', " ")));
        if let [(_, p, _)] = of_fits[..] {
            let [low, high] = p.interval_95.map(figure);
            let said = format!("{} ({low} to {high})", figure(p.value)).replace('-', "−");
            sheet.text(left + width, top + 0.8 * FONT_PT, "end", &said);
        }
        top += 1.2 * FONT_PT;
        let bottom = top + of_fits.len() as f64 * BAR_MM * MM;
        let ticks = axis.ticks(width / 40.0);
        for value in &ticks {
            sheet.path(&format!("M{} {}V{}", short(at(*value)), short(top), short(bottom)), Stroke(GRID, 0.4, ""));
            sheet.text(at(*value), bottom + 1.1 * FONT_PT, "middle", &tick_text(*value, &ticks));
        }
        for (i, (named, p, colour)) in of_fits.into_iter().enumerate() {
            let y = top + (i as f64 + 0.5) * BAR_MM * MM;
            let dashes = if named.doubt(p).is_some() { "2 1.5" } else { "" };
            let [low, high] = p.interval_95.map(at);
            sheet.path(&format!("M{} {}H{}", short(low), short(y), short(high)), Stroke(colour, 1.2, dashes));
            sheet.dot([at(p.start), y], 1.5, "#ffffff", Stroke(INK, 0.6, ""));
            sheet.dot([at(p.value), y], 1.8, colour, Stroke("#ffffff", 0.3, ""));
        }
        top = bottom + 2.4 * FONT_PT;
    }
    let doubtful = fits.iter().any(|named| named.fit.parameters.iter().any(|p| named.doubt(p).is_some()));
    let dashed = if doubtful { "; dashed: does not hold" } else { "" };
    sheet.text(left, top, "start", &format!("Bars: 95 % intervals; open: start of the fit{dashed}"));
    sheet.svg(top + 0.6 * FONT_PT)
}

/// Returns name and unit of every parameter of these fits, once.
fn parameters(fits: &[Named]) -> Vec<(&str, &str)> {
    let mut all: Vec<(&str, &str)> = Vec::new();
    for parameter in fits.iter().flat_map(|named| &named.fit.parameters) {
        if !all.iter().any(|(name, _)| *name == parameter.name) {
            all.push((&parameter.name, &parameter.unit));
        }
    }
    all
}
