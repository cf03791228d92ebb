//! Six poses, with each body axis up and down: they give the accelerometer's scale, offset and cross-axis terms, and
//! the gyroscope's sensitivity to gravity.
//!
//! Let f_i(±j) be the mean force along axis i in the pose with ±j up. The scale of axis i is half the difference of f_i(+i) and
//! f_i(-i), and its offset is half their sum. The effect of j on the reading of i is a_ij, half the difference of f_i(+j) and
//! f_i(-j). The operator places the sensor by its edges, not exactly: a rotation of the sensor in the body appears in a_ij and
//! a_ji with opposite signs, and so do asymmetric cross-axis terms. The two cannot be distinguished, and need not be: the
//! mounting is defined as the rotation that makes the cross-axis terms symmetric. The mean of a_ij and a_ji is the cross-axis
//! term of both, and half their difference is the mounting. Turns measure the gyroscope's axes relative to these.
//!
//! The mean rates in the six poses fit w_i = b_i + Σ g_ij n_j + d_i (T - T0), where n is the direction of up and T the
//! temperature: 18 values, 15 unknowns. A freshly powered sensor warms up during the minutes of its poses, and b_i
//! absorbs a lag of its thermometer. The residuals are the scatter of the bias from pose to pose. If the temperature
//! hardly changes, d_i would fit noise, and is left out.

use super::file::{AXES, MeasuredSensor, pair};
use super::least_squares::{Fit, expanded};
use super::reading::{Mean, RawReading, Rests};
use super::{Estimate, NotMeasured};
use crate::statistics::extremes;
use sim::functions::hypot;

/// Smallest cosine between an axis and the vertical in its pose: 18°.
const UPRIGHT: f64 = 0.95;

/// Longest time without a new pose, s.
const PATIENCE_S: f64 = 120.0;

/// Smallest temperature range of the poses for which the change with temperature is fitted, °C. The mean over a pose of
/// 8 s has a noise of 0.002 °C, and the neglected change of a usual gyroscope is 0.0015 °/s.
const LEAST_WARMING_C: f64 = 0.05;

/// The operator's next action, with the figures so far.
#[derive(Clone, PartialEq, Debug)]
#[expect(missing_docs, reason = "the variants say what their fields are")]
pub enum PoseStep {
    /// Keep this pose for the remaining time.
    Hold { up: String, left_s: f64 },
    /// Lay the sensor so that one of these points up.
    Move { missing: Vec<String> },
    /// The sensor is still, but in none of the six poses.
    Askew { missing: Vec<String> },
    /// All poses are done.
    Done,
}

/// Follows the poses as the readings come in.
#[derive(Clone, Debug)]
pub struct PosesWatch {
    seconds: f64,
    rests: Rests,
    /// The mean of each pose: +x, -x, +y, -y, +z, -z.
    poses: [Option<Mean>; 6],
    /// When the last pose was completed, s.
    since_s: Option<f64>,
}

fn name(pose: usize) -> String {
    format!("{}{}", if pose.is_multiple_of(2) { "+" } else { "-" }, AXES[pose / 2])
}

impl PosesWatch {
    /// Returns a watch for poses of `seconds` each.
    pub fn new(seconds: f64) -> Self {
        Self { seconds, rests: Rests::default(), poses: [None; 6], since_s: None }
    }

    /// Adds a reading. Returns the operator's next action.
    ///
    /// # Errors
    /// [`NotMeasured`] if no further pose comes.
    pub fn push(&mut self, reading: &RawReading) -> Result<PoseStep, NotMeasured> {
        let since_s = *self.since_s.get_or_insert(reading.time_s);
        self.rests.push(reading);
        let missing = self.missing();
        if missing.is_empty() {
            return Ok(PoseStep::Done);
        }
        if reading.time_s - since_s > PATIENCE_S + self.seconds {
            return Err(self.incomplete());
        }
        let rest = self.rests.rest;
        if !self.rests.is_resting() || rest.count == 0.0 {
            return Ok(PoseStep::Move { missing });
        }
        let Some(pose) = pose_of(&rest) else { return Ok(PoseStep::Askew { missing }) };
        let left_s = self.seconds - rest.length_s();
        if self.poses[pose].is_some() {
            return Ok(PoseStep::Move { missing });
        }
        if left_s > 0.0 {
            return Ok(PoseStep::Hold { up: name(pose), left_s });
        }
        self.poses[pose] = Some(rest);
        self.since_s = Some(reading.time_s);
        let missing = self.missing();
        Ok(if missing.is_empty() { PoseStep::Done } else { PoseStep::Move { missing } })
    }

