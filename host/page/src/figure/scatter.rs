//! Predicted against measured steady angles, with 95 % bars of the measurement and the model's own error.

use super::panel::{Axis, Panel};
use super::sheet::{FONT_PT, INK, MEASURED, MM, Sheet, Stroke, straight};
use study::text::{capitalised, decimal};
use study::twin::{Comparison, Sides};

const ANGLES: [&str; 3] = ["Yaw ψ (°)", "Pitch θ (°)", "Roll φ (°)"];

/// Fill and edge of a dot whose uncertainty is unknown: it has no bar, and must not look exact.
const OPEN: (&str, Stroke) = ("#ffffff", Stroke(MEASURED, 0.7, ""));

/// Steady values of a trial: measured and predicted, with half the length of their bars.
#[derive(Clone, Copy, Debug)]
struct Mark {
    at: [f64; 2],
    bars: [f64; 2],
    /// Whether the uncertainty of the measurement is known.
    is_known: bool,
}

/// Draws the trials of a comparison, a panel for each angle.
pub(super) fn draw(trials: &[Comparison], width_mm: f64) -> String {
    let mut sheet = Sheet::new(width_mm);
    let [own, other] = match trials.first().map_or(Sides::default(), |trial| trial.sides) {
        Sides::MeasurementAndModel => ["measured", "predicted"],
        sides => sides.names(),
    };
    let (left, right, top, under) = (11.0 * MM, 1.5 * MM, 2.0 * MM, 9.5 * MM);
    // Three in a row if each panel is at least 30 mm wide.
    let columns = if sheet.width >= 3.0 * (left + right + 30.0 * MM) { 3 } else { 2 };
    let column = sheet.width / columns as f64;
    let size = column - left - right;
    for (k, label) in ANGLES.into_iter().enumerate() {
        let marks: Vec<Mark> = trials.iter().map(|trial| mark(trial, k)).collect();
        let ends = marks.iter().flat_map(|mark| [0, 1].map(|i| [mark.at[i] - mark.bars[i], mark.at[i] + mark.bars[i]]));
        let axis = Axis::about(ends.flatten(), 1.0, "");
        let named = |of: &str| Axis { label: format!("{of} {}", label.to_lowercase()), ..axis.clone() };
        let panel = Panel {
            x: named(&capitalised(own)),
            y: named(&capitalised(other)),
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
        let some_unknown = marks.iter().any(|mark| !mark.is_known);
        for Mark { at, bars, is_known } in marks {
            let [x, y] = panel.at(at[0], at[1]);
            let [dx, dy] = [bars[0] / (axis.high - axis.low) * size, bars[1] / (axis.high - axis.low) * size];
            sheet.path(&straight([[x - dx, y], [x + dx, y]]), Stroke(MEASURED, 0.6, ""));
            sheet.path(&straight([[x, y - dy], [x, y + dy]]), Stroke(MEASURED, 0.6, ""));
            let (fill, edge) = if is_known { (MEASURED, Stroke("#ffffff", 0.3, "")) } else { OPEN };
            sheet.dot([x, y], 1.4, fill, edge);
        }
        if some_unknown {
            sheet.text(panel.left + 3.0, panel.top + 1.4 * FONT_PT, "start", "open: uncertainty unknown");
        }
        let text = format!("RMS error {}°", decimal(rms, 2));
        sheet.text(panel.left + size - 3.0, panel.bottom() - 3.0, "end", &text);
    }
    let rows = ANGLES.len().div_ceil(columns) as f64;
    sheet.svg(rows * (top + size + under))
}

fn mark(trial: &Comparison, k: usize) -> Mark {
    let angle = &trial.angles[k];
    Mark {
        at: [angle.measured_deg, angle.modelled_deg],
        bars: [
            angle.uncertainty.map_or(0.0, |uncertainty| uncertainty.total_deg),
            angle.model_error_deg.unwrap_or_default(),
        ],
        is_known: angle.uncertainty.is_some(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study::twin::{AngleComparison, Uncertainty};

    #[test]
    fn an_unknown_uncertainty_is_an_open_dot_and_axes_have_the_names_of_the_sides() {
        let angle = |total_deg: f64| {
            let mut angle = AngleComparison::default();
            angle.uncertainty = Some(Uncertainty { total_deg, ..Uncertainty::default() });
            angle
        };
        let mut known = Comparison::default();
        known.angles = [0.4, 0.1, 0.1].map(angle);
        let drawn = draw(std::slice::from_ref(&known), 180.0);
        assert!(drawn.contains("Measured yaw ψ (°)") && drawn.contains("Predicted roll φ (°)"));
        assert!(!drawn.contains("uncertainty unknown"));
        let mut unknown = known;
        (unknown.angles[0], unknown.sides) = (AngleComparison::default(), Sides::Recordings);
        let drawn = draw(&[unknown], 180.0);
        assert!(drawn.contains("First recording yaw ψ (°)") && drawn.contains("Second recording pitch θ (°)"));
        assert_eq!(drawn.matches("open: uncertainty unknown").count(), 1, "in the panel of the yaw alone");
    }
}
