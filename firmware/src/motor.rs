//! Two motors on a TB6612 bridge: direction pins, PWM, speed control.
//!
//! | IN1 | IN2 | PWM | motor |
//! | --- | --- | --- | --- |
//! | high | low | duty | turns forwards |
//! | low | high | duty | turns backwards |
//! | low | low | 0 | off, free to turn |
//!
//! STBY is low whenever both motors are off, so that a motor then turns only if two pins fail.

use embedded_hal::digital::{OutputPin, PinState};
use embedded_hal::pwm::SetDutyCycle;
use protocol::units::{CentiRpm, Duty};

use crate::{TICK_S, round_to_i16};

/// One channel of the bridge.
pub struct Bridge<PIN, PWM> {
    /// IN1, IN2.
    inputs: [PIN; 2],
    pwm: PWM,
}

impl<PIN: OutputPin, PWM: SetDutyCycle> Bridge<PIN, PWM> {
    /// Returns the channel on its pins. The PWM's largest duty is [`Duty::FULL`].
    pub fn new(inputs: [PIN; 2], pwm: PWM) -> Self {
        Self { inputs, pwm }
    }

    /// Applies a duty of -255 to 255; 0 is off.
    #[inline(never)]
    fn apply(&mut self, duty: i16) {
        // The low one first: both high would brake. The pins of a microcontroller cannot fail.
        let ([in1, in2], forwards) = (&mut self.inputs, duty > 0);
        let (first, second) = if forwards { (in2, in1) } else { (in1, in2) };
        first.set_low().ok();
        second.set_state(PinState::from(duty != 0)).ok();
        self.pwm.set_duty_cycle(duty.unsigned_abs()).ok();
    }
}

/// Gains of the speed control, in its internal units.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Gains {
    /// Duty steps per hundredth of rpm.
    kp: f32,
    /// Duty steps per hundredth of rpm and tick.
    ki: f32,
}

impl Gains {
    /// Converts from duty steps per rpm, and per rpm and second.
    pub fn new(kp: f32, ki: f32) -> Self {
        Self { kp: kp * 0.01, ki: ki * (0.01 * TICK_S) }
    }
}

/// Speed control of one motor: PI; a target of zero turns the motor off.
#[derive(Debug, Default)]
pub struct SpeedControl {
    /// Integral term, duty steps.
    integral: f32,
}

impl SpeedControl {
    /// Returns the duty for the next tick.
    #[inline(never)]
    pub fn duty(&mut self, target: CentiRpm, speed: CentiRpm, gains: Gains) -> Duty {
        if target.0 == 0 {
            self.integral = 0.0;
            return Duty(0);
        }
        let error = (i32::from(target.0) - i32::from(speed.0)) as f32;
        let integral = self.integral + gains.ki * error;
        let duty = gains.kp * error + integral;
        let limited = round_to_i16(duty, 0).clamp(-Duty::FULL.0, Duty::FULL.0);
        // Anti-windup: at the limit of the duty, the integral only moves away from it.
        if limited.abs() < Duty::FULL.0 || duty.is_sign_negative() != error.is_sign_negative() {
            self.integral = integral;
        }
        Duty(limited)
    }
}

/// Both motors.
pub struct Motors<PIN, PWM> {
    bridges: [Bridge<PIN, PWM>; 2],
    standby: PIN,
}

impl<PIN: OutputPin, PWM: SetDutyCycle> Motors<PIN, PWM> {
    /// Returns both motors, off. `standby` is the bridge's STBY pin.
    pub fn new(bridges: [Bridge<PIN, PWM>; 2], standby: PIN) -> Self {
        let mut motors = Self { bridges, standby };
        motors.stop();
        motors
    }

    /// Turns both motors off.
    pub fn stop(&mut self) {
        self.standby.set_low().ok();
        for bridge in &mut self.bridges {
            bridge.apply(0);
        }
    }

