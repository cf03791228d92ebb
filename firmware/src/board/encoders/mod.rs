//! The encoders: both edges of channel 1 interrupt, channel 2 gives the direction.
//!
//! Motor and encoder usually share a cable, in which each edge of the PWM causes a spike on the encoder's lines. So an
//! interrupt just after such an edge only notes that channel 1 has changed. If it changes back, that was a spike. If
//! not, the edge is taken once the lines are at rest, with the time of the change and the direction that channel 2 then
//! gives: channel 2 changes half-way between edges of channel 1. Nothing waits meanwhile. That interrupt is written by
//! hand and takes some 70 cycles; the compiler's, which takes the edge, takes 300.
//!
//! The chip holds three bytes from the host, which come in 960 cycles. The work on the edges of two encoders takes longer, so
//! all other interrupts are on meanwhile.

use core::arch::asm;
use core::mem::take as replace;

use avr_device::atmega328p::{CPU, EXINT, PORTD, TC1, cpu, exint};
use avr_device::interrupt::{self, CriticalSection};
use firmware::encoder::{Edges, Filter, PWM_SPIKE};

use super::clock;

mod vectors;

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

const BITS: [Bits; 2] = [
    Bits { channel_1: 1 << 3, channel_2: 1 << 5, interrupt: 1 << 1 },
    Bits { channel_1: 1 << 2, channel_2: 1 << 4, interrupt: 1 << 0 },
];

/// Time from an edge of the PWM until the lines are at rest, in counts of the clock: eight for each count of the PWM,
/// and one count of the PWM more.
const REST: u16 = 8 * (PWM_SPIKE as u16 + 1);

/// An encoder. The hand-written interrupt uses the first five fields.
#[repr(C)]
struct Encoder {
    /// Channel 1 after the last edge, as its bit of the port.
    level: u8,
    /// 1 if channel 1 has changed since, by a spike or by an edge.
    has_changed: u8,
    /// The clock's counter at that change.
    changed: u16,
    /// Number of spikes in step with the PWM.
    spikes: u8,
    /// The levels of the port at the last interrupt.
    port: u8,
    bits: Bits,
    filter: Filter,
}

impl Encoder {
    const fn new(bits: Bits) -> Self {
        Self { level: 0, has_changed: 0, changed: 0, spikes: 0, port: 0, bits, filter: Filter::new() }
    }
}

/// Used only with interrupts off.
static mut ENCODERS: [Encoder; 2] = [Encoder::new(BITS[0]), Encoder::new(BITS[1])];

/// Turns the pull-ups on. With them, a disconnected encoder reads as still, so it is found as a stall.
pub fn pull_up(port: &PORTD) {
    const CHANNELS: u8 = BITS[0].channel_1 | BITS[0].channel_2 | BITS[1].channel_1 | BITS[1].channel_2;
    // SAFETY: any value is valid in this register.
    port.portd.modify(|read, write| unsafe { write.bits(read.bits() | CHANNELS) });
}

/// Starts counting, some time after [`pull_up`].
pub fn start(interrupts: &EXINT) {
    let levels = levels();
    interrupt::free(|cs| {
        for encoder in encoders(cs) {
            encoder.level = levels & encoder.bits.channel_1;
            encoder.filter.start(encoder.level != 0);
        }
    });
    // SAFETY: any value is valid in these registers.
    unsafe {
        interrupts.eicra.write(|write| write.bits(ANY_EDGE));
        interrupts.eifr.write(|write| write.bits(INT0_INT1));
    }
    count_with(INT0_INT1);
}

/// Stops counting.
pub fn disable(interrupts: &EXINT) {
    interrupts.eimsk.reset();
}

/// Returns the edges up to now, and turns the interrupts of noisy encoders on again if edges are still counted.
pub fn take(counts: bool) -> [Edges; 2] {
    let edges = [take_of(0), take_of(1)];
    // An interrupt that turns itself off between the two registers will do so again.
    count_with(if counts { INT0_INT1 } else { 0 });
    edges
}

#[inline(never)]
fn take_of(encoder: usize) -> Edges {
    interrupt::free(|cs| {
        let encoder = &mut encoders(cs)[encoder];
        let (now, counter) = (clock::now_within(cs), clock::counter());
        alone(|| encoder.filter.take(now, counter, replace(&mut encoder.spikes)))
    })
}

/// Runs `work` with interrupts on, except those of the encoders. Interrupts are off before and after it.
#[inline(always)]
fn alone<R>(work: impl FnOnce() -> R) -> R {
    // SAFETY: any value is valid in these registers, and only the interrupts that are off here use them. An interrupt of the encoders
    // or main's `take` calls this; neither holds a critical section for more than the encoders.
    unsafe {
        let (mask, alarm) = (&(*EXINT::ptr()).eimsk, &(*TC1::ptr()).timsk1);
        let then = alarm.read().bits();
        mask.write(|write| write.bits(0));
        clock::alarm_off();
        interrupt::enable();
        let result = work();
        interrupt::disable();
        mask.write(|write| write.bits(counting().read().bits()));
        alarm.write(|write| write.bits(then));
        result
    }
}

