//! The balance of a steady attitude: the torques of both flagella turn a robot against its tether, and the difference of their
//! thrusts tilts it against its weight.
//!
//! The ratio of tilt to yaw hardly depends on the viscosity or the stiffness, but it depends on the senses of both motors.

use sim::body::closure::Closure;
use sim::functions::{ln, powi};
use sim::params::Robot;
use sim::resistance::resistance;
use std::f64::consts::PI;

/// Largest logarithm of the ratio of tilt to yaw, relative to that with rigid flagella; and how much smaller the ratio may be where
/// flagella bend ([`PerRpm::bend`]). Of robots of 0.6 to 1.67 times the stiffness of their file, of 0.8 to 1.25 times its viscosity, or
/// in a tank, it reaches 1 and, with soft flagella at 80 rpm, -1.66.
const UNLIKE: f64 = 1.25;
const BENDING: f64 = 0.5;

/// Steady yaw and tilt relative to those with rigid flagella: flagella bend. From the model of the built-in robots.
const BENT: [f64; 2] = [0.75, 1.5];

/// What the yaw and the tilt may be off, relative to those of the faster motor alone.
const OFF: [f64; 2] = [0.3, 0.4];

/// The steady attitude of a robot with rigid flagella per speed of each motor, degrees per rpm.
#[derive(Clone, Copy, Debug)]
pub struct PerRpm {
    /// Yaw; infinite without a tether.
    pub yaw_deg: [f64; 2],
    /// Tilt. The tilts of both motors have opposite signs.
    pub tilt_deg: [f64; 2],
    /// How far the thrust across a flagellum would bend it, relative to its length.
    pub bend: f64,
}

impl PerRpm {
    /// Returns the attitudes at which the tether balances the torques of rigid flagella ([`resistance`]), and the righting moment
    /// of the weight their thrusts on the levers of their shafts; `None` if the robot is invalid.
    pub fn of(robot: &Robot) -> Option<Self> {
        let (base, flagellum) = (&robot.base, &robot.flagellum);
        let matrix = resistance(robot, &[0.0; 2]).ok()?.matrix;
        let [thrust, torque] = [2, 5].map(|row| [6, 12].map(|part| matrix[(part + row, part + 5)]));
        let righting_nm = base.mass_kg * base.gravity_m_s2 * base.mass_centre_below_joint_m;
        let deg = |nms: f64, stiffness_nm: f64| (nms / stiffness_nm * PI / 30.0).to_degrees();
        let lever_m = 0.5 * base.motor_distance_m;
        let thrust_n = thrust[0].abs().max(thrust[1].abs()) * PI / 30.0;
        Some(Self {
            bend: thrust_n * powi(flagellum.axial_length_m, 2) / (3.0 * flagellum.stiffness().bend_nm2),
            yaw_deg: torque.map(|nms| deg(-nms, robot.joint.tether(Closure::Full))),
            tilt_deg: [thrust[0] * lever_m, -thrust[1] * lever_m].map(|nms| deg(nms, righting_nm)),
        })
    }
}

/// The steady attitude of a trial, and of its robot at any speeds.
#[derive(Clone, Copy, Debug)]
pub struct Balance {
    /// Yaw, degrees.
    pub yaw_deg: f64,
    /// Smallest and largest possible tilt, degrees.
    pub tilt_deg: [f64; 2],
    /// The attitude of the robot.
    pub per_rpm: PerRpm,
}

impl Balance {
    /// Returns whether the sign of the yaw or the ratio of tilt to yaw contradicts these speeds.
    pub fn contradicts(&self, rpm: [f64; 2]) -> bool {
        let PerRpm { yaw_deg, tilt_deg, bend } = self.per_rpm;
        let fastest_rpm = rpm[0].abs().max(rpm[1].abs());
        // The expected angle, and what it may be off.
        let expected = |k: usize, per_rpm: [f64; 2]| {
            let alone_deg = fastest_rpm * (per_rpm[0].abs() + per_rpm[1].abs()) / 2.0;
            (BENT[k] * (per_rpm[0] * rpm[0] + per_rpm[1] * rpm[1]), OFF[k] * BENT[k] * alone_deg)
        };
        let ((yaw, yaw_off), (tilt, tilt_off)) = (expected(0, yaw_deg), expected(1, tilt_deg));
        let is_reversed = self.yaw_deg * yaw < 0.0 && self.yaw_deg.abs().min(yaw.abs()) > yaw_off;
        let unlike = |own_deg: f64| {
            ln((own_deg + tilt_off) / (self.yaw_deg.abs() + yaw_off))
                - ln((tilt.abs() + tilt_off) / (yaw.abs() + yaw_off))
        };
        // Flagella that touch tilt the robot less.
        let touch = (0..2).all(|k| tilt_deg[k] * rpm[k] * [-1.0, 1.0][k] <= 0.0);
        is_reversed
            || unlike(self.tilt_deg[0]) > UNLIKE
            || !touch && unlike(self.tilt_deg[1]) < -UNLIKE - BENDING * bend * fastest_rpm
    }
}
