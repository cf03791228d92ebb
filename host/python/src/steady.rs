//! Columns of the steady states of many trials.

use biflag_log::SteadyMeta;
use study::attitude::tilt_deg;

/// A number of a steady state: its name, with the unit, and its value.
type Number = (&'static str, fn(&SteadyMeta) -> f64);

/// Names and values as `biflag simulate --json` has them, with the components of vectors as `biflag export` names them.
pub const NUMBERS: [Number; 19] = [
    ("yaw_deg", |s| s.yaw_deg),
    ("pitch_deg", |s| s.pitch_deg),
    ("roll_deg", |s| s.roll_deg),
    ("tilt_deg", |s| tilt_deg(s.pitch_deg, s.roll_deg)),
    ("settle_s", |s| s.settle_s),
    ("window_s", |s| s.window_s),
    ("force1_x_n", |s| s.force1_n[0]),
    ("force1_y_n", |s| s.force1_n[1]),
    ("force1_z_n", |s| s.force1_n[2]),
    ("force2_x_n", |s| s.force2_n[0]),
    ("force2_y_n", |s| s.force2_n[1]),
    ("force2_z_n", |s| s.force2_n[2]),
    ("thrust_n", |s| s.force1_n[2] + s.force2_n[2]),
    ("axial_torque1_nm", |s| s.axial_torque_nm[0]),
    ("axial_torque2_nm", |s| s.axial_torque_nm[1]),
    ("min_gap_m", |s| s.min_gap_m),
    ("max_penetration_m", |s| s.max_penetration_m),
    ("contact_share", |s| s.contact_share),
    ("simulated_s", |s| s.simulated_s),
];
