//! The devices wired to the Nano: bridge, motors, their supply, and encoders if there are any. The settings of the board may
//! differ.

use crate::bridge::Model;
use crate::drift::Supply;
use crate::motor::{MotorParameters, NOMINAL_V};
use std::str::FromStr;

/// A rig.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RigKind {
    /// Its name.
    pub name: &'static str,
    /// The bridge.
    pub bridge: Model,
    /// Whether the motors have encoders.
    pub has_encoders: bool,
    /// Motors 1 and 2.
    pub motors: [MotorParameters; 2],
    /// Standard deviations by which their speeds wander, as fractions.
    pub wander: [f64; 2],
    /// Their supply.
    pub supply: Supply,
}

const STEADY: [f64; 2] = [0.0; 2];
const WANDERING: [f64; 2] = [0.01, 0.03];
const MAINS: Supply = Supply::new([NOMINAL_V; 2]);
/// Four cells, full and at their end.
const BATTERY: Supply = Supply::new([6.5, 5.5]);

/// Own choice: motors of a faster gear, because an L298N leaves them little of a battery.
const FAST: [MotorParameters; 2] = [motor(184.0, 0.09, false), motor(170.0, 0.12, true)];
/// Own choice: motors that differ like two of the same make.
const UNEQUAL: [MotorParameters; 2] = [motor(134.0, 0.08, false), motor(124.0, 0.10, true)];
const PUBLISHED: [MotorParameters; 2] = [MotorParameters::PUBLISHED; 2];

/// All rigs; the first is the default.
pub const RIGS: [RigKind; 4] = [
    rig("encoders", Model::Tb6612, true, PUBLISHED, STEADY, MAINS),
    rig("duty", Model::L298n, false, FAST, WANDERING, BATTERY),
    rig("in-in", Model::Drv8833, true, PUBLISHED, STEADY, MAINS),
    rig("duty-in-in", Model::Drv8833, false, UNEQUAL, WANDERING, BATTERY),
];

const fn rig(
    name: &'static str,
    bridge: Model,
    has_encoders: bool,
    motors: [MotorParameters; 2],
    wander: [f64; 2],
    supply: Supply,
) -> RigKind {
    RigKind { name, bridge, has_encoders, motors, wander, supply }
}

const fn motor(no_load_rpm: f64, friction: f64, reversed: bool) -> MotorParameters {
    MotorParameters { no_load_rpm, dead_zone: friction, breakaway: friction, reversed, ..MotorParameters::PUBLISHED }
}

impl Default for RigKind {
    fn default() -> Self {
        RIGS[0]
    }
}

impl FromStr for RigKind {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let names = || RIGS.map(|rig| rig.name).join(", ");
        RIGS.into_iter().find(|rig| rig.name == name).ok_or_else(|| format!("the rigs are {}", names()))
    }
}
