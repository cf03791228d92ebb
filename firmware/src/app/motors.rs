//! The motors' part of a tick: measured speeds, set-points, and the duties of the bridges.

use embedded_hal::digital::OutputPin;
use embedded_hal::i2c::I2c;
use embedded_hal::pwm::SetDutyCycle;
use protocol::units::{CentiRpm, Duty};
use protocol::{Fault, SpeedFrom};

use super::{App, Tick};
use crate::encoder::Encoder;
use crate::storage::Storage;

/// The largest change of a duty in a tick, for motors without encoders.
const RAMP: i16 = 2;

impl<I2C: I2c, PIN: OutputPin, PWM: SetDutyCycle, STORAGE: Storage> App<I2C, PIN, PWM, STORAGE> {
    /// Measures a speed, and checks the motor's reaction to the duty of the tick before.
    #[inline(never)]
    pub(super) fn measure_speed(&mut self, motor: usize, tick: &Tick) {
        if self.is_blind() {
            // The board cannot detect a motor that stands still; the host does, by the swing of its flagellum.
            self.telemetry.speed[motor] = CentiRpm::UNKNOWN;
            return;
        }
        let edges = &tick.edges[motor];
        let mut motion = self.encoders[motor].update(edges, tick.time, self.speed_scale);
        if self.settings.encoder_reversed[motor] {
            motion.speed.0 = -motion.speed.0;
            motion.counts = -motion.counts;
        }
        let telemetry = &mut self.telemetry;
        telemetry.speed[motor] = motion.speed;
        telemetry.encoder[motor].0 = telemetry.encoder[motor].0.wrapping_add(i32::from(motion.counts));
        telemetry.glitches.0 = telemetry.glitches.0.wrapping_add(u16::from(motion.glitches));
        let (duty, target) = (telemetry.duty[motor], telemetry.target[motor]);
        let moving_duty = self.settings.moving_duty[motor];
        let mut faults = self.guards[motor].check(duty, target, &motion, moving_duty, self.count_in_ticks);
        if edges.is_noisy || faults[0] == Fault::Encoder1Failed {
            self.store.positions.lose();
        }
        if self.is_running() {
            self.control[motor].follow(target, tick.missed, &motion, self.count_in_ticks);
        }
        if edges.is_noisy {
            faults = [Fault::Encoder1Noisy, Fault::Encoder2Noisy];
        } else if !self.is_running() && faults[0] != Fault::Motor1Overloaded {
            // The other faults are about keeping a speed.
            return;
        }
        self.raise(if motor == 0 { faults[0] } else { faults[1] });
    }

    /// Returns whether the motors have no encoders.
    pub(super) fn is_blind(&self) -> bool {
        self.settings.speed_from == SpeedFrom::Duty
    }

    #[inline(never)]
    pub(super) fn follow_schedule(&mut self, tick: &Tick) {
        if let Some(point) = self.schedule.advance(tick.missed.saturating_add(1), tick.time) {
            self.telemetry.phase = point.phase;
            self.telemetry.target = point.speeds;
            self.duties = point.duties;
            if !self.is_running() {
                self.turn_off();
            }
        }
    }

    /// Sets the speeds of a turn to positions, and ends it.
    #[inline(never)]
    pub(super) fn follow_turn(&mut self) {
        let Some(turn) = &self.turn else { return };
        self.telemetry.target = turn.speeds(self.telemetry.encoder);
        let [first, second] = self.telemetry.target;
        if first.0 | second.0 == 0 && self.encoders.iter().all(Encoder::is_still) {
            self.turn_off();
        }
    }

    /// Drives the motors. They wait until the record of the positions at rest is invalid, because the board would use it
    /// after a loss of power.
    #[inline(never)]
    pub(super) fn drive_motors(&mut self) {
        if !self.store.positions.may_change() {
            return;
        }
        if self.drive_ticks > 0 {
            self.motors.drive(&self.telemetry.duty, &self.settings);
            self.drive_ticks -= 1;
            if self.drive_ticks == 0 {
                self.turn_off();
            }
        }
        if self.is_running() {
            self.telemetry.duty = [self.next_duty(0), self.next_duty(1)];
            self.motors.drive(&self.telemetry.duty, &self.settings);
        }
    }

    #[inline(never)]
    fn next_duty(&mut self, motor: usize) -> Duty {
        let (target, speed) = (self.telemetry.target[motor], self.telemetry.speed[motor]);
        if self.is_blind() {
            let goal = i16::from(self.duties[motor]);
            return ramp(self.telemetry.duty[motor], if target.0.is_negative() { -goal } else { goal });
        }
        let control = &mut self.control[motor];
        match self.turn {
            None => control.duty(target, speed, self.speed_gains),
            Some(_) => control.approach(target, speed, self.speed_gains),
        }
    }
}

/// Returns the duty of the next tick on the way to `goal`.
#[inline(never)]
fn ramp(Duty(duty): Duty, goal: i16) -> Duty {
    if duty < goal { Duty((duty + RAMP).min(goal)) } else { Duty((duty - RAMP).max(goal)) }
}