    /// Drives both motors; `reversed` tells which of them a positive duty turns backwards.
    pub fn drive(&mut self, duty: &[Duty; 2], reversed: &[bool; 2]) {
        if duty[0].0 | duty[1].0 == 0 {
            return self.stop();
        }
        for ((bridge, duty), reversed) in self.bridges.iter_mut().zip(duty).zip(reversed) {
            bridge.apply(if *reversed { -duty.0 } else { duty.0 });
        }
        self.standby.set_high().ok();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_hal_mock::eh1::digital::{Mock as Pin, State, Transaction as PinSet};
    use embedded_hal_mock::eh1::pwm::{Mock as Pwm, Transaction as PwmSet};

    const GAINS: Gains = Gains { kp: 0.01, ki: 0.05 * TICK_S };

    /// Returns a bridge that expects these calls: IN1, IN2 and duty.
    fn bridge(calls: &[(State, State, u16)]) -> (Bridge<Pin, Pwm>, [Pin; 2], Pwm) {
        let in1 = Pin::new(&calls.iter().map(|call| PinSet::set(call.0)).collect::<Vec<_>>());
        let in2 = Pin::new(&calls.iter().map(|call| PinSet::set(call.1)).collect::<Vec<_>>());
        let pwm = Pwm::new(&calls.iter().map(|call| PwmSet::set_duty_cycle(call.2)).collect::<Vec<_>>());
        (Bridge::new([in1.clone(), in2.clone()], pwm.clone()), [in1, in2], pwm)
    }

    #[test]
    fn directions_duties_and_standby_reach_the_pins() {
        use State::{High, Low};
        let off = (Low, Low, 0);
        let (first, pins1, pwm1) = bridge(&[off, (High, Low, 200), (Low, High, 255), (High, Low, 9), off]);
        let (second, pins2, pwm2) = bridge(&[off, (High, Low, 7), off, (Low, High, 9), off]);
        let standby = Pin::new(&[Low, High, High, High, Low].map(PinSet::set));
        let mut motors = Motors::new([first, second], standby.clone());
        motors.drive(&[Duty(200), Duty(-7)], &[false, true]);
        motors.drive(&[Duty(-255), Duty(0)], &[false, true]);
        motors.drive(&[Duty(9), Duty(9)], &[false, true]);
        motors.drive(&[Duty(0), Duty(0)], &[false, true]);
        for mut pin in pins1.into_iter().chain(pins2).chain([standby]) {
            pin.done();
        }
        pwm1.clone().done();
        pwm2.clone().done();
    }

    /// A motor that reaches `rpm_per_step * duty` with a time constant of 80 ms.
    fn simulate(control: &mut SpeedControl, speed: &mut f64, target: CentiRpm, rpm_per_step: f64, ticks: u32) -> i16 {
        let mut duty = Duty(0);
        for _ in 0..ticks {
            duty = control.duty(target, CentiRpm::from_rpm(*speed), GAINS);
            *speed += (f64::from(duty.0) * rpm_per_step - *speed) * 0.005 / 0.08;
        }
        duty.0
    }

    #[test]
    fn the_target_is_reached_in_both_directions_and_zero_is_off() {
        for target in [90.0, -35.5, 4.0] {
            let (mut control, mut speed) = (SpeedControl::default(), 0.0);
            simulate(&mut control, &mut speed, CentiRpm::from_rpm(target), 0.4, 2000);
            assert!((speed - target).abs() < 0.5, "{speed} for {target}");
            assert_eq!(control.duty(CentiRpm(0), CentiRpm::from_rpm(speed), GAINS), Duty(0));
            assert_eq!(control.integral, 0.0);
        }
    }

    #[test]
    fn a_long_overload_does_not_wind_up_the_integral() {
        let (mut control, mut speed) = (SpeedControl::default(), 0.0);
        // The supply is too weak for the target: the duty stays at its limit.
        assert_eq!(simulate(&mut control, &mut speed, CentiRpm(9000), 0.2, 4000), 255);
        // Back at full supply the duty leaves its limit within half a second.
        assert!(simulate(&mut control, &mut speed, CentiRpm(9000), 0.5, 100) < 255);
        let (mut control, mut speed) = (SpeedControl::default(), 0.0);
        assert_eq!(simulate(&mut control, &mut speed, CentiRpm(-9000), 0.2, 4000), -255);
        assert!(simulate(&mut control, &mut speed, CentiRpm(-9000), 0.5, 100) > -255);
    }

    #[test]
    fn gains_at_their_limits_stay_finite() {
        let mut control = SpeedControl::default();
        for speed in [i16::MIN, i16::MAX, 0] {
            let duty = control.duty(CentiRpm(9000), CentiRpm(speed), Gains::new(1000.0, 1000.0));
            assert!(duty.0.abs() <= 255 && control.integral.is_finite());
        }
        assert_eq!(
            control.duty(CentiRpm(9000), CentiRpm(0), Gains::new(0.0, 0.0)).0,
            round_to_i16(control.integral, 0)
        );
    }
}