    /// Returns the poses that are missing.
    pub fn missing(&self) -> Vec<String> {
        (0..6).filter(|pose| self.poses[*pose].is_none()).map(name).collect()
    }

    fn incomplete(&self) -> NotMeasured {
        let missing = self.missing();
        let poses_are = if missing.len() == 1 { "a pose is" } else { "poses are" };
        let cure = format!(
            "start again, and lay the sensor still with each axis up and down; no pose came for {PATIENCE_S:.0} s"
        );
        NotMeasured::new(format!("{poses_are} missing: {}", missing.join(", ")), cure)
    }

    /// Returns the result. `placement_deg`: bound on the placement error of each pose.
    ///
    /// # Errors
    /// [`NotMeasured`] if poses are missing.
    pub fn result(&self, placement_deg: f64) -> Result<PosesResult, NotMeasured> {
        let poses: Vec<Mean> = self.poses.iter().flatten().copied().collect();
        let all = poses.as_array();
        all.and_then(|poses| evaluate(poses, placement_deg)).ok_or_else(|| self.incomplete())
    }
}

/// Returns the pose of a rest.
fn pose_of(rest: &Mean) -> Option<usize> {
    let length = rest.force_g.iter().map(|part| part * part).sum::<f64>().sqrt();
    let axis = (0..3).find(|i| rest.force_g[*i].abs() > UPRIGHT * length)?;
    Some(2 * axis + usize::from(rest.force_g[axis] < 0.0))
}

/// Result of six poses.
#[derive(Clone, PartialEq, Debug)]
pub struct PosesResult {
    /// Relative scale error of the accelerometer in units of the local gravity, which is all that attitudes need.
    pub accel_scale: [Estimate; 3],
    /// Its offset, standard gravity.
    pub accel_offset_g: [Estimate; 3],
    /// `[i][j]`: share of the force along j in the reading of i. Zero for i = j.
    pub accel_cross: [[Estimate; 3]; 3],
    /// Rotation of the sensor in the body about its axes, degrees.
    pub mounting_deg: [Estimate; 3],
    /// `[i][j]`: change of the rate read about i per standard gravity along j, °/s.
    pub gyro_g_dps: [[Estimate; 3]; 3],
    /// Scatter of the bias from pose to pose, beside its change with temperature, °/s.
    pub drift_dps: f64,
}

