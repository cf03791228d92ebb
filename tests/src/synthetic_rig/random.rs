//! Random numbers, the same in every run.

use nalgebra::Vector3;

/// A generator of random numbers: SplitMix64.
#[derive(Debug)]
pub struct Random(pub u64);

impl Random {
    /// Returns a number between 0 and 1.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a normal deviate of variance 1.
    pub fn normal(&mut self) -> f64 {
        let (radius, angle) = ((-2.0 * (1.0 - self.uniform()).ln()).sqrt(), std::f64::consts::TAU * self.uniform());
        radius * angle.cos()
    }

    /// Returns three normal deviates of a standard deviation.
    pub fn normals(&mut self, deviation: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| deviation * self.normal())
    }

    /// Returns a number within ±`limit`.
    pub fn within(&mut self, limit: f64) -> f64 {
        limit * (2.0 * self.uniform() - 1.0)
    }

    /// Returns `limit` or `-limit`.
    pub fn at(&mut self, limit: f64) -> f64 {
        if self.uniform() < 0.5 { limit } else { -limit }
    }
}
