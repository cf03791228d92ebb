//! One channel of a TB6612 bridge: direction pins and PWM.
//!
//! | IN1 | IN2 | PWM | motor |
//! | --- | --- | --- | --- |
//! | high | low | duty | turns forwards |
//! | low | high | duty | turns backwards |
//! | low | low | 0 | off, free to turn |

use embedded_hal::digital::{OutputPin, PinState};
use embedded_hal::pwm::SetDutyCycle;

/// One channel of the bridge.
pub struct Bridge<PIN, PWM> {
    /// IN1, IN2.
    inputs: [PIN; 2],
    pwm: PWM,
}

impl<PIN: OutputPin, PWM: SetDutyCycle> Bridge<PIN, PWM> {
    /// Returns the channel on its pins. The PWM's largest duty is [`protocol::units::Duty::FULL`].
    pub fn new(inputs: [PIN; 2], pwm: PWM) -> Self {
        Self { inputs, pwm }
    }

    /// Applies a duty of -255 to 255; 0 is off.
    #[inline(never)]
    pub fn apply(&mut self, duty: i16) {
        // The low one first: both high would brake. The pins of a microcontroller cannot fail.
        let ([in1, in2], forwards) = (&mut self.inputs, duty.is_positive());
        let (first, second) = if forwards { (in2, in1) } else { (in1, in2) };
        first.set_low().ok();
        second.set_state(PinState::from(duty != 0)).ok();
        self.pwm.set_duty_cycle(duty.unsigned_abs()).ok();
    }
}
