//! The zero of the tilt at rest, with its noise and a possible remaining motion.

use super::budget::{CommonTo, Term};
use super::rest_fit::{BLOCK_S, RestFit};
use crate::attitude::Track;
use sim::functions::{exp, powi};
use std::ops::Range;

/// Assumed prior for rests without a wait: share with a motion, and standard deviation of the motion relative to the
/// uncertainty of its estimate.
const MOVING: f64 = 2.0 / 3.0;
const SEEN: f64 = 2.0;

/// Assumed prior share of rests in which the robot is disturbed after the recorder's wait.
const TOUCHED: f64 = 0.05;

/// The zero of the tilt at rest.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct TiltZero {
    /// Noise and motion of pitch and roll.
    fits: [RestFit; 2],
    /// Standard deviation of the motion that may remain in pitch and roll, degrees.
    moved_deg: [f64; 2],
    /// Length of the zero, s.
    zero_s: f64,
    /// Time constant of the board's filter, s.
    filter_s: f64,
}

impl TiltZero {
    /// Estimates the noise of pitch and roll in a still phase whose last part, `zero`, gives the zero; returns `None`
    /// if the phase is too short. `filter_s`, `righting_s`: time constants of the board's filter and of the return to
    /// rest; `waited_deg`: see [`super::righting::left_deg`].
    pub fn of(
        tilts: [Track; 2],
        still: &Range<f64>,
        zero: &Range<f64>,
        [filter_s, righting_s]: [f64; 2],
        waited_deg: f64,
    ) -> Option<Self> {
        let fit = |tilt: Track| RestFit::of(tilt, still, zero, filter_s, righting_s);
        let fits = [fit(tilts[0])?, fit(tilts[1])?];
        let moved_deg = fits.map(|fit| moved_deg(fit.left_deg, waited_deg));
        Some(Self { fits, moved_deg, zero_s: zero.end - zero.start, filter_s })
    }

    /// Returns the causes of uncertainty of an angle averaged over `window_s`. `gradient`: its derivatives with respect
    /// to pitch and roll.
    pub fn terms(&self, gradient: [f64; 2], window_s: f64) -> [Term; 2] {
        let noise = |fit: RestFit| fit.variance(window_s.max(BLOCK_S), self.filter_s) + self.zero_variance(fit);
        let noises = [0, 1].map(|k| (gradient[k] * noise(self.fits[k]).sqrt(), self.fits[k].freedom));
        let motions = [0, 1].map(|k| (gradient[k] * self.moved_deg[k], f64::INFINITY));
        [("noise", noises), ("motion at rest", motions)].map(|(name, parts)| Term::new(name, CommonTo::Trial, parts))
    }

    /// Returns the variance of the mean of a block of pitch (0) or roll (1), degrees².
    pub fn block_variance(&self, tilt: usize) -> f64 {
        self.fits[tilt].variance(BLOCK_S, self.filter_s)
    }

    /// Returns the variance of the zero of pitch (0) or roll (1), degrees².
    pub fn variance(&self, tilt: usize) -> f64 {
        self.zero_variance(self.fits[tilt]) + powi(self.moved_deg[tilt], 2)
    }

    fn zero_variance(&self, fit: RestFit) -> f64 {
        fit.variance(self.zero_s, self.filter_s)
    }
}

/// Returns the root mean square of the remaining motion in the zero, degrees, from its estimate at rest and the
/// estimate's standard uncertainty. `waited_deg`: standard deviation after the recorder's wait; 0 without one. A wait
/// gives no bound if the robot is touched afterwards.
fn moved_deg([estimate, u]: [f64; 2], waited_deg: f64) -> f64 {
    if u == 0.0 {
        return estimate.abs();
    }
    // Variance of the estimate without a motion, or with the motion that may remain after the wait.
    let (usual, share) = if waited_deg > 0.0 { (powi(waited_deg, 2), TOUCHED) } else { (0.0, MOVING) };
    // Other motions are assumed to exceed the uncertainty several times; smaller ones could not be detected.
    let [usual_variance, other_variance] = [usual + u * u, (1.0 + SEEN * SEEN) * u * u];
    let log_ratio = 0.5 * estimate * estimate * (1.0 / usual_variance - 1.0 / other_variance);
    let is_usual = (1.0 - share) / share * (other_variance / usual_variance).sqrt() * exp(-log_ratio);
    let moves = 1.0 / (1.0 + is_usual);
    // The motion is not removed from the zero: the error contains both its estimate and the estimate's uncertainty.
    let known = usual / usual_variance;
    let left = powi(known * estimate, 2) + known * u * u;
    let moved = estimate * estimate + u * u;
    (moves * moved + (1.0 - moves) * left).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::Columns;

    /// Returns the zero of a tilt of one degree that returns to rest from time 0 on, and the tilt that remains in it.
    fn zero(time_constant_s: f64, still: Range<f64>, over: &Range<f64>) -> (TiltZero, f64) {
        let tilt = |time_s: f64| (-time_s / time_constant_s).exp();
        let mut columns = Columns::<1>::default();
        (0..6000).map(|i| 0.005 * f64::from(i)).for_each(|time| columns.push(time, [tilt(time)]));
        let track = columns.track(0);
        (
            TiltZero::of([track; 2], &still, over, [1.0, time_constant_s], 0.0).unwrap(),
            track.mean(over.clone()).unwrap(),
        )
    }

    #[test]
    fn tilt_that_is_left_in_the_zero_is_within_its_uncertainty() {
        for (time_constant_s, still, over) in
            [(12.0, 10.0..20.0, 10.0..20.0), (12.0, 0.0..7.0, 3.5..7.0), (45.0, 10.0..20.0, 10.0..20.0)]
        {
            let (zero, left_deg) = zero(time_constant_s, still.clone(), &over);
            let stated_deg = 1.96 * zero.variance(0).sqrt();
            println!("{time_constant_s} s, {still:?}: {left_deg:.2} of ±{stated_deg:.2} degrees");
            assert!(left_deg < stated_deg && stated_deg < 2.0 * left_deg, "{time_constant_s} s, {still:?}");
        }
    }
}
