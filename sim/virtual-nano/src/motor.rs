//! A geared brushed motor, seen from the flagellum: first order from voltage to speed.
//!
//! speed' = (steady speed at this voltage - speed) / time constant
//!
//! The steady speed grows linearly with the voltage. The mean voltage at a motor that is open between pulses depends on its
//! current: at a low share the current ends before the next pulse, and the motor's own voltage (back EMF) is left. So the
//! speed is not linear in the share.

use crate::bridge::Drive;
use crate::drift::Wander;
use std::f64::consts::{PI, TAU};

/// Encoder counts per turn of the flagellum: 12 edges of both channels per motor turn, gear of 100.37 (the published
/// robot).
pub const COUNTS_PER_TURN: f64 = 12.0 * GEAR;

/// Turns of a motor's own shaft in a turn of its flagellum.
pub const GEAR: f64 = 100.37;

/// Longest step of the model, s. The speed is taken as constant within it: 1/160 of the time constant.
pub const STEP_S: f64 = 0.5e-3;

/// Counts at the start: half a count away from an edge, so that only motion causes one.
const START_COUNTS: f64 = 0.5;

/// Interval between two moves of a rotor that slips, s, and the size of a move: an edge of each channel.
const SLIP_S: f64 = 1.0;
const SLIP_COUNTS: f64 = 2.0;

/// Supply for which a motor's parameters hold, V.
pub const NOMINAL_V: f64 = 6.0;

/// Parameters of a motor.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct MotorParameters {
    /// Speed at full voltage, rpm. Assumed: the published robot runs at 90 rpm with a margin for control.
    pub no_load_rpm: f64,
    /// Time constant while the bridge drives or brakes, s. Assumed: usual for gear motors of this size.
    pub time_constant_s: f64,
    /// Time constant while it coasts, s, when only friction stops it. Assumed.
    pub coast_time_constant_s: f64,
    /// Fraction of full voltage below which friction stops it. Assumed.
    pub dead_zone: f64,
    /// Fraction of full voltage that starts it from rest: more than the dead zone if the gear sticks.
    pub breakaway: f64,
    /// Whether it is wired to turn backwards where other motors turn forwards.
    pub reversed: bool,
}

impl MotorParameters {
    /// The published robot's.
    pub const PUBLISHED: Self = Self {
        no_load_rpm: 130.0,
        time_constant_s: 0.080,
        coast_time_constant_s: 0.200,
        dead_zone: 0.06,
        breakaway: 0.06,
        reversed: false,
    };
}

/// Electrical time constant, s. Own choice: 0.6 mH at the 4 ohms of a motor that takes 1.5 A from 6 V when blocked.
const ELECTRICAL_S: f64 = 0.15e-3;

/// Voltage of the two diodes through which the current of an open motor flows back into the supply, V. Own choice: silicon.
const DIODES_V: f64 = 1.6;

/// Whether a motor can turn.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum Rotor {
    /// It can turn.
    #[default]
    Free,
    /// Something holds it.
    Blocked,
    /// Something holds it, and gives way by an edge of each channel a second.
    Slips,
}

/// A motor.
#[derive(Clone, Debug)]
pub struct Motor {
    /// The parameters.
    pub parameters: MotorParameters,
    /// The bridge's drive.
    pub drive: Drive,
    rotor: Rotor,
    /// Time since the last slip, s.
    held_s: f64,
    /// Whether the motors' supply is on and its leads are connected.
    pub powered: bool,
    /// Its supply, and the supply less the bridge's voltage drop, as fractions of the nominal one.
    supply: f64,
    driven: f64,
    /// Relative change of its speed.
    pub wander: Wander,
    /// Whether the motor's own two leads have been swapped.
    pub reversed: bool,
    /// Speed of the flagellum, rpm.
    pub speed_rpm: f64,
    /// Angle of the flagellum in encoder counts.
    pub counts: f64,
}

impl Motor {
    /// Returns a motor at rest.
    pub fn new(parameters: MotorParameters) -> Self {
        Self {
            parameters,
            drive: Drive::Coast,
            rotor: Rotor::Free,
            held_s: 0.0,
            powered: true,
            supply: 1.0,
            driven: 1.0,
            wander: Wander::new(0.0, 0),
            reversed: false,
            speed_rpm: 0.0,
            counts: START_COUNTS,
        }
    }

    /// Holds the flagellum, or releases it.
    pub fn hold(&mut self, rotor: Rotor) {
        self.rotor = rotor;
        self.held_s = 0.0;
        if rotor != Rotor::Free {
            self.speed_rpm = 0.0;
        }
    }

    /// Sets the motors' supply, and the part of it that the bridge loses, V.
    pub fn set_supply(&mut self, volts: f64, lost_v: f64) {
        self.supply = volts / NOMINAL_V;
        self.driven = (volts - lost_v).max(0.0) / NOMINAL_V;
    }

    /// Returns the speed of the flagellum, rad/s.
    pub fn speed_rad_s(&self) -> f64 {
        self.speed_rpm * PI / 30.0
    }

