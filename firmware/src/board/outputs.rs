//! The bridge's pins: two PWM channels and five levels.

use core::convert::Infallible;

use avr_device::atmega328p::{PORTB, PORTD, TC0, TC2};
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::pwm::{self, SetDutyCycle};
use firmware::bridge::Channel;
use firmware::drive::Motors;

const AIN1: Pin = Pin { port: Port::B, mask: 1 << 0 };
/// STBY, and the LED of the board, which is therefore lit while a motor is on.
const STBY: Pin = Pin { port: Port::B, mask: 1 << 1 | 1 << 5 };
const BIN1: Pin = Pin { port: Port::B, mask: 1 << 2 };
const BIN2: Pin = Pin { port: Port::B, mask: 1 << 4 };
const AIN2: Pin = Pin { port: Port::D, mask: 1 << 7 };
const OC2A: u8 = 1 << 3;
const OC0A: u8 = 1 << 6;

/// All outputs on port B, and on port D.
const ON_B: u8 = AIN1.mask | STBY.mask | BIN1.mask | BIN2.mask | OC2A;
const ON_D: u8 = AIN2.mask | OC0A;

/// Fast PWM on timers 0 and 2 (sections 15.9.1 and 18.11.1), top 0xFF, output A off for now.
const FAST_PWM: u8 = 0b0000_0011;
/// COMnA1: output A is high up to the compare value.
const OUTPUT_A: u8 = 0b1000_0000;
/// 16 MHz / 64 / 256 = 977 Hz, in each timer's own code.
const TIMER0_DIV_64: u8 = 0b011;
const TIMER2_DIV_64: u8 = 0b100;

/// Returns the motors on their pins, off.
pub fn motors(timers: (TC0, TC2), ports: (PORTB, PORTD)) -> Motors<Pin, Pwm> {
    let ((timer0, timer2), (port_b, port_d)) = (timers, ports);
    all_off();
    // SAFETY: any value is valid in these registers.
    unsafe {
        port_b.ddrb.modify(|read, write| write.bits(read.bits() | ON_B));
        port_d.ddrd.modify(|read, write| write.bits(read.bits() | ON_D));
        timer0.tccr0a.write(|write| write.bits(FAST_PWM));
        timer0.tccr0b.write(|write| write.bits(TIMER0_DIV_64));
        timer2.tccr2a.write(|write| write.bits(FAST_PWM));
        timer2.tccr2b.write(|write| write.bits(TIMER2_DIV_64));
    }
    Motors::new([Channel::new([AIN1, AIN2], Pwm::Timer0), Channel::new([BIN1, BIN2], Pwm::Timer2)], STBY)
}

/// Turns the bridge off in any state of the program: every output low.
pub fn all_off() {
    // SAFETY: called at start and before a restart, when nothing else writes to these registers; any value is valid in
    // them.
    unsafe {
        let (timer0, timer2, port_b, port_d) = (&*TC0::ptr(), &*TC2::ptr(), &*PORTB::ptr(), &*PORTD::ptr());
        timer0.ocr0a.write(|write| write.bits(0));
        timer2.ocr2a.write(|write| write.bits(0));
        timer0.tccr0a.write(|write| write.bits(FAST_PWM));
        timer2.tccr2a.write(|write| write.bits(FAST_PWM));
        port_b.portb.modify(|read, write| write.bits(read.bits() & !ON_B));
        port_d.portd.modify(|read, write| write.bits(read.bits() & !ON_D));
    }
}

#[derive(Clone, Copy)]
enum Port {
    B,
    D,
}

/// An output of the bridge.
#[derive(Clone, Copy)]
pub struct Pin {
    port: Port,
    mask: u8,
}

impl digital::ErrorType for Pin {
    type Error = Infallible;
}

impl OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set(true);
        Ok(())
    }
}

impl Pin {
    #[inline(never)]
    fn set(&self, high: bool) {
        let mask = self.mask;
        let change = |port: u8| if high { port | mask } else { port & !mask };
        // SAFETY: no interrupt that returns writes to these ports, so nothing comes between read and write; any value is
        // valid in them.
        unsafe {
            match self.port {
                Port::B => (*PORTB::ptr()).portb.modify(|read, write| write.bits(change(read.bits()))),
                Port::D => (*PORTD::ptr()).portd.modify(|read, write| write.bits(change(read.bits()))),
            };
        }
    }
}

/// Output A of a timer.
pub enum Pwm {
    /// D6.
    Timer0,
    /// D11.
    Timer2,
}

impl pwm::ErrorType for Pwm {
    type Error = Infallible;
}

impl SetDutyCycle for Pwm {
    fn max_duty_cycle(&self) -> u16 {
        u16::from(u8::MAX)
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        let duty = u8::try_from(duty).unwrap_or(u8::MAX);
        // A compare value of 0 still gives a pulse of one count in 256, so the timer is disconnected from the pin.
        let mode = if duty == 0 { FAST_PWM } else { FAST_PWM | OUTPUT_A };
        // SAFETY: these registers have no other user; any value is valid in them.
        unsafe {
            match self {
                Self::Timer0 => {
                    let timer = &*TC0::ptr();
                    timer.ocr0b.write(|write| write.bits(timer.ocr0a.read().bits()));
                    timer.ocr0a.write(|write| write.bits(duty));
                    timer.tccr0a.write(|write| write.bits(mode));
                }
                Self::Timer2 => {
                    let timer = &*TC2::ptr();
                    timer.ocr2b.write(|write| write.bits(timer.ocr2a.read().bits()));
                    timer.ocr2a.write(|write| write.bits(duty));
                    timer.tccr2a.write(|write| write.bits(mode));
                }
            }
        }
        Ok(())
    }
}
