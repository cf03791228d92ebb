//! The points of a sweep. Each follows from its index, and is named by a hash of everything that its result depends on,
//! so the same point of another plan has the same name.

use super::SweepPlan;
use super::key::{self, Group, Key};
use crate::plan::{PlanError, note_on_grid};
use crate::text::word;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use sim::groups::Groups;
use sim::params::Robot;
use sim::steady::phase::Ratio;
use std::fmt;
use toml::Value;

/// A point's name: the first half of the SHA-256 of its inputs and of the version of the results.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Name(pub [u8; 16]);

impl Name {
    /// Returns a number that is evenly distributed over the points and increases with their names.
    pub fn number(&self) -> u64 {
        let [a, b, c, d, e, f, g, h, ..] = self.0;
        u64::from_be_bytes([a, b, c, d, e, f, g, h])
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// The part of a sweep's points that one program computes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shard {
    /// Number of this part, from 0.
    pub index: u64,
    /// Number of parts.
    pub of: u64,
}

impl Shard {
    /// All points.
    pub const ALL: Self = Self { index: 0, of: 1 };

    /// Returns the index, among `of` parts, of the part to which a point belongs. Neighbours in a plan often take
    /// equally long; selecting by name distributes them over the shards.
    pub fn index_of(name: &Name, of: u64) -> u64 {
        name.number() % of
    }

    /// Returns whether a point belongs to this part.
    pub fn has(&self, name: &Name) -> bool {
        Self::index_of(name, self.of) == self.index
    }
}

/// A plan with its robot and the version of the results: everything that its points depend on.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// The plan.
    pub plan: SweepPlan,
    /// Version of the model's results.
    pub results: u32,
    /// The robot that varies, with all its keys.
    robot: Value,
    /// Hash of the inputs common to all points.
    common: Sha256,
}

/// One point.
#[derive(Clone, PartialEq, Debug)]
pub struct Point {
    /// Its index in the plan.
    pub index: u64,
    /// Its name.
    pub name: Name,
    /// Speeds of motors 1 and 2, rpm.
    pub speeds_rpm: [f64; 2],
    /// Value of each axis of the plan; the robot's value for a key that is not changed.
    pub values: Vec<f64>,
    /// The groups relative to those of the robot `published`, in the order of [`Group::ALL`].
    pub multiples: [f64; 4],
    /// The robot, which may be invalid, or the reason why its keys do not accept the values.
    pub robot: Result<Robot, String>,
}

/// Returns the number of starting phases at these speeds: one if the phase does not matter.
pub fn phases(plan: &SweepPlan, speeds_rpm: [f64; 2]) -> usize {
    if Ratio::of(speeds_rpm).is_some() { plan.phases } else { 1 }
}

impl Sweep {
    /// Creates the sweep of a plan with the results of this version.
    ///
    /// # Errors
    /// [`PlanError::Invalid`] if the robot's file is wrong.
    pub fn new(plan: SweepPlan, results: u32) -> Result<Self, PlanError> {
        // Numbers, flags, names and short lists all have a form in TOML.
        let robot = Value::try_from(plan.robot.parse()?).unwrap_or(Value::Table(toml::Table::new()));
        let mut common = Sha256::new();
        for text in ["biflag sweep 2", &results.to_string(), &robot.to_string(), &word(&plan.method)] {
            common.update((text.len() as u64).to_le_bytes());
            common.update(text);
        }
        common.update(plan.run_s.to_le_bytes());
        Ok(Self { plan, results, robot, common })
    }

    /// Returns the name of a point, without the cost of building its robot.
    pub fn name(&self, index: u64) -> Name {
        let (speeds_rpm, values) = self.inputs(index);
        let mut hash = self.common.clone();
        hash.update((phases(&self.plan, speeds_rpm) as u64).to_le_bytes());
        speeds_rpm.iter().for_each(|rpm| hash.update(rpm.to_le_bytes()));
        for (axis, value) in self.plan.axes.iter().zip(values) {
            let is_own =
                |value: f64| matches!(&axis.key, Key::Robot(key) if key::number(&self.robot, key) == Some(value));
            if let (Key::Robot(_) | Key::Group(_), Some(value)) = (&axis.key, value)
                && !is_own(value)
            {
                hash.update(axis.key.name());
                hash.update([0]);
                hash.update(value.to_le_bytes());
            }
        }
        let hash = hash.finalize();
        Name(std::array::from_fn(|i| hash[i]))
    }

    /// Returns the unknown points of a shard, with their names.
    pub fn points_of(&self, shard: Shard, known: &Points) -> impl ParallelIterator<Item = (u64, Name)> {
        let points = (0..self.plan.points()).into_par_iter().filter(|index| !known.has(*index));
        points.map(|index| (index, self.name(index))).filter(move |(_, name)| shard.has(name))
    }

