//! The samples of a trial, between the steps of its solver.

use super::sample::{Sample, shapes_at};
use super::{Trial, overlap};
use crate::V3;
use crate::contact::bundling::{Bundling, winding};
use crate::contact::pairs::Lines;
use crate::step::StepError;

/// A sample at most this much after the end, s, is still the last sample: times of samples are rounded.
const END_ROUNDING: f64 = 1e-9;

impl Trial {
    /// Returns how many times the axes of the helices of these shapes wind round each other.
    pub(super) fn winding(&self, lines: &Lines) -> f64 {
        let flagellum = &self.solver.model().robot.flagellum;
        let coil = (flagellum.edges() as f64 * flagellum.pitch_m / flagellum.axial_length_m).round() as usize;
        winding(lines, coil)
    }

    /// Returns the time of the next sample; `None` after the last one.
    fn next_sample(&self) -> Option<f64> {
        let (time, end) = (self.start + self.progress.next as f64 / self.options.rate_hz, self.profile.end());
        (!self.failed && time <= end + END_ROUNDING).then(|| time.min(end))
    }

    /// Returns the next sample if its time has passed, without a step of the solver.
    pub(crate) fn passed(&mut self) -> Option<Sample> {
        let time = self.next_sample().filter(|time| *time <= self.progress.state.time)?;
        self.progress.next += 1;
        self.sample(time)
    }

    fn sample(&mut self, time: f64) -> Option<Sample> {
        let between = self.progress.dense.at(time)?;
        let motors = self.profile.motors(time);
        let lines = shapes_at(&self.progress.state, time, &motors, &self.solver.model().robot.shaft_feet());
        let winding_turns = self.winding(&lines);
        let bundling = Bundling::classify(between.touching, winding_turns);
        let motor_angle_rad = self.without_phase(motors).map(|m| m.angle);
        let progress = &mut self.progress;
        let plain = |v: V3| [v.x, v.y, v.z];
        let q = between.attitude;
        let sample = Sample {
            time_s: time,
            attitude: [q.w, q.i, q.j, q.k],
            rate_rad_s: plain(between.rate),
            yaw_rad: between.euler[0],
            pitch_rad: between.euler[1],
            roll_rad: between.euler[2],
            motor_angle_rad,
            motor_speed_rad_s: motors.map(|m| m.speed),
            force_n: between.forces.map(|f| plain(f.smooth + f.contact)),
            contact_force_n: between.forces.map(|f| plain(f.contact)),
            axial_torque_nm: between.forces.map(|f| f.smooth_torque + f.contact_torque),
            min_gap_m: progress.gap,
            max_penetration_m: overlap(progress.gap),
            bundling,
            winding_turns,
            sweeps: progress.sweeps,
            shapes_m: self.options.shapes.then(|| lines.map(|line| line.into_iter().map(plain).collect())),
        };
        // Several samples may fall into one step: each includes that step's gap.
        progress.gap = progress.last_gap;
        progress.sweeps = 0;
        Some(sample)
    }
}

impl Iterator for Trial {
    type Item = Result<Sample, StepError>;

    fn next(&mut self) -> Option<Self::Item> {
        let time = self.next_sample()?;
        while self.progress.state.time < time {
            if let Err(error) = self.advance() {
                return Some(Err(error));
            }
        }
        self.progress.next += 1;
        self.sample(time).map(Ok)
    }
}
