//! The reaction to a hang or a panic: motors off, a record that survives, and a restart.
//!
//! The watchdog interrupts and never resets: after a reset by the watchdog, the bootloaders of many Nanos hang.
//! It cannot interrupt while interrupts are off, so no code with interrupts off may wait for anything.

use core::panic::PanicInfo;

use avr_device::atmega328p::{CPU, WDT};
use avr_device::{asm, interrupt};
use firmware::fault::Crash;

use super::outputs;

/// Interrupt only, after 4096 cycles of its 128 kHz: 32 ms, six ticks (table 10-2).
const WATCHDOG: u8 = 1 << 6 | 0b001;
/// Allows the next write within four cycles to change the watchdog.
const CHANGE: u8 = 1 << 4 | 1 << 3;
/// The flag of an interrupt that has not been served; writing a one clears it.
const PENDING: u8 = 1 << 7;

/// Returns the crash that led to this start, if any, and clears the record. It is in GPIOR1, which no start-up code
/// touches and every reset clears.
pub fn take_record(cpu: &CPU) -> Option<Crash> {
    let crash = Crash::from_record(cpu.gpior1().read().bits());
    cpu.gpior1().reset();
    crash
}

/// Returns and clears the hardware's reset flags.
pub fn take_reset_flags(cpu: &CPU) -> u8 {
    let flags = cpu.mcusr().read().bits();
    cpu.mcusr().reset();
    flags
}

/// Starts the watchdog.
pub fn start_watchdog(watchdog: &WDT) {
    change(watchdog, WATCHDOG | PENDING);
}

/// Stops the watchdog.
pub fn stop_watchdog(watchdog: &WDT) {
    change(watchdog, PENDING);
}

/// Tells the watchdog that the program is alive.
pub fn feed_watchdog() {
    asm::wdr();
}

fn change(watchdog: &WDT, bits: u8) {
    interrupt::free(|_| {
        asm::wdr();
        // SAFETY: the sequence of section 10.8; interrupts are off.
        unsafe {
            watchdog.wdtcsr().write(|write| write.bits(CHANGE));
            watchdog.wdtcsr().write(|write| write.bits(bits));
        }
    });
}

fn restart(crash: Crash) -> ! {
    interrupt::disable();
    outputs::all_off();
    // SAFETY: interrupts are off, and nothing runs after this but the start-up code, which sets up stack, data and
    // registers; main sets up the peripherals.
    unsafe {
        CPU::steal().gpior1().write(|write| write.bits(crash as u8));
        core::arch::asm!("jmp 0", options(noreturn));
    }
}

#[avr_device::interrupt(atmega328p)]
fn WDT() -> ! {
    restart(Crash::Hang)
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    restart(Crash::Panic)
}
