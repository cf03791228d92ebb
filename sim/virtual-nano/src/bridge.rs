//! The motor bridge and its wiring to the Nano.
//!
//! | motor | PWM | IN1 | IN2 | encoder C1 | C2 |
//! | --- | --- | --- | --- | --- | --- |
//! | 1 (A) | D6 = PD6 (OC0A) | D8 = PB0 | D7 = PD7 | D3 = PD3 | D5 = PD5 |
//! | 2 (B) | D11 = PB3 (OC2A) | D10 = PB2 | D12 = PB4 | D2 = PD2 | D4 = PD4 |
//!
//! STBY is D9 = PB1. An encoder's C1 is on an interrupt pin. A bridge without enable has its first input at PWM, its second at
//! IN1, and nothing at IN2. Inputs at a pin that is no output are pulled down: in the bridge, or on the enables of an L298N.
//!
//! | bridge | from | PWM high | PWM low |
//! | --- | --- | --- | --- |
//! | TB6612FNG | Toshiba, control functions | by the inputs | brake; coast with both inputs low |
//! | L298N | ST, bidirectional DC motor control | by the inputs, equal ones brake | coast |
//! | DRV8833 | TI, PWM control of motor speed | forwards; brake with IN1 high | coast; backwards with IN1 high |

use crate::mcu::{FREQUENCY_HZ, Outputs};

/// A bridge.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Model {
    /// TB6612FNG.
    #[default]
    Tb6612,
    /// L298N on a board with its diodes.
    L298n,
    /// DRV8833, always awake.
    Drv8833,
}

impl Model {
    /// Returns its voltage drop, V. The MOSFETs of the other two lose some 0.1 V at the currents of such motors, which is
    /// left out.
    pub fn lost_v(self) -> f64 {
        match self {
            // Its least total drop at 1 A (ST, electrical characteristics). Own choice: the same at any current.
            Self::L298n => 1.8,
            Self::Tb6612 | Self::Drv8833 => 0.0,
        }
    }
}

/// The bridge's output to a motor.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum Drive {
    /// Outputs open.
    #[default]
    Coast,
    /// Motor shorted.
    Brake,
    /// This fraction of the supply voltage, -1 to 1; shorted between the pulses. Positive is forwards.
    Voltage(f64),
    /// The supply voltage for this share of the time, -1 to 1; open between the pulses, of which there are `hz` a second.
    #[expect(missing_docs, reason = "the line above says what the fields are")]
    Pulses { share: f64, hz: f64 },
}

/// The outputs to both motors that the pins set.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Bridge {
    /// High time of the two PWM pins, 0 to 255.
    pub pwm: [u8; 2],
    /// Frequency of the two PWM pins with a resonator of 16 MHz; 0 if the timer stands still.
    pub pwm_hz: [f64; 2],
    /// Motors 1 and 2.
    pub drive: [Drive; 2],
    /// Whether the board's LED is lit: D13 = PB5.
    pub led: bool,
}

impl Bridge {
    /// Reads the pins of a bridge of this model.
    pub fn from_outputs(model: Model, o: &Outputs) -> Self {
        let port_b = o.port_b & o.ddr_b;
        let port_d = o.port_d & o.ddr_d;
        let pin = |port: u8, bit: u8| port >> bit & 1 == 1;
        let pwm = [
            pulse_width(o.tccr0a, o.ocr0a, pin(port_d, 6), pin(o.ddr_d, 6)),
            pulse_width(o.tccr2a, o.ocr2a, pin(port_b, 3), pin(o.ddr_b, 3)),
        ];
        let standby = !pin(port_b, 1);
        let inputs = [(pin(port_b, 0), pin(port_d, 7)), (pin(port_b, 2), pin(port_b, 4))];
        let pwm_hz = [
            pwm_hz(o.tccr0a, o.tccr0b, [0, 1, 8, 64, 256, 1024, 0, 0]),
            pwm_hz(o.tccr2a, o.tccr2b, [0, 1, 8, 32, 64, 128, 256, 1024]),
        ];
        let drive = std::array::from_fn(|motor| {
            let (inputs, pwm, hz) = (inputs[motor], pwm[motor], pwm_hz[motor]);
            match model {
                Model::Tb6612 => tb6612(standby, inputs, pwm),
                Model::L298n => l298n(inputs, pwm, hz),
                Model::Drv8833 => drv8833(inputs.0, pwm, hz),
            }
        });
        Self { pwm, pwm_hz, drive, led: pin(port_b, 5) }
    }
}

/// Returns the high time of a timer's output A out of 255 (data sheet of the ATmega328P, sections 15.7 and 18.7).
fn pulse_width(tccra: u8, ocr: u8, port: bool, is_output: bool) -> u8 {
    let compare_mode = tccra >> 6;
    // Fast PWM is high for one count more than OCR says: a compare value of zero does not turn it off.
    let shortest = u8::from(tccra & 0b11 == 0b11);
    match compare_mode {
        _ if !is_output => 0,
        2 => ocr.max(shortest),
        3 => 255 - ocr.max(shortest),
        _ => 255 * u8::from(port),
    }
}

