//! One channel of a bridge: direction pins and PWM.
//!
//! | kind | IN1 | IN2 | PWM | motor |
//! | --- | --- | --- | --- | --- |
//! | enable | high | low | duty | turns forwards |
//! | enable | low | high | duty | turns backwards |
//! | in-in | low | low | duty | turns forwards, free between pulses |
//! | in-in | high | low | 255 - duty | turns backwards, braked between pulses |
//! | both | low | low | 0 | off, free to turn |
//!
//! The inputs of a bridge of kind in-in are PWM and IN1; nothing is at IN2.

use embedded_hal::digital::{OutputPin, PinState};
use embedded_hal::pwm::SetDutyCycle;
use protocol::Bridge;
use protocol::units::Duty;

/// One channel of the bridge.
pub struct Channel<PIN, PWM> {
    /// IN1, IN2.
    inputs: [PIN; 2],
    pwm: PWM,
}

impl<PIN: OutputPin, PWM: SetDutyCycle> Channel<PIN, PWM> {
    /// Returns the channel on its pins. The PWM's largest duty is [`protocol::units::Duty::FULL`].
    pub fn new(inputs: [PIN; 2], pwm: PWM) -> Self {
        Self { inputs, pwm }
    }

    /// Applies a duty of -255 to 255; 0 is off.
    #[inline(never)]
    pub fn apply(&mut self, duty: i16, kind: Bridge) {
        let ([in1, in2], is_forwards) = (&mut self.inputs, duty.is_positive());
        let mut pulse = duty.unsigned_abs();
        // The low one first: both high would brake. The pins of a microcontroller cannot fail.
        let (first, second, is_high) = match kind {
            Bridge::Enable if is_forwards => (in2, in1, true),
            Bridge::Enable => (in1, in2, duty != 0),
            Bridge::InIn => (in2, in1, duty.is_negative()),
        };
        first.set_low().ok();
        second.set_state(PinState::from(is_high)).ok();
        if kind == Bridge::InIn && is_high {
            pulse = Duty::FULL.0.unsigned_abs() - pulse;
        }
        self.pwm.set_duty_cycle(pulse).ok();
    }
}
