//! The serial port: its interrupts fill a queue of received bytes and empty a queue of bytes to send.
//!
//! On a full line a byte comes and another goes every 320 cycles: some 300 of both during the work of a tick. So the
//! queues are our own: their indices are bytes, which need no critical sections. Their interrupts are written by hand,
//! because the compiler saves registers that they do not need: they take 57 and 48 cycles; the compiler's took 89 and 64.

use core::arch::global_asm;
use core::sync::atomic::{Ordering, compiler_fence};

use avr_device::atmega328p::USART0;
use avr_device::interrupt;
use firmware::link::{self, OUTBOX};
use protocol::BAUD;
use protocol::units::Micros;

use super::{CPU_HZ, clock};

/// Size of the inbox, a power of two: the longest request and a short one, which may come during a tick.
const INBOX: u8 = 64;

/// With U2X the rate is the crystal's frequency / 8 / (DIVIDER + 1).
const DIVIDER: u16 = (CPU_HZ / 8 / BAUD) as u16 - 1;
const _: () = assert!(CPU_HZ == 8 * BAUD * (DIVIDER as u32 + 1), "the rate is not exact");

/// The interrupts' registers: those below 0x40 in the space of input and output, the others in the memory (section 31).
pub const SREG: u8 = 0x3F;
/// GPIOR2: room for a register in the hand-written interrupts, none of which interrupts another.
pub const SCRATCH: u8 = 0x2B;
const UDR0: u8 = 0xC6;
const UCSR0B: u8 = 0xC1;
const UDRIE: u8 = 1 << 5;

static mut RECEIVED: [u8; INBOX as usize] = [0; INBOX as usize];
/// Where the next received byte goes; only the interrupt writes it.
static mut HEAD: u8 = 0;
/// Where the next byte for main is; only main writes it.
static mut TAIL: u8 = 0;
/// Free places that a byte other than a delimiter must leave: one, or all after a byte of its frame found no room; only
/// the interrupt uses it.
static mut RESERVE: u8 = 1;
/// The clock's counter at the end of the last frame; the interrupt writes it.
static mut FRAME_END: u16 = 0;

static mut TO_SEND: [u8; OUTBOX as usize] = [0; OUTBOX as usize];
/// Where the next byte of main goes; only main writes it.
static mut SEND_HEAD: u8 = 0;
/// Where the next byte to send is; only the interrupt writes it.
static mut SEND_TAIL: u8 = 0;

/// Main's end of the received bytes.
pub struct Inbox(());

impl Inbox {
    /// Takes the next received byte.
    pub fn dequeue(&mut self) -> Option<u8> {
        if !self.ready() {
            return None;
        }
        // SAFETY: only main writes TAIL, and the interrupt does not write to this place before TAIL has passed it.
        unsafe {
            let tail = TAIL;
            let byte = (&raw const RECEIVED).cast::<u8>().add(usize::from(tail)).read_volatile();
            (&raw mut TAIL).write_volatile((tail + 1) % INBOX);
            Some(byte)
        }
    }

    /// Returns whether there is a received byte.
    pub fn ready(&self) -> bool {
        // SAFETY: reading a byte is one instruction.
        unsafe { (&raw const HEAD).read_volatile() != TAIL }
    }
}

/// Main's end of the bytes to send.
pub struct Outbox(());

impl link::Outbox for Outbox {
    fn room(&self) -> u8 {
        // SAFETY: reading a byte is one instruction.
        let (head, tail) = unsafe { (SEND_HEAD, (&raw const SEND_TAIL).read_volatile()) };
        // One place stays empty.
        if tail > head { tail - head - 1 } else { OUTBOX - 1 - (head - tail) }
    }

    fn add(&mut self, bytes: &[u8]) {
        // SAFETY: only main writes SEND_HEAD, and the interrupt does not read these places before SEND_HEAD has passed them.
        unsafe {
            let head = SEND_HEAD;
            let (first, rest) = bytes.split_at_checked(usize::from(OUTBOX - head)).unwrap_or((bytes, &[]));
            let places = (&raw mut TO_SEND).cast::<u8>();
            places.add(usize::from(head)).copy_from_nonoverlapping(first.as_ptr(), first.len());
            places.copy_from_nonoverlapping(rest.as_ptr(), rest.len());
            // The interrupt must not see the new head before the bytes.
            compiler_fence(Ordering::Release);
            let end = usize::from(head) + bytes.len();
            let head = if end < usize::from(OUTBOX) { end } else { end - usize::from(OUTBOX) } as u8;
            (&raw mut SEND_HEAD).write_volatile(head);
        }
    }
}

/// Starts the port; returns main's ends of the queues.
///
/// # Safety
/// Only once, and with interrupts off.
pub unsafe fn start(usart: &USART0) -> (Inbox, Outbox) {
    usart.ucsr0a.write(|write| write.u2x0().set_bit());
    usart.ubrr0.write(|write| write.bits(DIVIDER));
    usart.ucsr0c.write(|write| write.ucsz0().chr8());
    usart.ucsr0b.write(|write| write.rxcie0().set_bit().rxen0().set_bit().txen0().set_bit());
    (Inbox(()), Outbox(()))
}

