//! The robot at each time of its trial, in front of a camera.

use super::picture::{Picture, Seen};
use super::render::{Rgb, Solid, V3};
use crate::PageError;
use crate::report::shapes::at_rest;
use sim::body::shaft::Shaft;
use std::f64::consts::TAU;
use study::attitude::Columns;
use study::trial::{Data, Shape, Zeroed};

/// The robot over a trial.
pub(crate) struct Moving {
    pub(super) picture: Picture,
    /// Times, and both centre lines in the frames that turn with the shafts.
    shapes: Vec<(f64, [Vec<V3>; 2])>,
    turns: Columns<2>,
    angles_deg: Columns<3>,
}

impl Moving {
    /// `width`: that of the picture, pixels.
    pub(crate) fn new(data: &Data, zeroed: &Zeroed, width: u16) -> Result<Self, PageError> {
        let robot = data.robot()?;
        let feet = robot.shaft_feet();
        let rest = [Shape { time_s: 0.0, turns: [0.0; 2], lines: at_rest(&robot) }];
        let shapes = if data.shapes.is_empty() { &rest[..] } else { &data.shapes.all[..] };
        Ok(Self {
            shapes: shapes.iter().map(|shape| (shape.time_s, shape.in_shafts(&feet))).collect(),
            turns: data.turns(),
            angles_deg: zeroed.angles_deg.clone(),
            picture: Picture::new(robot, width),
        })
    }

    /// Returns yaw, pitch and roll at a time of the trial, degrees.
    pub(crate) fn angles_deg(&self, time_s: f64) -> [f64; 3] {
        self.angles_deg.at(time_s)
    }

    /// Returns the visible solids of the robot at a time of the trial, from the farthest to the nearest.
    pub(crate) fn seen(&self, time_s: f64) -> Vec<Seen> {
        self.picture.seen(&self.solids(time_s))
    }

    /// Draws the robot at a time of the trial.
    pub(super) fn draw(&self, time_s: f64) -> Vec<Rgb> {
        self.picture.draw(&self.solids(time_s))
    }

    fn solids(&self, time_s: f64) -> Vec<Solid> {
        self.picture.solids(self.angles_deg(time_s), self.lines(time_s))
    }

    /// Returns both centre lines, body axes, m: between two shapes of the log, in the frames of the shafts.
    fn lines(&self, time_s: f64) -> [Vec<[f64; 3]>; 2] {
        let after = self.shapes.partition_point(|(time, _)| *time <= time_s).min(self.shapes.len() - 1);
        let [(begin_s, one), (end_s, two)] = [&self.shapes[after.saturating_sub(1)], &self.shapes[after]];
        let length_s = end_s - begin_s;
        let share = if length_s > 0.0 { ((time_s - begin_s) / length_s).clamp(0.0, 1.0) } else { 1.0 };
        let turns = self.turns.at(time_s).map(|turns| if turns.is_finite() { turns } else { 0.0 });
        let feet = self.picture.robot.shaft_feet();
        [0, 1].map(|k| {
            let shaft = Shaft::new(feet[k], turns[k] * TAU);
            let between = |(one, two): (&V3, &V3)| shaft.point_to_body(one * (1.0 - share) + two * share).into();
            one[k].iter().zip(&two[k]).map(between).collect()
        })
    }
}