    /// Returns a point. Keys of the robot's file are set first, then the groups.
    pub fn point(&self, index: u64) -> Point {
        let (speeds_rpm, inputs) = self.inputs(index);
        let axes = || self.plan.axes.iter().zip(&inputs);
        let mut keys = self.robot.clone();
        for (axis, value) in axes() {
            if let (Key::Robot(key), Some(value)) = (&axis.key, value) {
                key::set(&mut keys, key, *value);
            }
        }
        let robot: Result<Robot, toml::de::Error> = keys.clone().try_into();
        let mut robot = robot.map_err(|error| error.message().to_owned());
        let mut multiples = [f64::NAN; 4];
        if let Ok(robot) = &mut robot {
            let (mut groups, published) = (Groups::of(robot), Groups::of(&Robot::published()));
            multiples = Group::ALL.map(|group| group.of(&groups) / group.of(&published));
            let set: Vec<_> = axes().filter_map(|(axis, value)| Some((axis.key.group()?, (*value)?))).collect();
            for (group, multiple) in &set {
                group.set(&mut groups, *multiple);
                multiples[*group as usize] = *multiple;
            }
            if !set.is_empty() {
                *robot = groups.robot(robot, 1.0, 1.0);
            }
        }
        let value = |axis: &Key| match axis {
            Key::Robot(key) => key::number(&keys, key).unwrap_or(f64::NAN),
            Key::Group(group) => multiples[*group as usize],
            Key::Speed(motor) => speeds_rpm[*motor],
        };
        let values = self.plan.axes.iter().map(|axis| value(&axis.key)).collect();
        Point { index, name: self.name(index), speeds_rpm, values, multiples, robot }
    }

    /// Returns notes on the plan for the user.
    pub fn notes(&self) -> Vec<String> {
        self.note_on_phases().into_iter().chain(note_on_grid(&self.plan.text)).collect()
    }

    /// Returns a note for the user if points have one starting phase, and other phases may give other values.
    fn note_on_phases(&self) -> Option<String> {
        if self.plan.phases != 1 {
            return None;
        }
        let pairs = &self.plan.speeds_rpm;
        let (all, what) =
            if pairs.is_empty() { (self.plan.points(), "points") } else { (pairs.len() as u64, "pairs of speeds") };
        let some = (0..all).filter(|index| Ratio::of(self.inputs(*index).0).is_some()).count();
        let cure = "`phases = 8` in [trial] gives means and spreads";
        (some > 0).then(|| format!("{some} of {all} {what} hold for the one starting phase that was tried; {cure}"))
    }

    /// Returns the speeds of a point (rpm), and its value for each axis, if it sets one.
    fn inputs(&self, index: u64) -> ([f64; 2], Vec<Option<f64>>) {
        let plan = &self.plan;
        let pairs = plan.speeds_rpm.len().max(1) as u64;
        let values = plan.design.values(&plan.axes, index / pairs);
        if let Some(pair) = plan.speeds_rpm.get((index % pairs) as usize) {
            return (*pair, values);
        }
        let speed = |motor| {
            let at = plan.axes.iter().position(|axis| axis.key == Key::Speed(motor));
            at.and_then(|at| values[at]).unwrap_or(0.0)
        };
        ([speed(0), speed(1)], values)
    }
}

/// Points of a plan, one bit each.
#[derive(Clone, PartialEq, Debug)]
pub struct Points {
    bits: Vec<u64>,
    count: u64,
}

impl Points {
    /// Returns the empty set for a plan with this many points.
    pub fn none(of: u64) -> Self {
        Self { bits: vec![0; of.div_ceil(64) as usize], count: 0 }
    }

    /// Returns whether the set contains a point.
    pub fn has(&self, index: u64) -> bool {
        self.bits.get((index / 64) as usize).is_some_and(|word| word >> (index % 64) & 1 == 1)
    }

    /// Adds a point of the plan; returns whether it is new.
    pub fn add(&mut self, index: u64) -> bool {
        let is_new = !self.has(index);
        self.bits[(index / 64) as usize] |= 1 << (index % 64);
        self.count += u64::from(is_new);
        is_new
    }

    /// Returns the number of points in the set.
    pub fn count(&self) -> u64 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_counted_once() {
        let mut points = Points::none(130);
        assert!(points.add(0) && points.add(129) && !points.add(129));
        assert_eq!((points.count(), points.has(129), points.has(128), points.has(4000)), (2, true, false, false));
    }
}
