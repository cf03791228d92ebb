//! Yaw, pitch and roll over a trial; beside a model also their residuals, with the 95 % band of the measurement.

use super::panel::{Axis, LEFT_MM, Panel};
use super::sheet::{MEASURED, MM, MODEL, Sheet, Stroke};
use crate::PageError;
use crate::points::points;
use study::trial::Judged;
use study::twin::{Compared, Point};

const ANGLES: [&str; 3] = ["Yaw ψ (°)", "Pitch θ (°)", "Roll φ (°)"];

const ANGLE_MM: f64 = 24.0;
const RESIDUAL_MM: f64 = 11.0;
const GAP_MM: f64 = 3.0;

/// Draws a trial.
///
/// # Errors
/// [`PageError::Nothing`] if no sample lies in the time.
pub(super) fn draw(
    trial: &Judged,
    compared: Option<&Compared>,
    time_s: Option<[f64; 2]>,
    width_mm: f64,
) -> Result<String, PageError> {
    let Judged { data, angles: zeroed, .. } = trial;
    // No line is drawn through a gap.
    let points = points(zeroed, &zeroed.angles_deg.broken_at_gaps(), compared);
    let mut points: Vec<Point> = points.into_iter().map(|(_, point)| point).collect();
    points.retain(|point| time_s.is_none_or(|[from, to]| (from..=to).contains(&point.time_s)));
    if points.is_empty() {
        return Err(PageError::Nothing { path: data.path.clone() });
    }
    let half = half(trial);
    let mut sheet = Sheet::new(width_mm);
    let own_stroke = Stroke(MEASURED, 0.9, "");
    let model_stroke = Stroke(MODEL, 0.9, "3 1.5");
    let mut legend = match compared {
        Some(compared) => {
            let [own, other] = compared.comparison.sides.names();
            vec![(own_stroke, own), (model_stroke, other)]
        }
        None => vec![(own_stroke, if data.is_model() { "model" } else { "measured" })],
    };
    let has_band = points.iter().any(|point| point.yaw_uncertainty_deg > 0.0);
    if has_band {
        legend.push((Stroke("#a9cbe0", 4.0, ""), "95 % uncertainty"));
    }
    sheet.legend(LEFT_MM * MM, 3.2 * MM, &legend);

    let times = || points.iter().map(|point| point.time_s);
    let (from, to) = (times().next().unwrap_or(0.0), times().next_back().unwrap_or(1.0));
    let x = Axis::new(from, to.max(from + 1e-3), "Time from the start of the run (s)");
    let mut top = 5.0 * MM;
    for (k, label) in ANGLES.into_iter().enumerate() {
        let is_last = k + 1 == ANGLES.len();
        let values = points.iter().flat_map(|point| [point.measured_deg[k], point.modelled_deg[k]]);
        let y = Axis::about(values, 1.0, label);
        let mut panel = Panel::across(&mut sheet, x.clone(), y, top, ANGLE_MM, is_last && compared.is_none());
        let around = |middle: fn(&Point, usize) -> f64| -> Vec<[f64; 3]> {
            let edges = |point: &Point| {
                let (value, half) = (middle(point, k), half(point, k));
                [point.time_s, value - half, value + half]
            };
            points.iter().map(edges).collect()
        };
        let curve = |of: fn(&Point, usize) -> f64| -> Vec<[f64; 2]> {
            points.iter().map(|point| [point.time_s, of(point, k)]).collect()
        };
        if has_band {
            panel.band(&mut sheet, &around(|point, k| point.measured_deg[k]), MEASURED);
        }
        panel.curve(&mut sheet, &curve(|point, k| point.measured_deg[k]), own_stroke);
        if compared.is_some() {
            panel.curve(&mut sheet, &curve(|point, k| point.modelled_deg[k]), model_stroke);
            top += panel.height + 1.2 * MM;
            let residual = |point: &Point, k: usize| point.modelled_deg[k] - point.measured_deg[k];
            // Before the run, neither attitude has its zero.
            let in_run = points.iter().filter(|point| point.time_s >= 0.0);
            let values = in_run.flat_map(|point| [residual(point, k), half(point, k), -half(point, k)]);
            let y = Axis::about(values, 0.1, "Δ (°)");
            panel = Panel::across(&mut sheet, x.clone(), y, top, RESIDUAL_MM, is_last);
            if has_band {
                panel.band(&mut sheet, &around(|_, _| 0.0), MEASURED);
            }
            panel.curve(&mut sheet, &curve(residual), Stroke(MODEL, 0.7, ""));
        }
        top += panel.height + GAP_MM * MM;
    }
    Ok(sheet.svg(top + 5.0 * MM))
}

/// Returns a function for half of the 95 % band of an angle at a point; NaN if it is unknown.
fn half(trial: &Judged) -> impl Fn(&Point, usize) -> f64 {
    let Judged { data, angles: zeroed, .. } = trial;
    // The band of pitch and roll is that of a mean over 2 s at the end of the run, the shortest time whose noise is known.
    // The angles of a model have no uncertainty.
    let last = zeroed.run.end - 2.0..zeroed.run.end;
    let tilt = zeroed.tilt_uncertainty(&last).filter(|_| !data.is_model()).unwrap_or([f64::NAN; 2]);
    move |point, k| match k {
        0 if point.yaw_uncertainty_deg > 0.0 => point.yaw_uncertainty_deg,
        0 => f64::NAN,
        k => tilt[k - 1],
    }
}
