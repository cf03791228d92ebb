//! The serial port: its interrupts fill a queue of received bytes and empty a queue of bytes to send.
//!
//! At a full line a byte comes and another goes every 320 cycles, so the queues are our own: their indices are bytes, which
//! need no critical sections, and the interrupts take half the time of those with `heapless::spsc`.

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

static mut RECEIVED: [u8; INBOX as usize] = [0; INBOX as usize];
/// Where the next received byte goes; only the interrupt writes it.
static mut HEAD: u8 = 0;
/// Where the next byte for main is; only main writes it.
static mut TAIL: u8 = 0;
/// Whether the rest of a frame is dropped, because a byte of it found no room; only the interrupt uses it.
static mut DROPPING: bool = false;
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
            let mut head = SEND_HEAD;
            for byte in bytes {
                (&raw mut TO_SEND).cast::<u8>().add(usize::from(head)).write_volatile(*byte);
                head = after(head);
            }
            (&raw mut SEND_HEAD).write_volatile(head);
        }
    }
}

/// Returns the place of the outbox after this one.
#[inline(always)]
fn after(place: u8) -> u8 {
    if place == OUTBOX - 1 { 0 } else { place + 1 }
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

/// Sends what is in the outbox.
pub fn send() {
    // The interrupt turns itself off when the queue is empty; if that happens between read and write, it finds the queue
    // empty again.
    // SAFETY: see above.
    unsafe { &*USART0::ptr() }.ucsr0b.modify(|_, write| write.udrie0().set_bit());
}

/// Returns the time at which the last frame from the host ended, if that was less than 32 ms ago.
pub fn frame_end() -> Micros {
    // SAFETY: interrupts are off, so that the interrupt does not write meanwhile.
    interrupt::free(|cs| clock::time_of(cs, unsafe { FRAME_END }))
}

#[avr_device::interrupt(atmega328p)]
fn USART_RX() {
    // SAFETY: interrupts are off in an interrupt; see the variables for who writes them.
    unsafe {
        let byte = (*USART0::ptr()).udr0.read().bits();
        if byte == 0 {
            FRAME_END = clock::counter();
            DROPPING = false;
        }
        if DROPPING {
            return;
        }
        let head = HEAD;
        // One place stays empty.
        let room = (&raw const TAIL).read_volatile().wrapping_sub(head).wrapping_sub(1) % INBOX;
        // A frame without room is dropped to its end, which leaves the frames before and after it whole. What of it is in
        // the inbox is damaged, which its CRC reveals. The last place is for its delimiter: otherwise that of the next frame
        // would complete an order whose time has passed.
        if room < 1 + u8::from(byte != 0) {
            DROPPING = byte != 0;
            return;
        }
        (&raw mut RECEIVED).cast::<u8>().add(usize::from(head)).write_volatile(byte);
        (&raw mut HEAD).write_volatile((head + 1) % INBOX);
    }
}

#[avr_device::interrupt(atmega328p)]
fn USART_UDRE() {
    // SAFETY: interrupts are off in an interrupt; see the variables for who writes them.
    unsafe {
        let (usart, tail) = (&*USART0::ptr(), SEND_TAIL);
        if tail == (&raw const SEND_HEAD).read_volatile() {
            usart.ucsr0b.modify(|_, write| write.udrie0().clear_bit());
            return;
        }
        let byte = (&raw const TO_SEND).cast::<u8>().add(usize::from(tail)).read_volatile();
        usart.udr0.write(|write| write.bits(byte));
        (&raw mut SEND_TAIL).write_volatile(after(tail));
    }
}
