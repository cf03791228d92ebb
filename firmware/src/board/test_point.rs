//! Two test points for an emulator or a debugger, at a cost of one instruction each where they are.
//!
//! - The program writes to GPIOR0 what it has done: the codes of [`firmware::app::Stage`].
//! - Bit 0 of GPIOR2 asks for a hang: the main loop clears it and spins for ever, until the watchdog ends that. Nothing on
//!   the board writes there.

use avr_device::atmega328p::CPU;
use firmware::app::Stage;

/// Tells what ends.
#[inline(always)]
pub fn mark(stage: Stage) {
    // SAFETY: this register has no other user, and no effect.
    unsafe { CPU::steal().gpior0().write(|write| write.bits(stage as u8)) };
}

/// Hangs if asked to.
#[inline(always)]
pub fn hang_if_asked() {
    const HANG: u8 = 1 << 0;
    // SAFETY: as above.
    let cpu = unsafe { CPU::steal() };
    if cpu.gpior2().read().bits() & HANG != 0 {
        cpu.gpior2().reset();
        loop {
            avr_device::asm::nop();
        }
    }
}
