//! The quantities of a steady state: the only list of their names, units and values.

use crate::body::attitude::tilt_deg;
use crate::trial::Summary;
use crate::trial::means::Level;

/// A quantity of a steady state.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    /// Its name, with the unit.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What it is.
    pub about: &'static str,
    /// How it is stated for several starting phases.
    pub over_phases: OverPhases,
    /// Its value.
    pub value: fn(&Summary) -> f64,
}

/// How a quantity is stated for several starting phases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OverPhases {
    /// By its mean.
    Mean,
    /// By its least value.
    Least,
}

use OverPhases::{Least, Mean};

/// All quantities. Angles are in degrees; those of the attitude come first.
pub const QUANTITIES: [Quantity; 14] = [
    quantity("yaw_deg", "deg", "steady yaw about the vertical, unwrapped", Mean, |s| angle_deg(s, 0)),
    quantity("pitch_deg", "deg", "steady pitch about the y axis after the yaw", Mean, |s| angle_deg(s, 1)),
    quantity("roll_deg", "deg", "steady roll about the x axis after yaw and pitch", Mean, |s| angle_deg(s, 2)),
    quantity(
        "tilt_deg",
        "deg",
        "angle of the robot's axis to the vertical, from the steady pitch and roll of each phase",
        Mean,
        |s| tilt_deg(angle_deg(s, 1), angle_deg(s, 2)),
    ),
    quantity("force1_x_n", "N", "lateral force of flagellum 1 on the base along x, body axes", Mean, |s| {
        s.steady.force[0][0].mean
    }),
    quantity("force1_y_n", "N", "lateral force of flagellum 1 along y", Mean, |s| s.steady.force[0][1].mean),
    quantity("force1_z_n", "N", "thrust of flagellum 1: its force on the base along z", Mean, |s| {
        s.steady.force[0][2].mean
    }),
    quantity("force2_x_n", "N", "lateral force of flagellum 2 along x", Mean, |s| s.steady.force[1][0].mean),
    quantity("force2_y_n", "N", "lateral force of flagellum 2 along y", Mean, |s| s.steady.force[1][1].mean),
    quantity("force2_z_n", "N", "thrust of flagellum 2", Mean, |s| s.steady.force[1][2].mean),
    quantity("axial_torque1_nm", "N m", "reaction torque of flagellum 1 on the base about its shaft", Mean, |s| {
        s.steady.axial_torque[0].mean
    }),
    quantity("axial_torque2_nm", "N m", "reaction torque of flagellum 2 on the base about its shaft", Mean, |s| {
        s.steady.axial_torque[1].mean
    }),
    quantity(
        "contact_share",
        "1",
        "share of the time in which the flagella touch: of the period, or of the time that was averaged last, or of a trial",
        Mean,
        |s| s.contact_share,
    ),
    quantity(
        "min_gap_m",
        "m",
        "least gap between the flagella's surfaces over all phases, negative if they overlap",
        Least,
        |s| s.min_gap_m,
    ),
];

/// A standard error of a steady state: its name, its unit, what it is of, and its value.
pub type StandardError = (&'static str, &'static str, &'static str, fn(&Summary) -> Option<f64>);

/// The standard errors that are stated beside [`QUANTITIES`].
pub const STANDARD_ERRORS: [StandardError; 5] = [
    ("yaw_se_deg", "deg", "standard error of the yaw; empty if unknown", |s| error_deg(&s.steady.attitude[0])),
    ("pitch_se_deg", "deg", "standard error of the pitch", |s| error_deg(&s.steady.attitude[1])),
    ("roll_se_deg", "deg", "standard error of the roll", |s| error_deg(&s.steady.attitude[2])),
    ("force1_z_se_n", "N", "standard error of the thrust of flagellum 1", |s| s.steady.force[0][2].standard_error),
    ("force2_z_se_n", "N", "standard error of the thrust of flagellum 2", |s| s.steady.force[1][2].standard_error),
];

const fn quantity(
    name: &'static str,
    unit: &'static str,
    about: &'static str,
    over_phases: OverPhases,
    value: fn(&Summary) -> f64,
) -> Quantity {
    Quantity { name, unit, about, over_phases, value }
}

fn angle_deg(summary: &Summary, axis: usize) -> f64 {
    summary.steady.attitude[axis].mean.to_degrees()
}

fn error_deg(level: &Level) -> Option<f64> {
    level.standard_error.map(f64::to_degrees)
}