/// Returns GPIOR1: the interrupts of the encoders that are on, except while [`alone`] works.
#[inline(always)]
fn counting() -> &'static cpu::GPIOR1 {
    // SAFETY: only used with interrupts off, or with those of the encoders.
    unsafe { &(*CPU::ptr()).gpior1 }
}

/// Turns these interrupts of the encoders on, and the others off.
fn count_with(interrupts: u8) {
    // SAFETY: any value is valid in these registers.
    unsafe {
        counting().write(|write| write.bits(interrupts));
        (*EXINT::ptr()).eimsk.write(|write| write.bits(interrupts));
    }
}

/// Takes a change of channel 1 that the PWM did not disturb. `counter`: the clock's counter at its interrupt.
#[inline(never)]
fn edge(encoder: &mut Encoder, counter: u16) {
    let interrupt = encoder.bits.interrupt;
    let mut port = encoder.port;
    if flags().read().bits() & interrupt != 0 {
        port = levels_now(interrupt);
        // Another edge has come since the interrupt, so one of the two belongs to a spike.
        encoder.filter.reject(1);
        if pwm_disturbs() {
            // The PWM has disturbed the lines since the interrupt, so it may have caused the present levels.
            if encoder.has_changed == 0 {
                encoder.has_changed = 1;
                encoder.changed = counter;
            }
            clock::alarm(counter.wrapping_add(REST));
            return;
        }
    }
    settle(encoder, port, counter);
}

/// Takes the level of channel 1 when the PWM does not disturb it. Its change was noted before, or else came when the
/// counter was `counter`.
#[inline(never)]
fn settle(encoder: &mut Encoder, port: u8, mut counter: u16) {
    let Bits { channel_1, channel_2, interrupt } = encoder.bits;
    if replace(&mut encoder.has_changed) != 0 {
        counter = encoder.changed;
        if (port ^ encoder.level) & channel_1 == 0 {
            encoder.spikes = encoder.spikes.saturating_add(1);
            return;
        }
    }
    encoder.level = port & channel_1;
    alone(|| {
        let is_noisy = encoder.filter.feed(encoder.level != 0, port & channel_2 != 0, counter, || {
            // More than 100 cycles after `port`, when a spike that is not in step with the PWM is over.
            let settled = loop {
                let later = levels();
                if !pwm_disturbs() {
                    break later;
                }
                // This encoder's next edge is from a spike by the PWM, or the end of another spike, which would pass
                // for motion at a later time.
                if flags().read().bits() & interrupt != 0 {
                    break port;
                }
            };
            settled & channel_2 != 0
        });
        if is_noisy {
            counting().modify(|read, write| write.bits(read.bits() & !interrupt));
        }
    });
}

/// Takes the changes of channel 1 that were not spikes, or waits on if the PWM disturbs the lines again.
fn look_again(cs: CriticalSection) {
    let port = levels();
    if pwm_disturbs() {
        clock::alarm(clock::counter().wrapping_add(REST / 4));
        return;
    }
    for encoder in encoders(cs) {
        if encoder.has_changed != 0 {
            settle(encoder, port, 0);
        }
    }
}

/// Returns the levels of the port. A later edge of the encoder interrupts.
#[inline(always)]
fn levels_now(interrupt: u8) -> u8 {
    // SAFETY: a one clears the flag of this interrupt only.
    flags().write(|write| unsafe { write.bits(interrupt) });
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
    let carry: u8;
    // SAFETY: this changes the two registers only.
    unsafe {
        asm!("call {since_pwm}", "sbc r24, r24", since_pwm = sym vectors::since_pwm, out("r24") carry, out("r25") _);
    }
    carry != 0
}

/// Returns the encoders. No caller may keep them when it calls this again.
#[inline(always)]
fn encoders(_: CriticalSection<'_>) -> &mut [Encoder; 2] {
    // SAFETY: interrupts are off, so that nothing else uses them.
    unsafe { &mut *(&raw mut ENCODERS) }
}

#[inline(always)]
fn levels() -> u8 {
    // SAFETY: the port is only read.
    unsafe { &*PORTD::ptr() }.pind.read().bits()
}

#[avr_device::interrupt(atmega328p)]
fn TIMER1_COMPB() {
    clock::alarm_off();
    // SAFETY: interrupts are off in an interrupt.
    look_again(unsafe { CriticalSection::new() });
}

extern "avr-interrupt" fn edge_of_1() {
    let counter = clock::counter();
    // SAFETY: interrupts are off in an interrupt.
    edge(&mut encoders(unsafe { CriticalSection::new() })[0], counter);
}

extern "avr-interrupt" fn edge_of_2() {
    let counter = clock::counter();
    // SAFETY: as above.
    edge(&mut encoders(unsafe { CriticalSection::new() })[1], counter);
}
