//! Time formulas that are exact for {1, t, t^2, cos wt, sin wt} on any grid.
//!
//! In the frame that rotates with a motor the shape of a flagellum is not steady: its sideways
//! deflection is steady in the laboratory and so rotates at the motor's speed. A backward formula that
//! is exact for that motion (trigonometric fitting, Gautschi 1961) takes steps ten times longer than
//! one that is exact for polynomials. As w goes to 0 the basis becomes {1, t, t^2, t^3, t^4}, and on an even grid the
//! formula becomes BDF4.
//!
//! The other flagellum and the tilted base move a flagellum with other frequencies: the difference of the motors' speeds, and
//! twice its own. For these the formula has fourth order. A formula of third order ({1, t, cos wt, sin wt}) tilts the base by
//! up to 0.3 deg at fast opposite speeds with steps of 0.3 rad, because the errors of oscillations do not average out in a
//! load that depends on the shape.

use crate::functions::{cos, powi, sin};
use crate::linear::eliminate;

/// Points a formula can use.
pub const POINTS: usize = 5;

/// Below these angles (rad) the sine with the versine, the cubic and the quartic come from their series: the closed forms
/// cancel.
const SERIES: [f64; 3] = [0.05, 0.1, 0.2];

/// Returns the values of the basis at time `tau`, scaled so that it stays regular as the angle goes to 0.
///
/// Two points: {1, t}; three: {1, sin, 1 - cos}; four: {1, t, 1 - cos, wt - sin}; five: {1, t, t^2, wt - sin, cos - 1 + (wt)^2/2};
/// each over its leading power.
fn basis(points: usize, angle: f64, tau: f64) -> [f64; POINTS] {
    let x = angle * tau;
    let x2 = x * x;
    let sine = || if x.abs() < SERIES[0] { tau * (1.0 - x2 / 6.0 + x2 * x2 / 120.0) } else { sin(x) / angle };
    let versine = || match x.abs() < SERIES[0] {
        true => tau * tau * (1.0 - x2 / 12.0 + x2 * x2 / 360.0),
        false => 2.0 * (1.0 - cos(x)) / (angle * angle),
    };
    let cubic = || match x.abs() < SERIES[1] {
        true => powi(tau, 3) * (1.0 - x2 / 20.0 + x2 * x2 / 840.0 - powi(x2, 3) / 60480.0),
        false => 6.0 * (x - sin(x)) / powi(angle, 3),
    };
    let quartic = || match x.abs() < SERIES[2] {
        true => powi(tau, 4) * (1.0 - x2 / 30.0 + x2 * x2 / 1680.0 - powi(x2, 3) / 151_200.0),
        false => 24.0 * (cos(x) - 1.0 + 0.5 * x2) / powi(angle, 4),
    };
    match points {
        1 => [1.0, 0.0, 0.0, 0.0, 0.0],
        2 => [1.0, tau, 0.0, 0.0, 0.0],
        3 => [1.0, sine(), versine(), 0.0, 0.0],
        4 => [1.0, tau, versine(), cubic(), 0.0],
        _ => [1.0, tau, tau * tau, cubic(), quartic()],
    }
}

/// Returns the weights of `times`: the weighted sum of each basis function's values equals its entry in `right`.
fn weights(angle: f64, times: &[f64], right: [f64; POINTS]) -> [f64; POINTS] {
    let size = times.len().min(POINTS);
    let mut rows = [[0.0; POINTS + 1]; POINTS];
    for (j, &tau) in times.iter().take(size).enumerate() {
        for (row, value) in rows.iter_mut().zip(basis(size, angle, tau)) {
            row[j] = value;
        }
    }
    for (row, value) in rows.iter_mut().zip(right) {
        row[size] = value;
    }
    let mut out = [0.0; POINTS];
    eliminate(&mut rows[..size], &mut out[..size]);
    out
}

/// Returns the weights a_j of a backward formula: step times the derivative at time 0 is about the sum of a_j x(times_j).
///
/// `times`: 0 first, then the past in units of the step (-1, -2, ...), at most five, all different;
/// `angle`: w times the step, rad.
pub fn derivative(angle: f64, times: &[f64]) -> [f64; POINTS] {
    weights(angle, times, [0.0, 1.0, 0.0, 0.0, 0.0])
}

/// Returns the weights b_j of the value at `at` from the values at `times`, exact for the same functions.
pub fn value_at(angle: f64, times: &[f64], at: f64) -> [f64; POINTS] {
    let shifted: [f64; POINTS] = std::array::from_fn(|j| times.get(j).map_or(0.0, |t| t - at));
    weights(angle, &shifted[..times.len().min(POINTS)], [1.0, 0.0, 0.0, 0.0, 0.0])
}

/// Returns the error of a new point over its distance from the extrapolation of the past (Milne 1926).
///
/// `first_weight`: the derivative's weight of the new point; `oldest`: time of the oldest point of the extrapolation, as
/// in [`derivative`]. Derivative and extrapolation are not exact for the first function that their basis lacks. It has
/// one divided difference over the new point and the past. The extrapolation's error is this difference times the
/// distances of all past points; the derivative's is the same without the oldest point, with the opposite sign. The
/// derivative's error over `first_weight` is the error of the new point. If the derivative takes as many past points as
/// the extrapolation, its error is less.
pub fn error_share(first_weight: f64, oldest: f64) -> f64 {
    1.0 / (1.0 + first_weight * oldest.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bdf4_for_a_motor_at_rest() {
        let a = derivative(0.0, &[0.0, -1.0, -2.0, -3.0, -4.0]);
        for (got, want) in a.into_iter().zip([25.0 / 12.0, -4.0, 3.0, -4.0 / 3.0, 0.25]) {
            assert!((got - want).abs() < 1e-13);
        }
    }

    #[test]
    fn the_error_is_a_share_of_the_distance_from_the_extrapolation() {
        // The first function that the basis lacks.
        let x = |t: f64| (t + 0.2).powi(5);
        let times = [0.0, -1.0, -2.6, -3.1, -5.0, -5.7];
        let a = derivative(0.0, &times);
        let b = value_at(0.0, &times[1..], 0.0);
        // The new point for which the formula gives the true derivative there.
        let rest: f64 = (1..POINTS).map(|j| a[j] * x(times[j])).sum();
        let point = (5.0 * 0.2f64.powi(4) - rest) / a[0];
        let extrapolated: f64 = (0..POINTS).map(|j| b[j] * x(times[j + 1])).sum();
        let share = error_share(a[0], times[POINTS]);
        assert!(((point - x(0.0)) / (point - extrapolated) - share).abs() < 1e-12);
        let even = derivative(0.0, &[0.0, -1.0, -2.0, -3.0, -4.0]);
        assert!((error_share(even[0], -5.0) - 12.0 / 137.0).abs() < 1e-14);
    }

    #[test]
    fn exact_for_turning_motion_on_an_uneven_grid() {
        let times = [0.0, -0.7, -1.9, -2.4, -3.6];
        for angle in [1e-6, 0.04, 0.38, 1.0] {
            let (a, b) = (derivative(angle, &times), value_at(angle, &times, 0.6));
            let x = |t: f64| 0.3 - 0.2 * t + 0.1 * t * t + (angle * t + 0.5).cos();
            let sum = |w: [f64; POINTS]| -> f64 { w.iter().zip(times).map(|(w, t)| w * x(t)).sum() };
            assert!((sum(a) - (-0.2 - angle * 0.5f64.sin())).abs() < 1e-9, "{angle}");
            assert!((sum(b) - x(0.6)).abs() < 1e-9, "{angle}");
        }
    }
}
