//! The encoders: both edges of channel 1 interrupt, channel 2 gives the direction.

use core::cell::Cell;

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

static EDGES: [Mutex<Cell<Edges>>; 2] = [const { Mutex::new(Cell::new(Edges { count: 0, time: Micros(0) })) }; 2];

/// Starts counting.
pub fn start(interrupts: &EXINT, port: &PORTD) {
    // SAFETY: any value is valid in these registers.
    unsafe {
        // With pull-ups, a disconnected encoder reads as still, which is found as a stall.
        let channels = ENCODER_1.0 | ENCODER_1.1 | ENCODER_2.0 | ENCODER_2.1;
        port.portd().modify(|read, write| write.bits(read.bits() | channels));
        interrupts.eicra().write(|write| write.bits(ANY_EDGE));
        interrupts.eifr().write(|write| write.bits(INT0_INT1));
        interrupts.eimsk().write(|write| write.bits(INT0_INT1));
    }
}

/// Stops counting.
pub fn disable(interrupts: &EXINT) {
    interrupts.eimsk().reset();
}

/// Returns the positions and the times of the last edges.
pub fn edges() -> [Edges; 2] {
    interrupt::free(|cs| [EDGES[0].borrow(cs).get(), EDGES[1].borrow(cs).get()])
}

#[inline(always)]
fn edge(edges: &Mutex<Cell<Edges>>, (channel_1, channel_2): (u8, u8)) {
    // SAFETY: called in interrupts, where interrupts are off; the port is only read.
    let (cs, port) = unsafe { (CriticalSection::new(), PORTD::steal()) };
    let levels = port.pind().read().bits();
    let forwards = (levels & channel_1 != 0) != (levels & channel_2 != 0);
    let edges = edges.borrow(cs);
    let count = edges.get().count.wrapping_add(if forwards { 1 } else { -1 });
    edges.set(Edges { count, time: clock::now_within(cs) });
}

#[avr_device::interrupt(atmega328p)]
fn INT1() {
    edge(&EDGES[0], ENCODER_1);
}

#[avr_device::interrupt(atmega328p)]
fn INT0() {
    edge(&EDGES[1], ENCODER_2);
}