/// Stops the port.
pub fn disable(usart: &USART0) {
    usart.ucsr0b.reset();
}

/// Sends the content of the outbox.
pub fn send() {
    // The interrupt turns itself off when the queue is empty; if that happens between read and write, it finds the queue
    // empty again.
    // SAFETY: see above.
    unsafe { &*USART0::ptr() }.ucsr0b.modify(|_, write| write.udrie0().set_bit());
}

/// Returns the time at which the last frame from the host ended, if that was less than 32 ms ago.
pub fn frame_end() -> Micros {
    // SAFETY: interrupts are off, so that the interrupt does not write meanwhile.
    interrupt::free(|cs| clock::time_of(cs, unsafe { (&raw const FRAME_END).read_volatile() }))
}

// The interrupt of a received byte. If a byte finds too little room, its frame is dropped to the end; the frames before and
// after it stay whole. The part of it in the inbox is damaged on purpose, which its CRC reveals: it may be a command that
// lacks only its delimiter, if the dropped bytes were the frame after it. The last place is for its delimiter: otherwise the
// delimiter of the next frame would complete a command whose time has passed.
global_asm!(
    ".global __vector_18",
    "__vector_18:",
    "out {scratch}, r24",
    "in r24, {sreg}",
    "push r24",
    "push r25",
    "lds r25, {udr0}",
    "lds r24, {reserve}",
    "cpi r24, 0xFF",
    "breq 6f",
    "7:",
    "push r30",
    "push r31",
    "mov r31, r24",
    "lds r30, {head}",
    // The free places; one always stays empty.
    "lds r24, {tail}",
    "sub r24, r30",
    "dec r24",
    "andi r24, {mask}",
    "tst r25",
    "breq 2f",
    "cp r31, r24",
    "brcc 3f",
    "1:",
    "ldi r31, 0",
    "subi r30, lo8(-({received}))",
    "sbci r31, hi8(-({received}))",
    "st Z, r25",
    "subi r30, lo8({received} - 1)",
    "andi r30, {mask}",
    "sts {head}, r30",
    "4:",
    "pop r31",
    "pop r30",
    "8:",
    "pop r25",
    "pop r24",
    "out {sreg}, r24",
    "in r24, {scratch}",
    "reti",
    // A byte of a dropped frame. This path is short, because most bytes of a flood take it.
    "6:",
    "tst r25",
    "breq 7b",
    "rjmp 8b",
    // The end of a frame.
    "2:",
    "ldi r31, 1",
    "sts {reserve}, r31",
    "lds r31, {tcnt1l}",
    "sts {frame_end}, r31",
    "lds r31, {tcnt1h}",
    "sts {frame_end} + 1, r31",
    "tst r24",
    "brne 1b",
    "rjmp 4b",
    // Too little room, for the first time in this frame: changes its last byte in the inbox, if there is one, to
    // another value that is not a delimiter.
    "3:",
    "ldi r31, 0xFF",
    "sts {reserve}, r31",
    "dec r30",
    "andi r30, {mask}",
    "ldi r31, 0",
    "subi r30, lo8(-({received}))",
    "sbci r31, hi8(-({received}))",
    "ld r24, Z",
    "tst r24",
    "breq 4b",
    "inc r24",
    "brne 5f",
    "inc r24",
    "5:",
    "st Z, r24",
    "rjmp 4b",
    sreg = const SREG,
    scratch = const SCRATCH,
    udr0 = const UDR0,
    tcnt1l = const clock::TCNT1L,
    tcnt1h = const clock::TCNT1L + 1,
    mask = const INBOX - 1,
    received = sym RECEIVED,
    head = sym HEAD,
    tail = sym TAIL,
    reserve = sym RESERVE,
    frame_end = sym FRAME_END,
);

// The interrupt when there is room for a byte to send.
global_asm!(
    ".global __vector_19",
    "__vector_19:",
    "out {scratch}, r24",
    "in r24, {sreg}",
    "push r24",
    "push r30",
    "push r31",
    "lds r30, {tail}",
    "lds r24, {head}",
    "cp r30, r24",
    "breq 2f",
    "ldi r31, 0",
    "subi r30, lo8(-({to_send}))",
    "sbci r31, hi8(-({to_send}))",
    "ld r24, Z",
    "sts {udr0}, r24",
    "subi r30, lo8({to_send} - 1)",
    "cpi r30, {size}",
    "brne 1f",
    "ldi r30, 0",
    "1:",
    "sts {tail}, r30",
    "3:",
    "pop r31",
    "pop r30",
    "pop r24",
    "out {sreg}, r24",
    "in r24, {scratch}",
    "reti",
    // Nothing is left: off.
    "2:",
    "lds r24, {ucsr0b}",
    "andi r24, {without_udrie}",
    "sts {ucsr0b}, r24",
    "rjmp 3b",
    sreg = const SREG,
    scratch = const SCRATCH,
    udr0 = const UDR0,
    ucsr0b = const UCSR0B,
    without_udrie = const !UDRIE & 0xFF,
    size = const OUTBOX,
    to_send = sym TO_SEND,
    head = sym SEND_HEAD,
    tail = sym SEND_TAIL,
);