    /// Returns the angle of the flagellum since the start, rad.
    pub fn angle_rad(&self) -> f64 {
        (self.counts - START_COUNTS) / COUNTS_PER_TURN * TAU
    }

    /// Returns the shaking by its gear while it turns: at the frequency of its own shaft and, as much, at multiples of it.
    /// Readings at 200 Hz alias these to the frequencies of the flagella's swings.
    pub fn shaking(&self) -> f64 {
        let shaking = |multiple: i32| (f64::from(multiple) * self.angle_rad() * GEAR).cos();
        if self.speed_rpm == 0.0 { 0.0 } else { (1..=6).map(shaking).sum() }
    }

    /// Returns the whole encoder counts (edges of both channels) since the start.
    pub fn encoder_counts(&self) -> i64 {
        self.counts.floor() as i64
    }

    /// Returns the speed of the shaft in encoder counts per second.
    pub fn counts_per_second(&self) -> f64 {
        self.speed_rpm / 60.0 * COUNTS_PER_TURN
    }

    /// Advances by `seconds`, at most a little more than [`STEP_S`].
    pub fn advance(&mut self, seconds: f64) {
        self.wander.advance(seconds);
        if self.rotor != Rotor::Free {
            self.held_s += seconds;
            if self.rotor == Rotor::Slips && self.held_s >= SLIP_S {
                self.held_s -= SLIP_S;
                self.counts += SLIP_COUNTS * self.voltage().map_or(0.0, f64::signum);
            }
            return;
        }
        self.counts += self.counts_per_second() * seconds;
        let (rest_rpm, time_constant_s) = match (self.voltage(), self.drive) {
            (Some(fraction), _) => (self.rest_rpm(fraction), self.parameters.time_constant_s),
            (None, Drive::Brake) => (0.0, self.parameters.time_constant_s),
            (None, _) => (0.0, self.parameters.coast_time_constant_s),
        };
        let before = self.speed_rpm;
        let decay = (-seconds / time_constant_s).exp();
        self.speed_rpm = rest_rpm + (before - rest_rpm) * decay;
        // Friction stops a motor that would creep for ever, or turn back without the voltage to break away.
        let creeps = rest_rpm == 0.0 && self.speed_rpm.abs() < 0.05;
        let turns_back = before * self.speed_rpm <= 0.0;
        if creeps || (turns_back && self.voltage().unwrap_or_default().abs() <= self.parameters.breakaway) {
            self.speed_rpm = 0.0;
        }
    }

    /// Returns the mean voltage that drives it, as a fraction of the nominal supply.
    fn voltage(&self) -> Option<f64> {
        if !self.powered {
            return None;
        }
        let sense = if self.reversed != self.parameters.reversed { -1.0 } else { 1.0 };
        match self.drive {
            Drive::Voltage(fraction) => Some(sense * self.driven * fraction),
            Drive::Pulses { share, hz } => {
                let way = (sense * share).signum();
                // Its own voltage (back EMF), as a fraction of the nominal supply.
                let own = way * (self.speed_rpm / self.full_rpm() * (1.0 - self.parameters.dead_zone));
                Some(way * (own + self.pulsed_current(own, share.abs(), hz)))
            }
            _ => None,
        }
    }

    /// Returns the mean current of pulses, as a fraction of the blocked motor's current at the nominal supply. `own`: its own
    /// voltage, positive if it turns in the direction of the pulses.
    ///
    /// During a pulse the current rises towards that of the pulse's voltage less the motor's own. After the pulse it falls,
    /// through the diodes and against the supply, until it is zero or the next pulse begins. Over a period the voltage across
    /// the inductance has the mean 0.
    fn pulsed_current(&self, own: f64, share: f64, hz: f64) -> f64 {
        let period = 1.0 / (hz.max(1.0) * ELECTRICAL_S);
        let (pulse, pause) = (share * period, (1.0 - share) * period);
        let (driving, against) = (self.driven - own, (self.supply + DIODES_V / NOMINAL_V + own).max(1e-3));
        if driving <= 0.0 {
            return 0.0;
        }
        let (after_pulse, after_pause) = ((-pulse).exp(), (-pause).exp());
        let peak = driving * (1.0 - after_pulse) - against * (1.0 - after_pause) * after_pulse;
        let is_continuous = peak * after_pause > against * (1.0 - after_pause) * (1.0 - after_pulse * after_pause);
        let falling = if is_continuous { pause } else { (driving * (1.0 - after_pulse) / against).ln_1p() };
        ((driving * pulse - against * falling) / period).max(0.0)
    }

    fn full_rpm(&self) -> f64 {
        self.parameters.no_load_rpm * (1.0 + self.wander.now)
    }

