//! Estimates the decay of the slow coordinates from the motion.
//!
//! Two periods of a motion pass the same motor angles, so their difference contains only decaying parts and nothing
//! that turns with the motors. The difference obeys a linear law, d(t + h) = B d(t), and B is fitted to its samples by
//! least squares: the dynamic mode decomposition (Schmid 2010, J. Fluid Mech. 656, 5). Directions without an observed
//! difference get an assumed common decay.

use super::slow::{COORDINATES, Slow};
use nalgebra::SMatrix;

pub type Map = SMatrix<f64, COORDINATES, COORDINATES>;

/// Time constant of directions in which no difference was seen, s.
const ASSUMED_S: f64 = 6.0;
/// Weight of the assumed decay against a sample of unit size.
const ASSUMED_WEIGHT: f64 = 1e-4;
/// Differences about and below this size, rad, count less: they have the errors of the steps.
const NOISE: f64 = 2e-3;

/// The law of decay over a sampling interval.
#[derive(Clone, Debug)]
pub struct Modes {
    /// Sums over samples of d(t + h) d(t)' and d(t) d(t)'.
    products: [Map; 2],
}

impl Modes {
    /// `interval`: between samples, s.
    pub fn new(interval: f64) -> Self {
        let assumed = Map::identity() * ASSUMED_WEIGHT;
        Self { products: [assumed * (-interval / ASSUMED_S).exp(), assumed] }
    }

    /// Adds the samples of two stretches at the same angles of the motors.
    pub fn record(&mut self, one: &[Slow], other: &[Slow]) {
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
        self.map().complex_eigenvalues().iter().any(|value| value.norm() > 1.0)
    }

    /// Returns the map (I - M)⁻¹ from the change over a period of `intervals` intervals to the Newton step; `None` if a
    /// direction does not decay.
    pub fn newton(&self, intervals: usize) -> Option<Map> {
        (Map::identity() - self.map().pow(intervals as u32)).try_inverse()
    }
}