/// Returns the frequency of a timer's PWM: fast (256 counts a period) or phase-correct (510), with its prescalers in
/// the order of the clock select bits (sections 15.9.2 and 18.11.2).
fn pwm_hz(tccra: u8, tccrb: u8, prescalers: [u32; 8]) -> f64 {
    let period = if tccra & 0b11 == 0b11 { 256 } else { 510 };
    match prescalers[usize::from(tccrb & 7)] {
        0 => 0.0,
        prescaler => FREQUENCY_HZ as f64 / f64::from(prescaler * period),
    }
}

fn tb6612(standby: bool, (in1, in2): (bool, bool), pwm: u8) -> Drive {
    match (in1, in2) {
        _ if standby => Drive::Coast,
        (true, true) => Drive::Brake,
        (false, false) => Drive::Coast,
        _ if pwm == 0 => Drive::Brake,
        (true, false) => Drive::Voltage(f64::from(pwm) / 255.0),
        (false, true) => Drive::Voltage(-f64::from(pwm) / 255.0),
    }
}

fn l298n((in1, in2): (bool, bool), enable: u8, hz: f64) -> Drive {
    let share = f64::from(enable) / 255.0;
    match (in1, in2) {
        _ if enable == 0 => Drive::Coast,
        (true, false) => Drive::Pulses { share, hz },
        (false, true) => Drive::Pulses { share: -share, hz },
        _ => Drive::Brake,
    }
}

fn drv8833(second: bool, first: u8, hz: f64) -> Drive {
    match (first, second) {
        (0, false) => Drive::Coast,
        (_, false) => Drive::Pulses { share: f64::from(first) / 255.0, hz },
        (255, true) => Drive::Brake,
        (_, true) => Drive::Voltage(f64::from(first) / 255.0 - 1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_truth_tables_are_the_data_sheets() {
        assert_eq!(tb6612(true, (true, false), 255), Drive::Coast);
        assert_eq!(tb6612(false, (true, true), 255), Drive::Brake);
        assert_eq!(tb6612(false, (false, false), 255), Drive::Coast);
        assert_eq!(tb6612(false, (true, false), 0), Drive::Brake);
        assert_eq!(tb6612(false, (true, false), 255), Drive::Voltage(1.0));
        assert_eq!(tb6612(false, (false, true), 51), Drive::Voltage(-0.2));
        let pulses = |share| Drive::Pulses { share, hz: 977.0 };
        assert_eq!(l298n((true, false), 51, 977.0), pulses(0.2));
        assert_eq!(l298n((false, true), 255, 977.0), pulses(-1.0));
        assert_eq!(l298n((true, false), 0, 977.0), Drive::Coast);
        assert_eq!([false, true].map(|both| l298n((both, both), 9, 977.0)), [Drive::Brake; 2]);
        assert_eq!([0, 51].map(|first| drv8833(false, first, 977.0)), [Drive::Coast, pulses(0.2)]);
        assert_eq!([0, 102].map(|first| drv8833(true, first, 977.0)), [Drive::Voltage(-1.0), Drive::Voltage(-0.6)]);
        assert_eq!(drv8833(true, 255, 977.0), Drive::Brake);
    }

    #[test]
    fn an_input_pin_puts_out_nothing() {
        let lit = Outputs { tccr0a: 0x81, ocr0a: 200, ddr_d: 1 << 6, ..Outputs::default() };
        assert_eq!(Bridge::from_outputs(Model::Tb6612, &lit).pwm, [200, 0]);
        assert_eq!(Bridge::from_outputs(Model::Tb6612, &Outputs { ddr_d: 0, ..lit }).pwm, [0, 0]);
    }

    #[test]
    fn fast_pwm_is_off_only_when_the_timer_lets_go_of_the_pin() {
        assert_eq!(pulse_width(0x83, 0, false, true), 1);
        assert_eq!(pulse_width(0x81, 0, false, true), 0);
        assert_eq!(pulse_width(0x03, 90, false, true), 0);
        assert_eq!(pulse_width(0x03, 90, true, true), 255);
    }

    #[test]
    fn the_frequency_follows_from_prescaler_and_mode() {
        let lit = Outputs { tccr0a: 0x83, tccr0b: 3, tccr2a: 0x81, tccr2b: 4, ..Outputs::default() };
        assert_eq!(Bridge::from_outputs(Model::Tb6612, &lit).pwm_hz, [976.5625, 16e6 / 64.0 / 510.0]);
        assert_eq!(Bridge::from_outputs(Model::Tb6612, &Outputs { tccr0b: 0, ..lit }).pwm_hz[0], 0.0);
    }
}
