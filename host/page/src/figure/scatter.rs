//! Predicted against measured steady angles, with 95 % bars of the measurement and the model's own error.

use super::panel::{Axis, Panel};
use super::sheet::{Anchor, FONT_PT, INK, MEASURED, MM, Sheet, Stroke, short};
use study::text::decimal;
use study::twin::Comparison;

const ANGLES: [&str; 3] = ["Yaw ψ (°)", "Pitch θ (°)", "Roll φ (°)"];

/// Steady values of a trial: measured and predicted, with half the length of their bars; 0 where it is unknown.
#[derive(Clone, Copy, Debug)]
struct Mark {
    at: [f64; 2],
    bars: [f64; 2],
}

/// Draws the trials of a comparison, a panel for each angle.
pub(super) fn draw(trials: &[Comparison], width_mm: f64) -> String {
    let mut sheet = Sheet::new(width_mm);
    let (left, right, top, under) = (11.0 * MM, 1.5 * MM, 2.0 * MM, 9.5 * MM);
    // Three in a row where a panel is 30 mm wide at least.
    let columns = if sheet.width >= 3.0 * (left + right + 30.0 * MM) { 3 } else { 2 };
    let column = sheet.width / columns as f64;
    let size = column - left - right;
    for (k, label) in ANGLES.into_iter().enumerate() {
        let marks: Vec<Mark> = trials.iter().map(|trial| mark(trial, k)).collect();
        let ends = marks.iter().flat_map(|mark| [0, 1].map(|i| [mark.at[i] - mark.bars[i], mark.at[i] + mark.bars[i]]));
        let axis = Axis::about(ends.flatten(), 1.0, "");
        let named = |of: &str| Axis { label: format!("{of} {}", label.to_lowercase()), ..axis.clone() };
        let panel = Panel {
            x: named("Measured"),
            y: named("Predicted"),
            left: left + (k % columns) as f64 * column,
            top: top + (k / columns) as f64 * (top + size + under),
            width: size,
            height: size,
        };
        panel.frame(&mut sheet, true);
        sheet.upright(panel.left - left + 1.1 * FONT_PT, panel.top + 0.5 * size, &panel.y.label);
        panel.curve(&mut sheet, &[[axis.low; 2], [axis.high; 2]], Stroke(INK, 0.5, "2 1.5"));
        let square = marks.iter().map(|mark| (mark.at[1] - mark.at[0]).powi(2)).sum::<f64>();
        let rms = (square / marks.len().max(1) as f64).sqrt();
        for Mark { at, bars } in marks {
            let [x, y] = panel.at(at[0], at[1]);
            let [dx, dy] = [bars[0] / (axis.high - axis.low) * size, bars[1] / (axis.high - axis.low) * size];
            let bar =
                |a: [f64; 2], b: [f64; 2]| format!("M{} {}L{} {}", short(a[0]), short(a[1]), short(b[0]), short(b[1]));
            sheet.path(&bar([x - dx, y], [x + dx, y]), Stroke(MEASURED, 0.6, ""));
            sheet.path(&bar([x, y - dy], [x, y + dy]), Stroke(MEASURED, 0.6, ""));
            sheet.dot([x, y], 1.4, MEASURED, Stroke("#ffffff", 0.3, ""));
        }
        let text = format!("RMS error {}°", decimal(rms, 2));
        sheet.text(panel.left + size - 3.0, panel.bottom() - 3.0, Anchor::End, &text);
    }
    let rows = ANGLES.len().div_ceil(columns) as f64;
    sheet.svg(rows * (top + size + under))
}

fn mark(trial: &Comparison, k: usize) -> Mark {
    let uncertainty = match k {
        0 => trial.yaw_uncertainty_deg,
        _ => trial.tilt_uncertainty_deg[k - 1],
    };
    let model = trial.model_error_deg.map_or(0.0, |error| error[k]);
    Mark { at: [trial.steady_measured_deg[k], trial.steady_modelled_deg[k]], bars: [uncertainty.unwrap_or(0.0), model] }
}
