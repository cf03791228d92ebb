//! Estimates the decay of the slow coordinates from the motion.
//!
//! Two periods of a motion pass the same motor angles, so their difference contains only decaying parts and nothing
//! that turns with the motors. The difference obeys a linear law, d(t + h) = B d(t), and B is fitted to its samples by
//! least squares: the dynamic mode decomposition (Schmid 2010, J. Fluid Mech. 656, 5). Older samples count less, because the
//! law changes on the way: flagella come into contact, wrap and unwrap. Directions without an observed difference get an
//! assumed common decay.

use super::slow::{COORDINATES, Slow};
use crate::functions::exp;
use nalgebra::SMatrix;

pub type Map = SMatrix<f64, COORDINATES, COORDINATES>;

/// Time constant of directions in which no difference was seen, s.
pub const ASSUMED_S: f64 = 6.0;
/// Weight of the assumed decay against a sample of unit size.
const ASSUMED_WEIGHT: f64 = 1e-4;
/// Differences of about this size (rad) or less count less: they contain the errors of the steps.
const NOISE: f64 = 2e-3;
/// Time in which the weight of a sample falls by a factor e, s.
const MEMORY_S: f64 = 17.0;
/// Power of B that shows whether a difference grows: its norm is below 1 if the decay is at least a thousandth per interval.
const FAR: u32 = 1024;

/// The law of decay over a sampling interval.
#[derive(Clone, Debug)]
pub struct Modes {
    /// Sums over samples of d(t + h) d(t)' and d(t) d(t)', including the assumed decay.
    products: [Map; 2],
    /// The part of the assumed decay in these sums.
    assumed: [Map; 2],
    /// Share of their weight that samples keep over a period.
    kept: f64,
}

impl Modes {
    /// `interval`: time between samples, s; `period`: period of the motion, s.
    pub fn new(interval: f64, period: f64) -> Self {
        let weight = Map::identity() * ASSUMED_WEIGHT;
        let assumed = [weight * exp(-interval / ASSUMED_S), weight];
        Self { products: assumed, assumed, kept: exp(-period / MEMORY_S) }
    }

    /// Adds the samples of two periods at the same angles of the motors.
    pub fn record(&mut self, one: &[Slow], other: &[Slow]) {
        for (sum, assumed) in self.products.iter_mut().zip(&self.assumed) {
            *sum = *sum * self.kept + assumed * (1.0 - self.kept);
        }
        let differences: Vec<Slow> = one.iter().zip(other).map(|(a, b)| b - a).collect();
        let size = differences.iter().map(|d| d.norm_squared()).fold(0.0, f64::max);
        for pair in differences.windows(2) {
            let weight = 1.0 / (size + NOISE * NOISE);
            self.products[0] += pair[1] * pair[0].transpose() * weight;
            self.products[1] += pair[0] * pair[0].transpose() * weight;
        }
    }

    fn map(&self) -> Map {
        let [ahead, now] = self.products;
        now.try_inverse().map_or(Map::identity(), |inverse| ahead * inverse)
    }

    /// Returns whether a difference in some direction grows: the motion is not stable, or not known well enough.
    pub fn grow(&self) -> bool {
        // No eigenvalues: their iteration has no bound and does not end for some matrices.
        let far = self.map().pow(FAR).norm();
        far.is_nan() || far > 1.0
    }

    /// Returns the map (I - M)⁻¹ from the change over a period of `intervals` intervals to the Newton step; `None` if a
    /// direction does not decay.
    pub fn newton(&self, intervals: usize) -> Option<Map> {
        (Map::identity() - self.map().pow(intervals as u32)).try_inverse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: f64 = 0.5;

    /// Returns modes from two periods of 6 s. Their difference begins with `start`; direction i is multiplied by `factors[i]`
    /// in an interval.
    fn modes(start: Slow, factors: Slow) -> Modes {
        let mut modes = Modes::new(INTERVAL, 6.0);
        let other: Vec<Slow> = (0..12).map(|k| start.component_mul(&factors.map(|f| f.powi(k)))).collect();
        modes.record(&[Slow::zeros(); 12], &other);
        modes
    }

    #[test]
    fn a_step_leads_to_where_the_difference_has_decayed() {
        let factors = Slow::from_fn(|i, _| (-INTERVAL / (2.0 + i as f64)).exp());
        let start = Slow::from_fn(|i, _| if i == 3 { 0.1 } else { 0.0 });
        let modes = modes(start, factors);
        assert!(!modes.grow());
        // A period of 12 intervals changes a difference d by (m - 1) d; the step takes all of it away.
        let change = start * (factors[3].powi(12) - 1.0);
        let step = modes.newton(12).expect("it decays") * change;
        assert!((step + start).norm() < 1e-2 * start.norm(), "{step}");
    }

    #[test]
    fn what_grows_is_seen() {
        let start = Slow::from_fn(|i, _| if i == 5 { 0.1 } else { 0.0 });
        assert!(modes(start, Slow::repeat(1.034)).grow());
        assert!(!modes(start, Slow::repeat(0.99)).grow());
    }
}
