//! The list: a row for each quantity.

use super::{OverPhases, Place, Quantity, Shape};
use crate::body::attitude::tilt_deg;
use crate::trial::Summary;
use crate::trial::means::Level;
use OverPhases::{Largest, Least, Mean, Sum};
use Place::{Sweep, Trials};

/// Default row: a pure number of the robot, in every table. A row states only its differences.
const NUMBER: Quantity = Quantity {
    stem: "",
    unit: "1",
    about: "",
    shape: Shape::Number,
    over_phases: Mean,
    not_in: &[],
    level: None,
    sample: None,
};

/// Yaw.
pub const YAW: Quantity =
    angle("yaw", "steady yaw about the vertical, unwrapped", |s, _| degrees(s.steady.attitude[0]));

/// Pitch.
pub const PITCH: Quantity =
    angle("pitch", "steady pitch about the y axis after the yaw", |s, _| degrees(s.steady.attitude[1]));

/// Roll.
pub const ROLL: Quantity =
    angle("roll", "steady roll about the x axis after yaw and pitch", |s, _| degrees(s.steady.attitude[2]));

/// Tilt.
pub const TILT: Quantity = Quantity {
    stem: "tilt",
    unit: "deg",
    about: "angle of the robot's axis to the vertical, from the steady pitch and roll of each phase",
    not_in: &[Trials],
    level: Some(|s, _| exact(tilt_deg(degrees(s.steady.attitude[1]).mean, degrees(s.steady.attitude[2]).mean))),
    ..NUMBER
};

/// Settling time.
pub const SETTLE: Quantity = Quantity {
    stem: "settle",
    unit: "s",
    about: "time from the start of the run after which yaw and pitch stay near their means; 0 if the steady state was solved for",
    over_phases: Largest,
    not_in: &[Sweep, Trials],
    level: Some(|s, _| exact(s.steady.settle_s)),
    ..NUMBER
};

/// Length of the averaging window.
pub const WINDOW: Quantity = Quantity {
    stem: "window",
    unit: "s",
    about: "length of the end of the run from which the means are taken",
    not_in: &[Sweep, Trials],
    level: Some(|s, _| exact(s.steady.window_s)),
    ..NUMBER
};

/// Force of each flagellum on the base.
pub const FORCE: Quantity = Quantity {
    stem: "force",
    unit: "N",
    about: "force of flagellum # on the base@, body axes, contact included",
    shape: Shape::VectorOfEach,
    not_in: &[Trials],
    level: Some(|s, part| s.steady.force[part / 3][part % 3]),
    sample: Some(|s, part| s.force_n[part / 3][part % 3]),
    ..NUMBER
};

/// The part of the force of each flagellum that is due to contact.
pub const CONTACT: Quantity = Quantity {
    stem: "contact",
    unit: "N",
    about: "part of the force of flagellum #@ due to contact",
    shape: Shape::VectorOfEach,
    sample: Some(|s, part| s.contact_force_n[part / 3][part % 3]),
    ..NUMBER
};

/// Thrust of all flagella.
pub const THRUST: Quantity = Quantity {
    stem: "thrust",
    unit: "N",
    about: "thrust of all flagella: their force on the base along z_B",
    not_in: &[Sweep, Trials],
    level: Some(|s, _| exact(s.steady.force.iter().map(|force| force[2].mean).sum())),
    ..NUMBER
};

/// Reaction torque of each flagellum.
pub const AXIAL_TORQUE: Quantity = Quantity {
    stem: "axial_torque",
    unit: "N m",
    about: "reaction torque of flagellum # on the base about its shaft",
    shape: Shape::OfEach,
    not_in: &[Trials],
    level: Some(|s, part| s.steady.axial_torque[part]),
    sample: Some(|s, part| s.axial_torque_nm[part]),
    ..NUMBER
};

/// Share of contact.
pub const CONTACT_SHARE: Quantity = Quantity {
    stem: "contact_share",
    about: "share of the time in which the flagella touch: of the period, or of the time that was averaged last, or of a trial",
    not_in: &[Trials],
    level: Some(|s, _| exact(s.contact_share)),
    ..NUMBER
};

/// Least gap.
pub const MIN_GAP: Quantity = Quantity {
    stem: "min_gap",
    unit: "m",
    about: "least gap between the flagella's surfaces, negative if they overlap: of the run, of the period, or since the sample before",
    over_phases: Least,
    not_in: &[Trials],
    level: Some(|s, _| exact(s.min_gap_m)),
    sample: Some(|s, _| s.min_gap_m),
    ..NUMBER
};

/// Power.
pub const POWER: Quantity = Quantity {
    stem: "power",
    unit: "W",
    about: "power at the shafts into the liquid, from the mean torques and the target speeds",
    level: Some(|s, _| {
        let power = s.steady.axial_torque.iter().zip(s.steady.speeds_rad_s).map(|(torque, speed)| torque.mean * -speed);
        exact(power.sum())
    }),
    ..NUMBER
};

/// Simulated time.
pub const SIMULATED: Quantity = Quantity {
    stem: "simulated",
    unit: "s",
    about: "simulated time, the search for the steady state included",
    over_phases: Sum,
    not_in: &[Sweep, Trials],
    level: Some(|s, _| exact(s.simulated_s)),
    ..NUMBER
};

/// Largest overlap.
pub const MAX_PENETRATION: Quantity = Quantity {
    stem: "max_penetration",
    unit: "m",
    about: "largest overlap of the flagella's surfaces: of the run, of the period, or since the sample before",
    over_phases: Largest,
    not_in: &[Sweep, Trials],
    level: Some(|s, _| exact(s.max_penetration_m)),
    sample: Some(|s, _| s.max_penetration_m),
    ..NUMBER
};

/// Winding of the flagella.
pub const WINDING: Quantity = Quantity {
    stem: "winding_turns",
    about: "number of turns by which the flagella are wound around each other",
    sample: Some(|s, _| s.winding_turns),
    ..NUMBER
};

/// All quantities, in the order of columns.
pub const QUANTITIES: &[Quantity] = &[
    YAW,
    PITCH,
    ROLL,
    TILT,
    SETTLE,
    WINDOW,
    FORCE,
    CONTACT,
    THRUST,
    AXIAL_TORQUE,
    CONTACT_SHARE,
    MIN_GAP,
    POWER,
    MAX_PENETRATION,
    WINDING,
    SIMULATED,
    Quantity {
        stem: "sweeps",
        about: "sweeps of the solver",
        shape: Shape::Count,
        over_phases: Sum,
        not_in: &[Sweep, Trials],
        level: Some(|s, _| exact(s.sweeps as f64)),
        ..NUMBER
    },
];

const fn angle(stem: &'static str, about: &'static str, level: fn(&Summary, usize) -> Level) -> Quantity {
    Quantity { stem, unit: "deg", about, shape: Shape::Mean, not_in: &[Trials], level: Some(level), ..NUMBER }
}

fn degrees(level: Level) -> Level {
    let [mean, amplitude] = [level.mean, level.amplitude].map(f64::to_degrees);
    Level { mean, amplitude, standard_error: level.standard_error.map(f64::to_degrees) }
}

fn exact(mean: f64) -> Level {
    Level { mean, ..Level::default() }
}
