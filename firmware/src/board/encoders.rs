//! The encoders: both edges of channel 1 interrupt, channel 2 gives the direction.
//!
//! Motor and encoder usually share a cable, where each edge of the PWM is a spike on the encoder's lines. So an interrupt just
//! after such an edge reads the lines when the spike is over.

use core::cell::Cell;

use avr_device::asm::delay_cycles;
use avr_device::atmega328p::{EXINT, PORTD, TC0, TC2, exint};
use avr_device::interrupt::{self, CriticalSection, Mutex};
use firmware::encoder::{Edges, Filter, is_by_pwm};

use super::clock;

/// INT0 and INT1 at any edge (section 13.2.1).
const ANY_EDGE: u8 = 0b0101;
const INT0_INT1: u8 = 0b11;

/// An encoder's bits: its channels 1 and 2 on port D, and its interrupt in the registers of INT0 and INT1.
#[derive(Clone, Copy)]
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
        filter(cs, 0).start(levels & ENCODER_1.channel_1 != 0);
        filter(cs, 1).start(levels & ENCODER_2.channel_1 != 0);
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
        interrupt::free(|cs| filter(cs, 0).take(clock::now_within(cs), clock::counter())),
        interrupt::free(|cs| filter(cs, 1).take(clock::now_within(cs), clock::counter())),
    ];
    // SAFETY: any value is valid in the register. An interrupt that turns itself off meanwhile will do so again.
    unsafe { (*EXINT::ptr()).eimsk.write(|write| write.bits(INT0_INT1)) };
    edges
}

/// Takes an edge of an encoder at whose interrupt these were the levels of the port and the clock's counter. Returns whether
/// the encoder is noisy.
#[inline(never)]
fn edge(filter: &mut Filter, mut port: u8, counter: u16, bits: Bits) -> bool {
    if pwm_disturbs() {
        port = undisturbed(filter.level(), bits);
        if filter.level() == (port & bits.channel_1 != 0) {
            filter.reject_by_pwm();
            return false;
        }
    } else if flags().read().bits() & bits.interrupt != 0 {
        port = levels_now(bits);
        // Another edge has come since the interrupt, so that one of the two is that of a spike.
        filter.reject(1);
    }
    filter.feed(port & bits.channel_1 != 0, counter, || {
        // Channel 2 changes half-way between edges of channel 1, so that a change since then is a spike.
        if (levels() ^ port) & bits.channel_2 != 0 {
            delay_cycles(SPIKE_CYCLES);
            while pwm_disturbs() {}
            port = levels();
        }
        port & bits.channel_2 != 0
    })
}

/// Returns the levels of the port at the end of a spike, when channel 1 is at `level` again, or at the end of the time in which
/// there may be one.
#[inline(never)]
fn undisturbed(level: bool, bits: Bits) -> u8 {
    let mut port = levels_now(bits);
    // Another interrupt may last into the next spike.
    while level != (port & bits.channel_1 != 0) && pwm_disturbs() {
        with_others(bits.interrupt, || {
            while level != (port & bits.channel_1 != 0) && pwm_disturbs() {
                port = levels_now(bits);
            }
        });
        port = levels_now(bits);
    }
    port
}

/// Waits in an encoder's interrupt, with the others on: bytes from the host come every 320 cycles, and an interrupt of the other
/// encoder that waits dates its edge late.
#[inline(always)]
fn with_others(own: u8, wait: impl FnOnce()) {
    // SAFETY: any value is valid in the register. With its own interrupt off, nothing else uses this encoder's filter.
    unsafe {
        let masks = &(*EXINT::ptr()).eimsk;
        masks.modify(|read, write| write.bits(read.bits() & !own));
        interrupt::enable();
        wait();
        interrupt::disable();
        masks.modify(|read, write| write.bits(read.bits() | own));
    }
}

/// Returns the levels of the port. A later edge of the encoder interrupts.
#[inline(always)]
fn levels_now(bits: Bits) -> u8 {
    // SAFETY: a one clears the flag of this interrupt only.
    flags().write(|write| unsafe { write.bits(bits.interrupt) });
    levels()
}

#[inline(always)]
fn flags() -> &'static exint::EIFR {
    // SAFETY: only the interrupts of the encoders use the register.
    unsafe { &(*EXINT::ptr()).eifr }
}

/// Returns whether the lines may be disturbed, because the voltage at a motor has just changed.
#[inline(always)]
fn pwm_disturbs() -> bool {
    // SAFETY: the registers are only read.
    let (timer0, timer2) = unsafe { (&*TC0::ptr(), &*TC2::ptr()) };
    is_by_pwm(timer0.tcnt0.read().bits(), timer0.ocr0a.read().bits())
        || is_by_pwm(timer2.tcnt2.read().bits(), timer2.ocr2a.read().bits())
}

/// Returns the filter of an encoder. No caller may keep it when it calls this again.
#[inline(always)]
fn filter(cs: CriticalSection<'_>, encoder: usize) -> &mut Filter {
    // SAFETY: interrupts are off, or this encoder's own is, so that nothing else uses it.
    unsafe { &mut *FILTERS.borrow(cs).as_ptr().cast::<Filter>().add(encoder) }
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
        if edge(filter(CriticalSection::new(), 0), port, counter, ENCODER_1) {
            (*EXINT::ptr()).eimsk.modify(|_, write| write.int1().clear_bit());
        }
    }
}

#[avr_device::interrupt(atmega328p)]
fn INT0() {
    // SAFETY: as above.
    unsafe {
        let (port, counter) = (levels(), clock::counter());
        if edge(filter(CriticalSection::new(), 1), port, counter, ENCODER_2) {
            (*EXINT::ptr()).eimsk.modify(|_, write| write.int0().clear_bit());
        }
    }
}
