//! Both motors on their bridge.
//!
//! STBY is low whenever both motors are off, so that a motor then turns only if two pins fail.

use embedded_hal::digital::OutputPin;
use embedded_hal::pwm::SetDutyCycle;
use protocol::units::Duty;
use protocol::{Bridge, Settings};

use crate::bridge::Channel;

/// Both motors.
pub struct Motors<PIN, PWM> {
    channels: [Channel<PIN, PWM>; 2],
    standby: PIN,
}

impl<PIN: OutputPin, PWM: SetDutyCycle> Motors<PIN, PWM> {
    /// Returns both motors, off. `standby` is the bridge's STBY pin.
    pub fn new(channels: [Channel<PIN, PWM>; 2], standby: PIN) -> Self {
        let mut motors = Self { channels, standby };
        motors.stop();
        motors
    }

    /// Turns both motors off.
    pub fn stop(&mut self) {
        self.standby.set_low().ok();
        for channel in &mut self.channels {
            channel.apply(0, Bridge::Enable);
        }
    }

    /// Drives both motors through the bridge of these settings.
    pub fn drive(&mut self, duty: &[Duty; 2], settings: &Settings) {
        if duty[0].0 | duty[1].0 == 0 {
            return self.stop();
        }
        for ((channel, duty), reversed) in self.channels.iter_mut().zip(duty).zip(settings.motor_reversed) {
            channel.apply(if reversed { -duty.0 } else { duty.0 }, settings.bridge);
        }
        self.standby.set_high().ok();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_hal_mock::eh1::digital::{Mock as Pin, State, Transaction as PinSet};
    use embedded_hal_mock::eh1::pwm::{Mock as Pwm, Transaction as PwmSet};

    /// Returns a bridge that expects these calls: IN1, IN2 and duty.
    fn bridge(calls: &[(State, State, u16)]) -> (Channel<Pin, Pwm>, [Pin; 2], Pwm) {
        let in1 = Pin::new(&calls.iter().map(|call| PinSet::set(call.0)).collect::<Vec<_>>());
        let in2 = Pin::new(&calls.iter().map(|call| PinSet::set(call.1)).collect::<Vec<_>>());
        let pwm = Pwm::new(&calls.iter().map(|call| PwmSet::set_duty_cycle(call.2)).collect::<Vec<_>>());
        (Channel::new([in1.clone(), in2.clone()], pwm.clone()), [in1, in2], pwm)
    }

    #[test]
    fn directions_duties_and_standby_reach_the_pins() {
        use State::{High, Low};
        let off = (Low, Low, 0);
        let (first, pins1, pwm1) = bridge(&[off, (High, Low, 200), (Low, High, 255), (High, Low, 9), off]);
        let (second, pins2, pwm2) = bridge(&[off, (High, Low, 7), off, (Low, High, 9), off]);
        let standby = Pin::new(&[Low, High, High, High, Low].map(PinSet::set));
        let mut motors = Motors::new([first, second], standby.clone());
        let settings = Settings { motor_reversed: [false, true], ..Settings::DEFAULT };
        motors.drive(&[Duty(200), Duty(-7)], &settings);
        motors.drive(&[Duty(-255), Duty(0)], &settings);
        motors.drive(&[Duty(9), Duty(9)], &settings);
        motors.drive(&[Duty(0), Duty(0)], &settings);
        for mut pin in pins1.into_iter().chain(pins2).chain([standby]) {
            pin.done();
        }
        pwm1.clone().done();
        pwm2.clone().done();
    }

    /// PWM on the first input and direction on the second: backwards the motor turns while PWM is low.
    #[test]
    fn a_bridge_without_enable_has_its_pulses_inverted_backwards() {
        use State::{High, Low};
        // IN2 is low first.
        let off = (Low, Low, 0);
        let (first, pins1, pwm1) = bridge(&[off, (Low, Low, 200), (High, Low, 0), off]);
        let (second, pins2, pwm2) = bridge(&[off, (High, Low, 248), off, off]);
        let standby = Pin::new(&[Low, High, High, Low].map(PinSet::set));
        let mut motors = Motors::new([first, second], standby.clone());
        let settings = Settings { bridge: Bridge::InIn, ..Settings::DEFAULT };
        motors.drive(&[Duty(200), Duty(-7)], &settings);
        motors.drive(&[Duty(-255), Duty(0)], &settings);
        motors.stop();
        for mut pin in pins1.into_iter().chain(pins2).chain([standby]) {
            pin.done();
        }
        pwm1.clone().done();
        pwm2.clone().done();
    }
}