    fn rest_rpm(&self, fraction: f64) -> f64 {
        let dead_zone = self.parameters.dead_zone;
        let above = (fraction.abs() - dead_zone).max(0.0) / (1.0 - dead_zone);
        self.full_rpm() * above.copysign(fraction)
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
        let mut motor = Motor::new(MotorParameters::PUBLISHED);
        motor.drive = Drive::Voltage(1.0);
        run(&mut motor, 0.080);
        assert!((motor.speed_rpm / 130.0 - (1.0 - (-1.0f64).exp())).abs() < 1e-3);
        run(&mut motor, 2.0);
        assert!((motor.speed_rpm - 130.0).abs() < 1e-6);
        motor.drive = Drive::Coast;
        run(&mut motor, 3.0);
        assert_eq!(motor.speed_rpm, 0.0);
    }

    #[test]
    fn low_voltage_and_a_block_keep_it_still() {
        let mut motor = Motor::new(MotorParameters::PUBLISHED);
        motor.drive = Drive::Voltage(0.05);
        run(&mut motor, 1.0);
        assert_eq!(motor.speed_rpm, 0.0);
        motor.drive = Drive::Voltage(1.0);
        run(&mut motor, 1.0);
        motor.hold(Rotor::Blocked);
        let counts = motor.encoder_counts();
        run(&mut motor, 1.0);
        assert_eq!((motor.speed_rpm, motor.encoder_counts()), (0.0, counts));
    }

    #[test]
    fn a_held_rotor_slips_by_an_edge_of_each_channel_a_second() {
        let mut motor = Motor::new(MotorParameters::PUBLISHED);
        motor.drive = Drive::Voltage(-1.0);
        motor.hold(Rotor::Slips);
        run(&mut motor, 3.2);
        assert_eq!((motor.speed_rpm, motor.encoder_counts()), (0.0, -6));
    }

    #[test]
    fn a_gear_that_sticks_needs_more_to_start_than_to_go_on() {
        let mut motor = Motor::new(MotorParameters { breakaway: 0.25, ..MotorParameters::PUBLISHED });
        let mut speed_at = |fraction: f64| {
            motor.drive = Drive::Voltage(fraction);
            run(&mut motor, 1.0);
            motor.speed_rpm.round()
        };
        assert_eq!([0.2, 0.3, 0.2, -0.2, -0.3].map(&mut speed_at), [0.0, 33.0, 19.0, 0.0, -33.0]);
    }

    /// At a low share of the time the speed is above the straight line of a motor that is braked between the pulses.
    #[test]
    fn pulses_with_pauses_bend_the_line_of_speeds() {
        let mut motor = Motor::new(MotorParameters::PUBLISHED);
        let mut speed_at = |drive| {
            motor.drive = drive;
            // With short pulses the force hardly falls as the motor gets faster, so that this takes long.
            run(&mut motor, 6.0);
            motor.speed_rpm
        };
        let mut of_pulses = |share| speed_at(Drive::Pulses { share, hz: 976.6 });
        let bent = [0.1, 0.2, 0.4, 0.7, 1.0, -0.4].map(&mut of_pulses);
        // The current that friction takes, by steps of 100 ns of a period.
        let current = |own: f64, share: f64| {
            let (mut current, mut sum, steps) = (0.0_f64, 0.0, 10_240);
            for step in 0..10 * steps {
                let is_open = f64::from(step % steps) >= share * f64::from(steps);
                let voltage = if is_open { -(1.0 + DIODES_V / NOMINAL_V) } else { 1.0 };
                current = (current + (voltage - own - current) * 1e-7 / ELECTRICAL_S).max(0.0);
                sum += if step < 9 * steps { 0.0 } else { current / f64::from(steps) };
            }
            sum
        };
        for (share, rpm) in [0.2, 0.4, 0.7, 1.0].into_iter().zip(&bent[1..]) {
            let taken = current(0.94 * rpm / 130.0, share);
            assert!((taken - 0.06).abs() < 0.001, "{share}: {rpm} rpm, {taken}");
        }
        assert!(bent[0] == 0.0 && (bent[4] - 130.0).abs() < 1e-6 && (bent[5] + bent[2]).abs() < 1e-6, "{bent:?}");
        let straight = speed_at(Drive::Voltage(0.4));
        assert!(bent[2] > 1.5 * straight, "{} of {straight} rpm", bent[2]);
    }

    #[test]
    fn its_speed_follows_its_supply() {
        let mut motor = Motor::new(MotorParameters { dead_zone: 0.0, breakaway: 0.0, ..MotorParameters::PUBLISHED });
        motor.drive = Drive::Voltage(0.6);
        motor.set_supply(6.5, 1.5);
        run(&mut motor, 2.0);
        assert!((motor.speed_rpm - 130.0 * 0.6 * 5.0 / 6.0).abs() < 1e-6);
    }

    #[test]
    fn without_supply_it_coasts_and_with_its_leads_swapped_it_turns_back() {
        let mut motor = Motor::new(MotorParameters::PUBLISHED);
        motor.drive = Drive::Voltage(1.0);
        motor.reversed = true;
        run(&mut motor, 2.0);
        assert!((motor.speed_rpm + 130.0).abs() < 1e-6);
        motor.powered = false;
        run(&mut motor, 0.2);
        assert!((motor.speed_rpm / -130.0 - (-1.0f64).exp()).abs() < 1e-3);
    }
}
