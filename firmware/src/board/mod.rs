//! The Arduino Nano (ATmega328P, 16 MHz) with the robot's wiring: all registers, and no logic.
//!
//! | Nano | chip | to |
//! | --- | --- | --- |
//! | D6, D8, D7 | OC0A, PB0, PD7 | bridge PWMA, AIN1, AIN2: motor 1 |
//! | D11, D10, D12 | OC2A, PB2, PB4 | bridge PWMB, BIN1, BIN2: motor 2 |
//! | D9 | PB1 | bridge STBY |
//! | D3, D5 | INT1, PD5 | encoder 1, channels 1 and 2 |
//! | D2, D4 | INT0, PD4 | encoder 2, channels 1 and 2 |
//! | A4, A5 | SDA, SCL | MPU6050 |
//! | USB | USART0 | host |
//!
//! Timers 0 and 2 make the PWM, timer 1 is the clock and the tick. Section numbers in this folder are those of the data
//! sheet DS40002061B.

pub mod clock;
pub mod crash;
pub mod eeprom;
pub mod encoders;
pub mod outputs;
pub mod serial;
pub mod stack;
pub mod supply;
pub mod test_point;
pub mod twi;

use avr_device::atmega328p::Peripherals;

/// Frequency of the crystal.
pub const CPU_HZ: u32 = 16_000_000;

/// Resets every register that this program uses. The program may have been started by a jump ([`crash`]), with interrupts
/// off and all other registers unchanged.
pub fn reset_registers(peripherals: &Peripherals) {
    outputs::all_off();
    crash::stop_watchdog(&peripherals.WDT);
    serial::disable(&peripherals.USART0);
    clock::disable(&peripherals.TC1);
    encoders::disable(&peripherals.EXINT);
}
