//! What is left of a shift in time between two attitudes that both begin with their motors.
//!
//! Two rigs reach their speed differently, and their sensors lag differently. The shift is where the cross-correlation of
//! the two attitudes is largest, which is where their difference is least.

use super::compare::RATE_HZ;

/// The largest shift that is looked for, s. What is more is no lag.
const LARGEST_S: f64 = 0.5;

/// Steps of the search, s.
const STEP_S: f64 = 0.01;

/// A shift is believed where it takes away at least this share of the squared difference.
const GAIN: f64 = 0.25;

/// A smaller difference than this needs no explanation, degrees RMS.
const NOTHING_DEG: f64 = 0.05;

/// By how much the second attitude is to be moved forward to lie on the first, s; 0 where nothing calls for it. Both are
/// of the same times, [`RATE_HZ`].
pub(super) fn of(measured: &[[f64; 3]], modelled: &[[f64; 3]]) -> f64 {
    let margin = (LARGEST_S * RATE_HZ).ceil() as usize + 1;
    if measured.len() < 4 * margin {
        return 0.0;
    }
    let inside = margin..measured.len() - margin;
    // Means differ where the model is wrong, and must not draw the shift.
    let mean = |of: &[[f64; 3]], k: usize| of.iter().map(|deg| deg[k]).sum::<f64>() / of.len() as f64;
    let difference = [0, 1, 2].map(|k| mean(modelled, k) - mean(measured, k));
    let cost = |shift: f64| {
        let (mut sum, offset) = (0.0, -shift * RATE_HZ);
        let (whole, share) = (offset.floor(), offset - offset.floor());
        for i in inside.clone() {
            let at = (i as f64 + whole) as usize;
            for k in 0..3 {
                let value = modelled[at][k] * (1.0 - share) + modelled[at + 1][k] * share;
                sum += (value - difference[k] - measured[i][k]).powi(2);
            }
        }
        sum / (3 * inside.len()) as f64
    };
    let steps = (LARGEST_S / STEP_S).round() as i32;
    let costs: Vec<_> = (-steps..=steps).map(|i| (f64::from(i) * STEP_S, cost(f64::from(i) * STEP_S))).collect();
    let now = cost(0.0);
    let Some((shift, least)) = costs.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)) else { return 0.0 };
    let is_inside = shift.abs() < LARGEST_S - 0.5 * STEP_S;
    if is_inside && now > NOTHING_DEG.powi(2) && least < (1.0 - GAIN) * now { shift } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A yaw that settles and wobbles.
    fn attitude(shift: f64, gain: f64) -> Vec<[f64; 3]> {
        let at = |t: f64| {
            let yaw = 65.0 * (1.0 - (-(t.max(0.0)) / 2.6).exp());
            [gain * yaw, gain * 4.0 * (1.0 - (-(t.max(0.0)) / 11.0).exp()), 0.2 * (5.2 * t).sin()]
        };
        (0..1200).map(|i| at(f64::from(i) / RATE_HZ - shift)).collect()
    }

    proptest! {
        #[test]
        fn a_shift_is_found(shift in -0.4..0.4f64) {
            let found = of(&attitude(shift, 1.0), &attitude(0.0, 1.0));
            prop_assert!((found - shift).abs() < 0.011 || (shift.abs() < 0.03 && found == 0.0), "{found}");
        }
    }

    #[test]
    fn a_wrong_model_is_not_taken_for_a_shift() {
        assert_eq!(of(&attitude(0.0, 1.2), &attitude(0.0, 1.0)), 0.0);
        assert_eq!(of(&attitude(0.0, 1.0)[..50], &attitude(0.3, 1.0)[..50]), 0.0);
    }
}
