//! Integrals over a trial by which errors of the gyroscope become errors of the yaw.
//!
//! An error of the rate δω (body axes) turns the estimated attitude by ∫ R δω dt. Gravity corrects the horizontal part; the
//! vertical part u · δω, where u is up in body axes, remains in the yaw. With an error δω_i = m ω_j of axis i the yaw's is m
//! ∫ u_i dθ_j, and with δω_i = g (u_j - z_j), the change of a sensitivity to gravity since rest, g ∫ u_i (u_j - z_j) dt.
//! The coning of a wobbling robot is in these integrals: they need not be those of its yaw.

use super::Columns;
use nalgebra::{UnitQuaternion, Vector3};

/// Columns: ∫ u_i dθ_j in rows (degrees), ∫ u_i (u_j - z_j) dt in rows (s), θ_j (degrees).
pub const ROTATIONS: usize = 21;

/// Shortest interval between rows, s. A robot turns once in 0.7 s or more.
const INTERVAL_S: f64 = 0.05;

/// Accumulates the integrals.
#[derive(Clone, Debug, Default)]
pub(super) struct Rotations {
    pub columns: Columns<ROTATIONS>,
    sums: [f64; ROTATIONS],
    last: Option<(f64, UnitQuaternion<f64>)>,
}

impl Rotations {
    /// Adds an attitude of the body at a time.
    pub fn push(&mut self, time_s: f64, attitude: UnitQuaternion<f64>) {
        if let Some((before_s, before)) = self.last {
            let turned = (before.inverse() * attitude).scaled_axis();
            let passed = time_s - before_s;
            let up = 0.5 * (before.inverse() * Vector3::z() + attitude.inverse() * Vector3::z());
            for i in 0..3 {
                for j in 0..3 {
                    self.sums[3 * i + j] += up[i] * turned[j].to_degrees();
                    self.sums[9 + 3 * i + j] += up[i] * (up[j] - f64::from(j == 2)) * passed;
                }
                self.sums[18 + i] += turned[i].to_degrees();
            }
        }
        self.last = Some((time_s, attitude));
        if self.columns.time_s.last().is_none_or(|last| time_s - last >= INTERVAL_S) {
            self.columns.push(time_s, self.sums);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body that leans by 20° and turns about the vertical, while its lean goes round (coning).
    #[test]
    fn scale_error_of_a_coning_body_is_that_of_its_rate() {
        let mut rotations = Rotations::default();
        let (lean, cone, yaw) = (20_f64.to_radians(), 6.0, 0.1);
        let attitude = |t: f64| {
            let axis = Vector3::new((cone * t).cos(), (cone * t).sin(), 0.0);
            UnitQuaternion::from_scaled_axis(Vector3::z() * yaw * t) * UnitQuaternion::from_scaled_axis(axis * lean)
        };
        // A gyroscope that reads 2 % too much about z, integrated.
        let mut wrong = 0.0;
        let steps = 20_000;
        for i in 0..=steps {
            let t = f64::from(i) * 1e-3;
            rotations.push(t, attitude(t));
            let rate = (attitude(t).inverse() * attitude(t + 1e-3)).scaled_axis() / 1e-3;
            wrong += 0.02 * (attitude(t).inverse() * Vector3::z()).z * rate.z * 1e-3;
        }
        let sums = rotations.columns.at(20.0);
        let yaw_deg = (yaw * 20.0).to_degrees();
        assert!((0.02 * sums[8] / wrong.to_degrees() - 1.0).abs() < 1e-3, "{} {}", 0.02 * sums[8], wrong.to_degrees());
        assert!((sums[8] / yaw_deg - 1.0).abs() > 1.0, "coning is not yaw: {} {yaw_deg}", sums[8]);
        // The three axes together turn about the vertical by the yaw and the solid angle of the cone.
        let coning_deg = (cone * 20.0 * (1.0 - lean.cos())).to_degrees();
        assert!((sums[0] + sums[4] + sums[8] - yaw_deg - coning_deg).abs() < 1.0, "{sums:?}");
        assert!((sums[9 + 8] - 20.0 * lean.cos() * (lean.cos() - 1.0)).abs() < 1e-3);
    }
}
