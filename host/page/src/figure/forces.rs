//! The forces of both flagella on the base over a trial, in body axes; z is the thrust.

use super::panel::{Axis, LEFT_MM, Panel};
use super::sheet::{FLAGELLA, MM, Sheet, Stroke};
use crate::PageError;
use sim::trial::quantity::FORCE;
use study::trial::Data;

const PANEL_MM: f64 = 24.0;

/// Returns the time to draw, s from the start of the run; by default the time of all forces.
///
/// # Errors
/// [`PageError::WrongUse`] if the log has no forces, which only models have; [`PageError::Nothing`] if no sample lies in the
/// time.
pub(super) fn range(data: &Data, time_s: Option<[f64; 2]>) -> Result<[f64; 2], PageError> {
    let times = data.forces.time_s.iter().map(|time| time - data.times.run.start);
    let [Some(first), Some(last)] = [times.clone().next(), times.clone().next_back()] else {
        let help = "name a log of the model: `biflag simulate --from LOG` replays a recording";
        return Err(PageError::wrong_use(&data.path, "contains no forces", help));
    };
    let [from, to] = time_s.unwrap_or([first, last]);
    let is_seen = times.clone().any(|time| (from..=to).contains(&time));
    is_seen.then_some([from, to]).ok_or_else(|| PageError::Nothing { path: data.path.clone() })
}

/// Draws the forces of a trial.
///
/// # Errors
/// [`PageError::WrongUse`] if the log has no forces, which only models have; [`PageError::Nothing`] if no sample lies in the
/// time.
pub(super) fn draw(data: &Data, time_s: Option<[f64; 2]>, width_mm: f64) -> Result<String, PageError> {
    let [from, to] = range(data, time_s)?;
    let (start, times) = (data.times.run.start, &data.forces.time_s);
    let mut sheet = Sheet::new(width_mm);
    let strokes = FLAGELLA.map(|colour| Stroke(colour, 0.8, ""));
    sheet.legend(LEFT_MM * MM, 3.2 * MM, &[(strokes[0], "flagellum 1"), (strokes[1], "flagellum 2")]);
    let x = Axis::new(from, to.max(from + 1e-3), "Time from the start of the run (s)");
    let mut top = 5.0 * MM;
    for (axis, label) in ["Force x (mN)", "Force y (mN)", "Force z (mN)"].into_iter().enumerate() {
        let curves = [axis, axis + 3].map(|column| -> Vec<[f64; 2]> {
            let forces = &data.forces.values[FORCE.in_sample()][column];
            let points = times.iter().zip(forces).map(|(time, force)| [time - start, force * 1e3]);
            points.filter(|[time, _]| (from..=to).contains(time)).collect()
        });
        let y = Axis::about(curves.iter().flatten().map(|[_, force]| *force), 0.1, label);
        let panel = Panel::across(&mut sheet, x.clone(), y, top, PANEL_MM, axis == 2);
        for (curve, stroke) in curves.iter().zip(strokes) {
            panel.curve(&mut sheet, curve, stroke);
        }
        top += panel.height + 2.5 * MM;
    }
    Ok(sheet.svg(top + 5.5 * MM))
}
