//! The forces of both flagella on the base over a trial, in body axes; z is the thrust.

use super::FigureError;
use super::panel::{Axis, Panel};
use super::sheet::{FLAGELLA, MM, Sheet, Stroke};
use sim::trial::quantity::FORCE;
use study::trial::Data;

const LEFT_MM: f64 = 13.0;
const RIGHT_MM: f64 = 3.0;
const PANEL_MM: f64 = 24.0;

/// Draws the forces of a trial.
///
/// # Errors
/// [`FigureError::NoForces`] if the log has none: only a model knows them; [`FigureError::Nothing`] if no sample lies in the
/// time.
pub(super) fn draw(data: &Data, time_s: Option<[f64; 2]>, width_mm: f64) -> Result<String, FigureError> {
    if data.forces.is_empty() {
        return Err(FigureError::NoForces { path: data.path.clone() });
    }
    let start = data.times.run.start;
    let times = &data.forces.time_s;
    let mut sheet = Sheet::new(width_mm);
    let strokes = FLAGELLA.map(|colour| Stroke(colour, 0.8, ""));
    sheet.legend(LEFT_MM * MM, 3.2 * MM, &[(strokes[0], "flagellum 1"), (strokes[1], "flagellum 2")]);
    let [from, to] = time_s.unwrap_or([times[0] - start, times[times.len() - 1] - start]);
    if !times.iter().any(|time| (from..=to).contains(&(time - start))) {
        return Err(FigureError::Nothing { path: data.path.clone() });
    }
    let x = Axis::new(from, to.max(from + 1e-3), "Time from the start of the run (s)");
    let mut top = 5.0 * MM;
    for (axis, label) in ["Force x (mN)", "Force y (mN)", "Force z (mN)"].into_iter().enumerate() {
        let curves = [axis, axis + 3].map(|column| -> Vec<[f64; 2]> {
            let forces = &data.forces.values[FORCE.in_sample()][column];
            let points = times.iter().zip(forces).map(|(time, force)| [time - start, force * 1e3]);
            points.filter(|[time, _]| (from..=to).contains(time)).collect()
        });
        let panel = Panel {
            x: x.clone(),
            y: Axis::about(curves.iter().flatten().map(|[_, force]| *force), 0.1, label),
            left: LEFT_MM * MM,
            top,
            width: sheet.width - (LEFT_MM + RIGHT_MM) * MM,
            height: PANEL_MM * MM,
        };
        panel.frame(&mut sheet, axis == 2);
        sheet.upright(3.2 * MM, top + 0.5 * panel.height, label);
        for (curve, stroke) in curves.iter().zip(strokes) {
            panel.curve(&mut sheet, curve, stroke);
        }
        top += panel.height + 2.5 * MM;
    }
    Ok(sheet.svg(top + 5.5 * MM))
}
