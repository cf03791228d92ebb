//! Contact of the flagella over a modelled trial: their gap, their winding around each other, and a ribbon that shows when they
//! are apart, in touch or bundled.

use super::forces::range;
use super::panel::{Axis, LEFT_MM, Panel, RIGHT_MM};
use super::sheet::{FONT_PT, INK, MEASURED, MM, Sheet, Stroke};
use crate::PageError;
use sim::contact::bundling::Bundling;
use sim::trial::quantity::{MIN_GAP, WINDING};
use study::trial::Data;

const PANEL_MM: f64 = 24.0;
const RIBBON_MM: f64 = 3.0;

/// The colours of the ribbon, from apart to bundled.
const RIBBON: [(Bundling, &str, &str); 3] = [
    (Bundling::Apart, "apart", "#e7eaec"),
    (Bundling::Touching, "touching", "#f0b870"),
    (Bundling::Bundled, "bundled", "#b8651b"),
];

/// Draws gap, winding and ribbon of a trial.
///
/// # Errors
/// [`PageError::WrongUse`] if the log has no such data, which only models have; [`PageError::Nothing`] if no sample lies in the
/// time.
pub(super) fn draw(data: &Data, time_s: Option<[f64; 2]>, width_mm: f64) -> Result<String, PageError> {
    let [from, to] = range(data, time_s)?;
    let (start, times) = (data.times.run.start, &data.forces.time_s);
    let shown = |time: &f64| (from..=to).contains(&(time - start));
    let mut sheet = Sheet::new(width_mm);
    let x = Axis::new(from, to.max(from + 1e-3), "Time from the start of the run (s)");
    let mut top = 3.0 * MM;
    for (of, scale, least, label) in [(MIN_GAP, 1e3, 1.0, "Smallest gap (mm)"), (WINDING, 1.0, 0.1, "Winding (turns)")]
    {
        let is_last = of.in_sample() == WINDING.in_sample();
        let values = times.iter().zip(&data.forces.values[of.in_sample()][0]).filter(|(time, _)| shown(time));
        let curve: Vec<[f64; 2]> = values.map(|(time, value)| [time - start, value * scale]).collect();
        let y = Axis::about(curve.iter().map(|[_, value]| *value), least, label);
        let panel = Panel::across(&mut sheet, x.clone(), y, top, PANEL_MM, is_last);
        panel.curve(&mut sheet, &curve, Stroke(MEASURED, 0.8, ""));
        top += panel.height + if is_last { 8.5 * MM } else { 2.5 * MM };
    }
    ribbon(&mut sheet, data, [from, to], top);
    Ok(sheet.svg(top + RIBBON_MM * MM + 2.4 * FONT_PT))
}

/// Draws the ribbon and its legend.
fn ribbon(sheet: &mut Sheet, data: &Data, [from, to]: [f64; 2], top: f64) {
    let changes = data.records.steady.as_ref().map(|steady| steady.bundling_changes.as_slice()).unwrap_or_default();
    let (left, width) = (LEFT_MM * MM, sheet.width - (LEFT_MM + RIGHT_MM) * MM);
    let at = |time_s: f64| left + ((time_s - from) / (to - from)).clamp(0.0, 1.0) * width;
    let starts = || changes.iter().map(|change| change.time_s - data.times.run.start);
    let colour = |state| RIBBON.iter().find(|(of, ..)| *of == state).map_or(INK, |(.., colour)| colour);
    for ((change, begin), end) in changes.iter().zip(starts()).zip(starts().skip(1).chain([f64::INFINITY])) {
        let [x0, x1] = [at(begin), at(end)];
        if x1 > x0 {
            sheet.rect([x0, top], [x1 - x0, RIBBON_MM * MM], colour(change.bundling));
        }
    }
    let mut x = left;
    for (_, name, colour) in RIBBON {
        sheet.rect([x, top + RIBBON_MM * MM + 0.8 * FONT_PT], [7.0, 0.8 * FONT_PT], colour);
        sheet.text(x + 10.0, top + RIBBON_MM * MM + 1.5 * FONT_PT, "start", name);
        x += 24.0 + 0.56 * FONT_PT * name.len() as f64;
    }
}
