//! The encoders: both edges of channel 1 interrupt, channel 2 gives the direction.

use core::cell::Cell;

use avr_device::asm::delay_cycles;
use avr_device::atmega328p::{EXINT, PORTD};
use avr_device::interrupt::{self, CriticalSection, Mutex};
use firmware::encoder::Edges;
use protocol::units::Micros;

use super::clock;

/// INT0 and INT1 at any edge (section 13.2.1).
const ANY_EDGE: u8 = 0b0101;
const INT0_INT1: u8 = 0b11;

/// Channels 1 and 2 on port D.
const ENCODER_1: (u8, u8) = (1 << 3, 1 << 5);
const ENCODER_2: (u8, u8) = (1 << 2, 1 << 4);

/// Longer than a spike.
const SPIKE_CYCLES: u32 = 64;

static EDGES: Mutex<Cell<[Edges; 2]>> = Mutex::new(Cell::new([Edges::new(); 2]));

/// Turns the pull-ups on. With them, a disconnected encoder reads as still, which is found as a stall.
pub fn pull_up(port: &PORTD) {
    const CHANNELS: u8 = ENCODER_1.0 | ENCODER_1.1 | ENCODER_2.0 | ENCODER_2.1;
    // SAFETY: any value is valid in this register.
    port.portd.modify(|read, write| unsafe { write.bits(read.bits() | CHANNELS) });
}

/// Starts counting, some time after [`pull_up`].
pub fn start(interrupts: &EXINT) {
    let levels = levels();
    interrupt::free(|cs| {
        let [first, second] = within(cs);
        first.start(levels & ENCODER_1.0 != 0);
        second.start(levels & ENCODER_2.0 != 0);
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
    interrupt::free(|cs| {
        // SAFETY: only here and in the interrupts, which are off, is the register written; any value is valid in it.
        unsafe { (*EXINT::ptr()).eimsk.write(|write| write.bits(INT0_INT1)) };
        let edges = within(cs);
        let taken = *edges;
        edges.iter_mut().for_each(Edges::begin_tick);
        taken
    })
}

/// Takes an edge of an encoder at whose interrupt these were the levels of the port.
#[inline(never)]
fn edge(edges: &mut Edges, mut port: u8, time: Micros, (channel_1, channel_2): (u8, u8)) -> bool {
    // Channel 2 changes half-way between edges of channel 1, so that a change here is a spike.
    if (levels() ^ port) & channel_2 != 0 {
        delay_cycles(SPIKE_CYCLES);
        port = port & !channel_2 | levels() & channel_2;
    }
    edges.feed(port & channel_1 != 0, port & channel_2 != 0, time)
}

/// Returns the edges of both encoders. No caller may keep them when it calls this again.
fn within(cs: CriticalSection<'_>) -> &mut [Edges; 2] {
    // SAFETY: interrupts are off, so that nothing else uses them.
    unsafe { &mut *EDGES.borrow(cs).as_ptr() }
}

#[inline(always)]
fn levels() -> u8 {
    // SAFETY: the port is only read.
    unsafe { &*PORTD::ptr() }.pind.read().bits()
}

#[avr_device::interrupt(atmega328p)]
fn INT1() {
    let port = levels();
    // SAFETY: interrupts are off in an interrupt; any value is valid in the register.
    unsafe {
        let cs = CriticalSection::new();
        if edge(&mut within(cs)[0], port, clock::now_within(cs), ENCODER_1) {
            (*EXINT::ptr()).eimsk.modify(|_, write| write.int1().clear_bit());
        }
    }
}

#[avr_device::interrupt(atmega328p)]
fn INT0() {
    let port = levels();
    // SAFETY: as above.
    unsafe {
        let cs = CriticalSection::new();
        if edge(&mut within(cs)[1], port, clock::now_within(cs), ENCODER_2) {
            (*EXINT::ptr()).eimsk.modify(|_, write| write.int0().clear_bit());
        }
    }
}
