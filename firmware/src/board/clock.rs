//! Timer 1: the clock, in steps of 0.5 µs, and the tick.

use core::cell::Cell;

use avr_device::atmega328p::{CPU, TC1};
use avr_device::interrupt::{self, CriticalSection, Mutex};
use protocol::TICK_HZ;
use protocol::units::Micros;

use super::CPU_HZ;

/// 16 MHz / 8: two counts per µs.
const DIV_8: u8 = 0b010;
const COUNTS_PER_TICK: u16 = (CPU_HZ / 8 / TICK_HZ as u32) as u16;

/// Memory addresses of the registers for the hand-written interrupts (section 31).
pub const TIMSK1: u8 = 0x6F;
pub const TCNT1L: u8 = 0x84;
pub const OCR1BL: u8 = 0x8A;
/// Address in the space of input and output.
pub const TIFR1: u8 = 0x16;
/// The flag of the alarm in TIFR1, which the clock also raises when the alarm is off.
pub const ALARM_FLAG: u8 = 1 << 2;
/// TIMSK1 with the interrupts of overflow and tick, without and with the alarm's.
pub const WITHOUT_ALARM: u8 = 0b011;
pub const WITH_ALARM: u8 = 0b111;

/// The time at which the counter was last zero, µs.
static BASE: Mutex<Cell<u32>> = Mutex::new(Cell::new(0));
/// The counter wraps after this many µs.
const WRAP_US: u32 = 0x8000;
/// Ticks that are due and not yet taken.
static DUE: Mutex<Cell<u8>> = Mutex::new(Cell::new(0));

/// Starts the clock and the tick.
pub fn start(timer: &TC1) {
    // SAFETY: any value is valid in these registers.
    unsafe {
        timer.tccr1a.write(|write| write.bits(0));
        timer.tcnt1.write(|write| write.bits(0));
        timer.ocr1a.write(|write| write.bits(COUNTS_PER_TICK));
        timer.tifr1.write(|write| write.bits(0xFF));
        timer.timsk1.write(|write| write.bits(WITHOUT_ALARM));
        timer.tccr1b.write(|write| write.bits(DIV_8));
    }
}

/// Allows the sleep of [`sleep_unless`]: idle mode, which stops the processor only (section 9.3).
pub fn enable_sleep(cpu: &CPU) {
    cpu.smcr.write(|write| write.se().set_bit());
}

/// Stops the clock and the tick.
pub fn disable(timer: &TC1) {
    timer.timsk1.reset();
    timer.tccr1b.reset();
}

/// Returns the time.
pub fn now() -> Micros {
    interrupt::free(now_within)
}

/// Returns the time. Interrupts are off.
#[inline(never)]
pub fn now_within(cs: CriticalSection) -> Micros {
    // SAFETY: only reads, and both bytes of the counter with interrupts off, because they share a buffer with those of
    // the compare register.
    let timer = unsafe { &*TC1::ptr() };
    let counter = timer.tcnt1.read().bits();
    let mut base = BASE.borrow(cs).get();
    // An overflow whose interrupt has not run yet, unless it came after the counter was read.
    if counter < 0x8000 && timer.tifr1.read().tov1().bit_is_set() {
        base = base.wrapping_add(WRAP_US);
    }
    Micros(base | u32::from(counter >> 1))
}

/// Returns the counter, which wraps every 32.768 ms, for [`time_of`]. Interrupts are off.
#[inline(always)]
pub fn counter() -> u16 {
    // SAFETY: only reads; as in `now_within`.
    unsafe { &*TC1::ptr() }.tcnt1.read().bits()
}

/// Turns on the interrupt `TIMER1_COMPB` at the count `counter`, which is some µs ahead. Interrupts are off.
#[inline(always)]
pub fn alarm(counter: u16) {
    // SAFETY: interrupts are off; any value is valid in these registers.
    unsafe {
        let timer = &*TC1::ptr();
        timer.ocr1b.write(|write| write.bits(counter));
        timer.tifr1.write(|write| write.bits(ALARM_FLAG));
        timer.timsk1.write(|write| write.bits(WITH_ALARM));
    }
}

/// Turns the interrupt of [`alarm`] off; the others of the clock are on. Interrupts are off.
#[inline(always)]
pub fn alarm_off() {
    // SAFETY: as in `alarm`.
    unsafe { (*TC1::ptr()).timsk1.write(|write| write.bits(WITHOUT_ALARM)) };
}

/// Returns the time at which the counter was `counter`, less than a wrap ago.
pub fn time_of(cs: CriticalSection, counter_then: u16) -> Micros {
    let elapsed = counter().wrapping_sub(counter_then) >> 1;
    Micros(now_within(cs).0.wrapping_sub(u32::from(elapsed)))
}

/// Returns the number of ticks that have become due since the last call.
pub fn take_due() -> u8 {
    interrupt::free(|cs| DUE.borrow(cs).take())
}

/// Sleeps until the next interrupt, unless a tick is due or `is_awake` returns true.
pub fn sleep_unless(is_awake: impl FnOnce() -> bool) {
    interrupt::disable();
    // SAFETY: this is the place between two pieces of work, called with interrupts on and outside of any critical section.
    let cs = unsafe { CriticalSection::new() };
    if DUE.borrow(cs).get() != 0 || is_awake() {
        // SAFETY: as above.
        unsafe { interrupt::enable() };
    } else {
        // The instruction after SEI runs before any interrupt, so an interrupt that comes now ends the sleep.
        // SAFETY: idle mode stops the processor only.
        unsafe { core::arch::asm!("sei", "sleep") };
    }
}

#[avr_device::interrupt(atmega328p)]
fn TIMER1_OVF() {
    // SAFETY: interrupts are off in an interrupt.
    let cs = unsafe { CriticalSection::new() };
    let base = BASE.borrow(cs);
    base.set(base.get().wrapping_add(WRAP_US));
}

#[avr_device::interrupt(atmega328p)]
fn TIMER1_COMPA() {
    // SAFETY: interrupts are off in an interrupt, and only here and at the start is the register written.
    let (cs, timer) = unsafe { (CriticalSection::new(), &*TC1::ptr()) };
    timer.ocr1a.modify(|read, write| write.bits(read.bits().wrapping_add(COUNTS_PER_TICK)));
    let due = DUE.borrow(cs);
    due.set(due.get().saturating_add(1));
}
