//! Yaw, pitch and roll over a trial; beside a model also their residuals, with the 95 % band of the measurement.

use super::panel::{Axis, LEFT_MM, Panel};
use super::sheet::{MEASURED, MM, MODEL, Sheet, Stroke};
use crate::PageError;
use study::trial::Judged;
use study::twin::Compared;

const ANGLES: [&str; 3] = ["Yaw ψ (°)", "Pitch θ (°)", "Roll φ (°)"];

const ANGLE_MM: f64 = 24.0;
const RESIDUAL_MM: f64 = 11.0;
const GAP_MM: f64 = 3.0;

/// What is drawn of a trial: measured and modelled angles at a time from the start of the run, and the measurement's 95 %
/// uncertainty; NaN where there is none.
#[derive(Clone, Copy, Debug)]
struct Sample {
    time_s: f64,
    own_deg: [f64; 3],
    model_deg: [f64; 3],
    uncertainty_deg: [f64; 3],
}

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
    let data = &trial.data;
    let mut samples = samples(trial, compared);
    samples.retain(|sample| time_s.is_none_or(|[from, to]| (from..=to).contains(&sample.time_s)));
    if samples.is_empty() {
        return Err(PageError::Nothing { path: data.path.clone() });
    }
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
    let has_band = samples.iter().any(|sample| sample.uncertainty_deg[0] > 0.0);
    if has_band {
        legend.push((Stroke("#a9cbe0", 4.0, ""), "95 % uncertainty"));
    }
    sheet.legend(LEFT_MM * MM, 3.2 * MM, &legend);

    let times = || samples.iter().map(|sample| sample.time_s);
    let (from, to) = (times().next().unwrap_or(0.0), times().next_back().unwrap_or(1.0));
    let x = Axis::new(from, to.max(from + 1e-3), "Time from the start of the run (s)");
    let mut top = 5.0 * MM;
    for (k, label) in ANGLES.into_iter().enumerate() {
        let is_last = k + 1 == ANGLES.len();
        let values = samples.iter().flat_map(|sample| [sample.own_deg[k], sample.model_deg[k]]);
        let mut panel = Panel::across(&sheet, x.clone(), Axis::about(values, 1.0, label), top, ANGLE_MM);
        panel.frame(&mut sheet, is_last && compared.is_none());
        sheet.upright(3.2 * MM, top + 0.5 * panel.height, label);
        let around = |middle: fn(&Sample, usize) -> f64| -> Vec<[f64; 3]> {
            let edges = |sample: &Sample| {
                let (value, half) = (middle(sample, k), sample.uncertainty_deg[k]);
                [sample.time_s, value - half, value + half]
            };
            samples.iter().map(edges).collect()
        };
        let curve = |of: fn(&Sample, usize) -> f64| -> Vec<[f64; 2]> {
            samples.iter().map(|sample| [sample.time_s, of(sample, k)]).collect()
        };
        if has_band {
            panel.band(&mut sheet, &around(|sample, k| sample.own_deg[k]), MEASURED);
        }
        panel.curve(&mut sheet, &curve(|sample, k| sample.own_deg[k]), own_stroke);
        if compared.is_some() {
            panel.curve(&mut sheet, &curve(|sample, k| sample.model_deg[k]), model_stroke);
            top += panel.height + 1.2 * MM;
            let residual = |sample: &Sample, k: usize| sample.model_deg[k] - sample.own_deg[k];
            // Before the run, neither attitude has its zero.
            let in_run = samples.iter().filter(|sample| sample.time_s >= 0.0);
            let values =
                in_run.flat_map(|sample| [residual(sample, k), sample.uncertainty_deg[k], -sample.uncertainty_deg[k]]);
            (panel.y, panel.top, panel.height) = (Axis::about(values, 0.1, ""), top, RESIDUAL_MM * MM);
            panel.frame(&mut sheet, is_last);
            sheet.upright(3.2 * MM, top + 0.5 * panel.height, "Δ (°)");
            if has_band {
                panel.band(&mut sheet, &around(|_, _| 0.0), MEASURED);
            }
            panel.curve(&mut sheet, &curve(residual), Stroke(MODEL, 0.7, ""));
        }
        top += panel.height + GAP_MM * MM;
    }
    Ok(sheet.svg(top + 5.0 * MM))
}

fn samples(trial: &Judged, compared: Option<&Compared>) -> Vec<Sample> {
    let Judged { data, angles: zeroed, .. } = trial;
    // The band of pitch and roll is that of a mean over 2 s at the end of the run, the shortest time whose noise is known.
    // The angles of a model have no uncertainty.
    let last = zeroed.run.end - 2.0..zeroed.run.end;
    let tilt = zeroed.tilt_uncertainty(&last).filter(|_| !data.is_model()).unwrap_or([f64::NAN; 2]);
    let uncertainty = |yaw: Option<f64>| [yaw.filter(|deg| *deg > 0.0).unwrap_or(f64::NAN), tilt[0], tilt[1]];
    match compared {
        Some(compared) => {
            let sample = |point: &study::twin::Point| Sample {
                time_s: point.time_s,
                own_deg: point.measured_deg,
                model_deg: point.modelled_deg,
                uncertainty_deg: uncertainty(Some(point.yaw_uncertainty_deg)),
            };
            compared.points.iter().map(sample).collect()
        }
        None => {
            // No line is drawn through a gap.
            let angles = zeroed.angles_deg.broken_at_gaps();
            let sample = |(i, time): (usize, &f64)| Sample {
                time_s: time - zeroed.run.start,
                own_deg: angles.row(i),
                model_deg: [f64::NAN; 3],
                uncertainty_deg: uncertainty(zeroed.yaw_uncertainty(*time)),
            };
            angles.time_s.iter().enumerate().map(sample).collect()
        }
    }
}
