//! Estimates the remaining time shift between two attitudes aligned at the start of their motors.
//!
//! Motors reach their speed differently, and sensors have different delays. The shift maximises the correlation of the
//! two attitudes, including the still phase before the run, because the start of a transient cannot be located from the
//! transient alone. A correlation does not depend on scale and zero, so a model that turns too far is not mistaken for
//! a late one.

use sim::functions::powi;

/// Points per second of a comparison.
pub(super) const RATE_HZ: f64 = 20.0;

/// Largest shift considered, s.
const LARGEST_S: f64 = 0.5;

/// Steps of the search, s.
const STEP_S: f64 = 0.01;

/// A shift is accepted if it explains at least this share of the variance unexplained without it. A shift cannot
/// explain wrong time constants.
const EXPLAINED: f64 = 0.75;

/// Largest difference that is negligible, degrees RMS.
const NEGLIGIBLE_DEG: f64 = 0.05;

/// Returns the time by which the second attitude must be shifted to match the first, s; 0 if no shift is accepted. Both
/// are sampled at the same times, at [`RATE_HZ`].
pub(super) fn of(measured: &[[f64; 3]], modelled: &[[f64; 3]]) -> f64 {
    let margin = (LARGEST_S * RATE_HZ).ceil() as usize + 1;
    if measured.len() < 4 * margin {
        return 0.0;
    }
    let inside = margin..measured.len() - margin;
    // Variance not explained by a linear function of the other attitude, summed over the angles, degrees².
    let unexplained = |shift: f64| {
        let offset = -shift * RATE_HZ;
        let (whole, share) = (offset.floor(), offset - offset.floor());
        let left = |k: usize| {
            let (mut x, mut y, mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for i in inside.clone() {
                let at = (i as f64 + whole) as usize;
                let (a, b) = (modelled[at][k] * (1.0 - share) + modelled[at + 1][k] * share, measured[i][k]);
                (x, y, xx, xy, yy) = (x + a, y + b, xx + a * a, xy + a * b, yy + b * b);
            }
            let n = inside.len() as f64;
            let (xx, xy, yy) = (xx / n - x * x / n / n, xy / n - x * y / n / n, yy / n - y * y / n / n);
            if xy > 0.0 { (yy - xy * xy / xx).max(0.0) } else { yy }
        };
        left(0) + left(1) + left(2)
    };
    let steps = (LARGEST_S / STEP_S).round() as i32;
    let left: Vec<_> = (-steps..=steps).map(|i| (f64::from(i) * STEP_S, unexplained(f64::from(i) * STEP_S))).collect();
    let now = unexplained(0.0);
    let Some((shift, least)) = left.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)) else { return 0.0 };
    let is_inside = shift.abs() < LARGEST_S - 0.5 * STEP_S;
    if is_inside && now > powi(NEGLIGIBLE_DEG, 2) && least < (1.0 - EXPLAINED) * now { shift } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Returns an attitude whose yaw settles and wobbles.
    fn attitude(shift: f64, gain: f64) -> Vec<[f64; 3]> {
        let at = |t: f64| {
            let yaw = 65.0 * (1.0 - (-(t.max(0.0)) / 2.6).exp());
            [gain * yaw, gain * 4.0 * (1.0 - (-(t.max(0.0)) / 11.0).exp()), 0.2 * (5.2 * t.max(0.0)).sin()]
        };
        (-100..1100).map(|i| at(f64::from(i) / RATE_HZ - shift)).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn a_shift_is_found(shift in -0.4..0.4f64) {
            let found = of(&attitude(shift, 1.0), &attitude(0.0, 1.0));
            prop_assert!((found - shift).abs() < 0.011 || (shift.abs() < 0.03 && found == 0.0), "{found}");
        }
    }

    #[test]
    fn wrong_time_constant_is_not_mistaken_for_a_shift() {
        assert_eq!(of(&attitude(0.0, 1.2), &attitude(0.0, 1.0)), 0.0);
        assert_eq!(of(&attitude(0.0, 1.0)[..40], &attitude(0.3, 1.0)[..40]), 0.0);
    }
}