fn evaluate(poses: &[Mean; 6], placement_deg: f64) -> Option<PosesResult> {
    let force = |i: usize, pose: usize| poses[pose].force_g[i];
    let half_difference = |i: usize, j: usize| 0.5 * (force(i, 2 * j) - force(i, 2 * j + 1));
    let placement = Estimate::within(placement_deg.to_radians()).u;
    // Two placements are averaged in each half difference.
    let tilt_u = placement / 2f64.sqrt();
    // An axis that leans by θ reads the cosine, 1 - θ²/2. θ² is the sum of the mean squares about two axes.
    let cosine = placement * placement;
    // The readings of the other axes in its poses: its lean due to the mounting, plus their cross-axis terms.
    let lean = |i: usize| (0..3).filter(|j| *j != i).map(|j| half_difference(j, i)).fold(0.0, hypot);
    let accel_scale = std::array::from_fn(|i| {
        let value = half_difference(i, i) / (1.0 - cosine) - 1.0;
        Estimate { value, u: hypot(cosine, lean(i) * lean(i)) }
    });
    // Each of the two forces has the cosine of its own placement, in addition to a common lean; noise is far smaller.
    let accel_offset_g: [Estimate; 3] = std::array::from_fn(|i| {
        let value = 0.5 * (force(i, 2 * i) + force(i, 2 * i + 1));
        Estimate { value, u: hypot(hypot(cosine, lean(i) * tilt_u), 1e-4) }
    });
    let mut accel_cross = [[Estimate::default(); 3]; 3];
    let mut mounting_deg = [Estimate::default(); 3];
    for (k, mounting) in mounting_deg.iter_mut().enumerate() {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let [a, b] = [half_difference(i, j), half_difference(j, i)];
        let u = tilt_u / 2f64.sqrt();
        let cross = Estimate { value: 0.5 * (a + b), u };
        (accel_cross[i][j], accel_cross[j][i]) = (cross, cross);
        // In a sensor rotated by r about k, axis i reads r of j, and axis j reads -r of i.
        *mounting = Estimate { value: (0.5 * (a - b)).to_degrees(), u: u.to_degrees() };
    }
    let fits = fits(poses, &accel_offset_g)?;
    // The biases of the axes change alike, so their residuals are taken together.
    let freedom = fits.iter().map(|fit| fit.freedom).sum::<usize>();
    let drift_dps = (fits.iter().map(|fit| fit.squares).sum::<f64>() / freedom as f64).sqrt();
    // The direction of gravity is as uncertain as the accelerometer's axes.
    let direction_u = hypot(accel_cross[0][1].u, tilt_u);
    let sensitivity = |i: usize| fits[i].values[1..4].iter().copied().fold(0.0, hypot);
    let gyro_g_dps = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let noise = 0.5 * hypot(poses[2 * j].rate_u_dps()[i], poses[2 * j + 1].rate_u_dps()[i]);
            let scatter = expanded(drift_dps * fits[i].factors[j + 1], freedom).max(noise);
            Estimate { value: fits[i].values[j + 1], u: hypot(scatter, direction_u * sensitivity(i)) }
        })
    });
    Some(PosesResult { accel_scale, accel_offset_g, accel_cross, mounting_deg, gyro_g_dps, drift_dps })
}

/// Fits the mean rate of each axis. The coefficients are the bias, the sensitivity to gravity along x, y and z, and, if
/// the poses determine it, the change with temperature.
fn fits(poses: &[Mean; 6], accel_offset_g: &[Estimate; 3]) -> Option<[Fit; 3]> {
    let [coldest, warmest] = extremes(poses.map(|pose| pose.temperature_c));
    let rows = poses.map(|pose| {
        let force: [f64; 3] = std::array::from_fn(|i| pose.force_g[i] - accel_offset_g[i].value);
        let length = force.iter().map(|part| part * part).sum::<f64>().sqrt();
        let [x, y, z] = force.map(|part| part / length);
        [1.0, x, y, z, pose.temperature_c - coldest]
    });
    let steady = rows.map(|[one, x, y, z, _]| [one, x, y, z]);
    let each = |i: usize| {
        let rates = poses.map(|pose| pose.rate_dps[i]);
        let warming = if warmest - coldest < LEAST_WARMING_C { None } else { Fit::new(&rows, &rates) };
        warming.or_else(|| Fit::new(&steady, &rates))
    };
    Some([each(0)?, each(1)?, each(2)?])
}

impl PosesResult {
    /// Enters the result into the file of the sensor.
    pub fn enter(&self, file: &mut MeasuredSensor) {
        for (i, axis) in AXES.iter().enumerate() {
            file.set("accel_scale", axis, self.accel_scale[i]);
            file.set("accel_offset_g", axis, self.accel_offset_g[i]);
            file.set("mounting_deg", axis, self.mounting_deg[i]);
            for j in 0..3 {
                file.set("gyro_g_dps", &pair(i, j), self.gyro_g_dps[i][j]);
                if i != j {
                    file.set("accel_cross", &pair(i, j), self.accel_cross[i][j]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
