//! Two test points for an emulator or a debugger, each at the cost of one instruction.
//!
//! - The program writes each finished stage to GPIOR0, as the code of [`firmware::app::Stage`].
//! - Bit 0 of GPIOR2 requests a hang: the main loop clears it and spins until the watchdog ends it; with bit 1 it turns
//!   interrupts off before. Nothing on the board writes to it.

use avr_device::atmega328p::CPU;
use firmware::app::Stage;

/// Marks the end of a stage.
#[inline(always)]
pub fn mark(stage: Stage) {
    // SAFETY: this register has no other user, and no effect.
    unsafe { CPU::steal().gpior0().write(|write| write.bits(stage as u8)) };
}

/// Hangs if asked to.
#[inline(always)]
pub fn hang_if_asked() {
    const HANG: u8 = 1 << 0;
    const INTERRUPTS_OFF: u8 = 1 << 1;
    // SAFETY: as above.
    let cpu = unsafe { CPU::steal() };
    let asked = cpu.gpior2().read().bits();
    if asked & HANG != 0 {
        cpu.gpior2().reset();
        if asked & INTERRUPTS_OFF != 0 {
            avr_device::interrupt::disable();
        }
        loop {
            avr_device::asm::nop();
        }
    }
}
