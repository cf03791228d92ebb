//! The reaction to a hang: motors off, a record that survives, and a restart.
//!
//! At the watchdog's first time-out, an interrupt stops the motors, records where the program hung, and restarts it by a
//! jump. If the program hangs with interrupts off, the second time-out resets the chip, which makes all pins inputs: the
//! motors are off in any case after two time-outs. That reset leaves the watchdog on, and the old bootloader of some Nanos
//! does not turn it off: the chip is reset again and again, with the motors off, until the board loses power. The button does
//! not help, because the flag that keeps the watchdog on survives it.
//!
//! A reset while a motor was on, whatever its cause, is logged as a hang without an address. So is a reset while the fault
//! that turned the motors off is being logged.

use core::arch::global_asm;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;

use avr_device::atmega328p::{CPU, WDT};
use avr_device::{asm, interrupt};

use super::outputs;

/// Interrupt, then reset, after 4096 cycles of its 128 kHz each: 32 ms, six ticks (tables 10-1 and 10-2).
const WATCHDOG: u8 = 1 << 6 | 1 << 3 | 0b001;
/// Allows the next write within four cycles to change the watchdog.
const CHANGE: u8 = 1 << 4 | 1 << 3;
/// The flag of an interrupt that has not been served; writing a one clears it.
const PENDING: u8 = 1 << 7;

/// The value of GPIOR1 after a hang. No start-up code touches this register, and every reset clears it.
const HUNG: u8 = 0xB1;

/// Where the program hung, words. The start-up code leaves it unchanged; only a record of a hang makes it valid.
#[unsafe(link_section = ".noinit")]
static mut PROGRAM_COUNTER: MaybeUninit<u16> = MaybeUninit::uninit();

/// [`DRIVEN`] if a motor was on after the last tick or request, or when the fault that is being logged stopped it. A bootloader that a
/// reset runs uses both ends of the memory, and leaves this unchanged.
#[unsafe(link_section = ".noinit")]
static mut MOTORS: MaybeUninit<u16> = MaybeUninit::uninit();

/// A value that the memory has by chance at one in 65536 power-ups.
const DRIVEN: u16 = 0xB1F1;

/// Records for the start after a reset whether a motor is on. While a fault is being logged, the record of a driven motor
/// stays: the next reset, for example from a bouncing plug, may come before the fault's record is complete.
pub fn keep(is_driven: bool, is_logging: bool) {
    if is_driven || !is_logging {
        // SAFETY: nothing else uses it. Volatile, because nobody reads it before a reset.
        unsafe { (&raw mut MOTORS).cast::<u16>().write_volatile(if is_driven { DRIVEN } else { 0 }) };
    }
}

/// Returns whether a reset of any cause came while a motor was on. The cause is not used, because most bootloaders
/// clear the reset flags.
pub fn was_driven() -> bool {
    // SAFETY: as in `keep`; the memory has some content, and any is a valid integer.
    unsafe { (&raw const MOTORS).cast::<u16>().read_volatile() == DRIVEN }
}

/// Returns the address in flash at which the program hung, bytes, if a hang led to this start. Clears the record.
pub fn take_hang(cpu: &CPU) -> Option<u16> {
    let has_hung = cpu.gpior1.read().bits() == HUNG;
    cpu.gpior1.reset();
    // SAFETY: the interrupt that left this record has written it; nothing else uses it.
    has_hung.then(|| unsafe { (*(&raw const PROGRAM_COUNTER)).assume_init() << 1 })
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
    outputs::all_off();
    // SAFETY: interrupts are off in an interrupt, and this one does not return: nothing runs after this but the start-up
    // code, which sets up stack, data and registers; main sets up the peripherals.
    unsafe {
        (*(&raw mut PROGRAM_COUNTER)).write(program_counter);
        (*CPU::ptr()).gpior1.write(|write| write.bits(HUNG));
        core::arch::asm!("jmp 0", options(noreturn));
    }
}

unsafe extern "C" {
    /// Does not exist: an image in which something can panic does not link.
    safe fn this_image_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    this_image_can_panic()
}
