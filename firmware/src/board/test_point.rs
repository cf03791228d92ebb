//! A test point for an emulator or a debugger, at the cost of one instruction: the program writes each finished stage to
//! GPIOR0, as the code of [`firmware::app::Stage`].

use avr_device::atmega328p::CPU;
use firmware::app::Stage;

/// Marks the end of a stage.
#[inline(always)]
pub fn mark(stage: Stage) {
    // SAFETY: this register has no other user, and no effect.
    unsafe { (*CPU::ptr()).gpior0.write(|write| write.bits(stage as u8)) };
}
