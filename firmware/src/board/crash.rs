//! The reaction to a hang or a panic: motors off, a record that survives, and a restart.
//!
//! The watchdog interrupts at its first time-out, which stops the motors, records where the program hung, and restarts it by
//! a jump. If the program hangs with interrupts off, the second time-out resets the chip, which makes all pins inputs: the
//! motors are off in any case after two time-outs. After that reset the old bootloader of some Nanos hangs; the board then
//! needs its button or its plug, with the motors off.

use core::arch::global_asm;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;

use avr_device::atmega328p::{CPU, WDT};
use avr_device::{asm, interrupt};
use firmware::fault::Crash;

use super::outputs;

/// Interrupt, then reset, after 4096 cycles of its 128 kHz each: 32 ms, six ticks (tables 10-1 and 10-2).
const WATCHDOG: u8 = 1 << 6 | 1 << 3 | 0b001;
/// Allows the next write within four cycles to change the watchdog.
const CHANGE: u8 = 1 << 4 | 1 << 3;
/// The flag of an interrupt that has not been served; writing a one clears it.
const PENDING: u8 = 1 << 7;

/// Where the program hung, words. The start-up code leaves it unchanged; only a record of a hang makes it valid.
#[unsafe(link_section = ".noinit")]
static mut PROGRAM_COUNTER: MaybeUninit<u16> = MaybeUninit::uninit();

/// Returns the crash that led to this start, if any, and clears the record. It is in GPIOR1, which no start-up code
/// touches and every reset clears.
pub fn take_record(cpu: &CPU) -> Option<Crash> {
    let crash = Crash::from_record(cpu.gpior1.read().bits());
    cpu.gpior1.reset();
    crash
}

/// Returns the address in flash at which the program hung, bytes. `crash` is the record.
pub fn program_counter(crash: Option<Crash>) -> u16 {
    match crash {
        // SAFETY: the interrupt that left this record has written it; nothing else uses it.
        Some(Crash::Hang) => unsafe { (*(&raw const PROGRAM_COUNTER)).assume_init() << 1 },
        _ => 0,
    }
}

/// Returns and clears the hardware's reset flags. The watchdog cannot be stopped before its flag is cleared.
pub fn take_reset_flags(cpu: &CPU) -> u8 {
    let flags = cpu.mcusr.read().bits();
    cpu.mcusr.reset();
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
            watchdog.wdtcsr.write(|write| write.bits(CHANGE));
            watchdog.wdtcsr.write(|write| write.bits(bits));
        }
    });
}

fn restart(crash: Crash) -> ! {
    interrupt::disable();
    outputs::all_off();
    // SAFETY: interrupts are off, and nothing runs after this but the start-up code, which sets up stack, data and
    // registers; main sets up the peripherals.
    unsafe {
        (*CPU::ptr()).gpior1.write(|write| write.bits(crash as u8));
        core::arch::asm!("jmp 0", options(noreturn));
    }
}

// The interrupt of the watchdog: passes the address to which it would return, which is on top of the stack, high byte
// first.
global_asm!(
    ".global __vector_6",
    "__vector_6:",
    "clr r1",
    "pop r25",
    "pop r24",
    "jmp {handler}",
    handler = sym hang,
);

extern "C" fn hang(program_counter: u16) -> ! {
    // SAFETY: interrupts are off in an interrupt, and this one does not return.
    unsafe { (*(&raw mut PROGRAM_COUNTER)).write(program_counter) };
    restart(Crash::Hang)
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    restart(Crash::Panic)
}
