//! The deepest reach of the stack: the memory between it and the data is painted before the program starts.

use core::arch::{asm, global_asm};

/// An unlikely content of memory.
const PAINT: u8 = 0xC5;

// Before main, when nothing is on the stack: paints from the end of the data to that of the memory, 0x8FF.
global_asm!(
    ".section .init5, \"ax\", @progbits",
    "ldi r30, lo8(__heap_start)",
    "ldi r31, hi8(__heap_start)",
    "ldi r24, {paint}",
    "1:",
    "st Z+, r24",
    "cpi r31, 9",
    "brne 1b",
    ".text",
    paint = const PAINT,
);

/// Returns [`protocol::Info::ram_left`]. Takes up to some 4,000 cycles.
pub fn ram_left() -> u16 {
    let left: u16;
    // SAFETY: only reads, up to the stack.
    unsafe {
        asm!(
            "ldi r30, lo8(__heap_start)",
            "ldi r31, hi8(__heap_start)",
            "1:",
            "ld {byte}, Z+",
            "cpi {byte}, {paint}",
            "breq 1b",
            "subi r30, lo8(__heap_start + 1)",
            "sbci r31, hi8(__heap_start + 1)",
            byte = out(reg_upper) _,
            paint = const PAINT,
            out("Z") left,
            options(readonly, nostack),
        );
    }
    left
}
