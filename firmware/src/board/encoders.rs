//! The encoders: both edges of channel 1 interrupt, channel 2 gives the direction.

use core::cell::Cell;

use avr_device::asm::delay_cycles;
use avr_device::atmega328p::{EXINT, PORTD};
use avr_device::interrupt::{self, CriticalSection, Mutex};
use firmware::encoder::{Edges, Filter};

use super::clock;

/// INT0 and INT1 at any edge (section 13.2.1).
const ANY_EDGE: u8 = 0b0101;
const INT0_INT1: u8 = 0b11;

/// An encoder's bits: its channels 1 and 2 on port D, and its interrupt in the registers of INT0 and INT1.
struct Bits {
    channel_1: u8,
    channel_2: u8,
    interrupt: u8,
}

const ENCODER_1: Bits = Bits { channel_1: 1 << 3, channel_2: 1 << 5, interrupt: 1 << 1 };
const ENCODER_2: Bits = Bits { channel_1: 1 << 2, channel_2: 1 << 4, interrupt: 1 << 0 };

/// Longer than a spike.
const SPIKE_CYCLES: u32 = 64;

static FILTERS: Mutex<Cell<[Filter; 2]>> = Mutex::new(Cell::new([Filter::new(); 2]));

/// Turns the pull-ups on. With them, a disconnected encoder reads as still, which is found as a stall.
pub fn pull_up(port: &PORTD) {
    const CHANNELS: u8 = ENCODER_1.channel_1 | ENCODER_1.channel_2 | ENCODER_2.channel_1 | ENCODER_2.channel_2;
    // SAFETY: any value is valid in this register.
    port.portd.modify(|read, write| unsafe { write.bits(read.bits() | CHANNELS) });
}

/// Starts counting, some time after [`pull_up`].
pub fn start(interrupts: &EXINT) {
    let levels = levels();
    interrupt::free(|cs| {
        let [first, second] = within(cs);
        first.start(levels & ENCODER_1.channel_1 != 0);
        second.start(levels & ENCODER_2.channel_1 != 0);
    });
    // SAFETY: any value is valid in these registers.
    unsafe {
        interrupts.eicra.write(|write| write.bits(ANY_EDGE));
        interrupts.eifr.write(|write| write.bits(INT0_INT1));
        interrupts.eimsk.write(|write| write.bits(INT0_INT1));
    }
}

/// Stops counting.
pub fn disable(interrupts: &EXINT) {
    interrupts.eimsk.reset();
}

/// Returns the edges up to now, and turns the interrupts of noisy encoders on again.
pub fn take() -> [Edges; 2] {
    // One after the other, because an interrupt that waits dates its edge late.
    let edges = [
        interrupt::free(|cs| within(cs)[0].take(clock::now_within(cs), clock::counter())),
        interrupt::free(|cs| within(cs)[1].take(clock::now_within(cs), clock::counter())),
    ];
    // SAFETY: any value is valid in the register. An interrupt that turns itself off meanwhile will do so again.
    unsafe { (*EXINT::ptr()).eimsk.write(|write| write.bits(INT0_INT1)) };
    edges
}

/// Takes an edge of an encoder at whose interrupt these were the levels of the port and the clock's counter. Returns whether
/// the encoder is noisy.
#[inline(never)]
fn edge(filter: &mut Filter, mut port: u8, counter: u16, bits: Bits) -> bool {
    // SAFETY: a one clears the flag of this interrupt only.
    let flags = unsafe { &(*EXINT::ptr()).eifr };
    if flags.read().bits() & bits.interrupt != 0 {
        flags.write(|write| unsafe { write.bits(bits.interrupt) });
        // Another edge has come since the interrupt, so that one of the two is that of a spike.
        filter.reject(1);
        port = levels();
    }
    filter.feed(port & bits.channel_1 != 0, counter, || {
        // Channel 2 changes half-way between edges of channel 1, so that a change since then is a spike.
        if (levels() ^ port) & bits.channel_2 != 0 {
            delay_cycles(SPIKE_CYCLES);
            port = levels();
        }
        port & bits.channel_2 != 0
    })
}

/// Returns the filters of both encoders. No caller may keep them when it calls this again.
fn within(cs: CriticalSection<'_>) -> &mut [Filter; 2] {
    // SAFETY: interrupts are off, so that nothing else uses them.
    unsafe { &mut *FILTERS.borrow(cs).as_ptr() }
}

#[inline(always)]
fn levels() -> u8 {
    // SAFETY: the port is only read.
    unsafe { &*PORTD::ptr() }.pind.read().bits()
}

#[avr_device::interrupt(atmega328p)]
fn INT1() {
    // SAFETY: interrupts are off in an interrupt; any value is valid in the register.
    unsafe {
        let (port, counter) = (levels(), clock::counter());
        if edge(&mut within(CriticalSection::new())[0], port, counter, ENCODER_1) {
            (*EXINT::ptr()).eimsk.modify(|_, write| write.int1().clear_bit());
        }
    }
}

#[avr_device::interrupt(atmega328p)]
fn INT0() {
    // SAFETY: as above.
    unsafe {
        let (port, counter) = (levels(), clock::counter());
        if edge(&mut within(CriticalSection::new())[1], port, counter, ENCODER_2) {
            (*EXINT::ptr()).eimsk.modify(|_, write| write.int0().clear_bit());
        }
    }
}
