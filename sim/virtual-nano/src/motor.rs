//! A geared brushed motor with its encoder, seen from the flagellum: first order from voltage to speed.
//!
//! speed' = (speed at rest of this voltage - speed) / time constant
//!
//! The encoder gives two square waves a quarter period apart. Edges fall where the angle crosses a multiple of a count,
//! interpolated between steps of at most [`STEP_S`].

use crate::bridge::Drive;
use std::f64::consts::{PI, TAU};

/// Encoder counts per turn of the flagellum: 12 edges of both channels per motor turn, gear of 100.37 (the published
/// robot).
pub const COUNTS_PER_TURN: f64 = 12.0 * 100.37;

/// Longest step of the model, s. The speed is taken as constant within it: 1/160 of the time constant.
pub const STEP_S: f64 = 0.5e-3;

/// Half a count away from an edge, so that nothing but motion makes one.
const START_COUNTS: f64 = 0.5;

/// An edge is placed to the cycle, and always past its multiple of a count.
const ONE_CYCLE_S: f64 = 1.0 / crate::mcu::FREQUENCY_HZ as f64;

/// Parameters of a motor.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct MotorParameters {
    /// Speed at full voltage, rpm. Assumed: the published robot runs at 90 rpm with a margin for control.
    pub no_load_rpm: f64,
    /// Time constant while the bridge drives or brakes, s. Assumed: usual for gear motors of this size.
    pub time_constant_s: f64,
    /// Time constant while it coasts, s, when only friction stops it. Assumed.
    pub coast_time_constant_s: f64,
    /// Fraction of full voltage below which friction keeps it still. Assumed.
    pub dead_zone: f64,
}

impl Default for MotorParameters {
    fn default() -> Self {
        Self { no_load_rpm: 130.0, time_constant_s: 0.080, coast_time_constant_s: 0.200, dead_zone: 0.06 }
    }
}

/// A motor.
#[derive(Clone, Debug)]
pub struct Motor {
    parameters: MotorParameters,
    drive: Drive,
    blocked: bool,
    speed_rpm: f64,
    /// Angle of the flagellum in encoder counts.
    counts: f64,
}

impl Motor {
    /// A motor at rest.
    pub fn new(parameters: MotorParameters) -> Self {
        Self { parameters, drive: Drive::Coast, blocked: false, speed_rpm: 0.0, counts: START_COUNTS }
    }

    /// Sets the bridge's drive.
    pub fn set_drive(&mut self, drive: Drive) {
        self.drive = drive;
    }

    /// Blocks the flagellum, or releases it.
    pub fn block(&mut self, blocked: bool) {
        self.blocked = blocked;
        if blocked {
            self.speed_rpm = 0.0;
        }
    }

    /// Speed of the flagellum.
    pub fn speed_rpm(&self) -> f64 {
        self.speed_rpm
    }

    /// The same in rad/s.
    pub fn speed_rad_s(&self) -> f64 {
        self.speed_rpm * PI / 30.0
    }

    /// Angle of the flagellum since the start, rad.
    pub fn angle_rad(&self) -> f64 {
        (self.counts - START_COUNTS) / COUNTS_PER_TURN * TAU
    }

    /// Whole encoder counts (edges of both channels) since the start.
    pub fn encoder_counts(&self) -> i64 {
        self.counts.floor() as i64
    }

    /// Levels of the encoder's channels C1 and C2. C1 leads while the motor turns forward.
    pub fn encoder_levels(&self) -> (bool, bool) {
        let quarter = self.encoder_counts().rem_euclid(4);
        (matches!(quarter, 1 | 2), matches!(quarter, 2 | 3))
    }

    /// Advances by `seconds`, at most a little more than [`STEP_S`].
    pub fn advance(&mut self, seconds: f64) {
        if self.blocked {
            return;
        }
        self.counts += self.counts_per_second() * seconds;
        let (rest_rpm, time_constant_s) = match self.drive {
            Drive::Coast => (0.0, self.parameters.coast_time_constant_s),
            Drive::Brake => (0.0, self.parameters.time_constant_s),
            Drive::Voltage(fraction) => (self.rest_rpm(fraction), self.parameters.time_constant_s),
        };
        let decay = (-seconds / time_constant_s).exp();
        self.speed_rpm = rest_rpm + (self.speed_rpm - rest_rpm) * decay;
        if rest_rpm == 0.0 && self.speed_rpm.abs() < 0.05 {
            // Friction ends what would creep for ever.
            self.speed_rpm = 0.0;
        }
    }

    /// Time to the next edge if the speed stays, at most [`STEP_S`].
    pub fn next_event_s(&self) -> f64 {
        let rate = self.counts_per_second();
        let to_edge =
            if rate > 0.0 { self.counts.floor() + 1.0 - self.counts } else { self.counts - self.counts.floor() };
        if rate == 0.0 { STEP_S } else { (to_edge / rate.abs()).clamp(ONE_CYCLE_S, STEP_S) }
    }

    fn rest_rpm(&self, fraction: f64) -> f64 {
        let MotorParameters { no_load_rpm, dead_zone, .. } = self.parameters;
        let above = (fraction.abs() - dead_zone).max(0.0) / (1.0 - dead_zone);
        no_load_rpm * above.copysign(fraction)
    }

    fn counts_per_second(&self) -> f64 {
        self.speed_rpm / 60.0 * COUNTS_PER_TURN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(motor: &mut Motor, seconds: f64) {
        for _ in 0..(seconds / STEP_S) as usize {
            motor.advance(STEP_S);
        }
    }

    #[test]
    fn it_reaches_63_percent_after_one_time_constant() {
        let mut motor = Motor::new(MotorParameters::default());
        motor.set_drive(Drive::Voltage(1.0));
        run(&mut motor, 0.080);
        assert!((motor.speed_rpm() / 130.0 - (1.0 - (-1.0f64).exp())).abs() < 1e-3);
        run(&mut motor, 2.0);
        assert!((motor.speed_rpm() - 130.0).abs() < 1e-6);
        motor.set_drive(Drive::Coast);
        run(&mut motor, 3.0);
        assert_eq!(motor.speed_rpm(), 0.0);
    }

    #[test]
    fn edges_are_as_many_as_the_turn_has() {
        let mut motor = Motor::new(MotorParameters::default());
        motor.set_drive(Drive::Voltage(-0.5));
        let (mut edges, mut level, mut seconds) = (0, motor.encoder_levels(), 0.0);
        while motor.encoder_counts() > -1205 {
            let step = motor.next_event_s();
            motor.advance(step);
            seconds += step;
            edges += i32::from(motor.encoder_levels() != level);
            level = motor.encoder_levels();
            assert!(seconds < 10.0, "does not turn");
        }
        assert_eq!(edges, 1205);
    }

    #[test]
    fn low_voltage_and_a_block_keep_it_still() {
        let mut motor = Motor::new(MotorParameters::default());
        motor.set_drive(Drive::Voltage(0.05));
        run(&mut motor, 1.0);
        assert_eq!(motor.speed_rpm(), 0.0);
        motor.set_drive(Drive::Voltage(1.0));
        run(&mut motor, 1.0);
        motor.block(true);
        let counts = motor.encoder_counts();
        run(&mut motor, 1.0);
        assert_eq!((motor.speed_rpm(), motor.encoder_counts()), (0.0, counts));
    }
}
