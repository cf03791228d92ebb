//! The serial port: its interrupts fill a queue of received bytes and empty a queue of bytes to send.

use core::cell::{Cell, UnsafeCell};

use avr_device::atmega328p::USART0;
use avr_device::interrupt::{self, CriticalSection, Mutex};
use firmware::link::{OUTBOX, Outbox};
use heapless::spsc::{Consumer, Producer, Queue};
use protocol::BAUD;
use protocol::units::Micros;

use super::{CPU_HZ, clock};

/// Size of the inbox: the longest request and a short one, which may come during a tick.
const INBOX: usize = 64;

/// With U2X the rate is the crystal's frequency / 8 / (DIVIDER + 1).
const DIVIDER: u16 = (CPU_HZ / 8 / BAUD) as u16 - 1;
const _: () = assert!(CPU_HZ == 8 * BAUD * (DIVIDER as u32 + 1), "the rate is not exact");

/// A cell that main and one interrupt share by the rules of its queue: one end each.
struct Shared<T>(UnsafeCell<T>);

// SAFETY: the cells are filled by `start`, before interrupts are on; afterwards each is used by one interrupt alone.
unsafe impl<T> Sync for Shared<T> {}

static INBOX_QUEUE: Shared<Queue<u8, INBOX>> = Shared(UnsafeCell::new(Queue::new()));
static OUTBOX_QUEUE: Shared<Queue<u8, OUTBOX>> = Shared(UnsafeCell::new(Queue::new()));
static RECEIVED: Shared<Option<Producer<'static, u8, INBOX>>> = Shared(UnsafeCell::new(None));
static TO_SEND: Shared<Option<Consumer<'static, u8, OUTBOX>>> = Shared(UnsafeCell::new(None));
/// Whether the rest of a frame is dropped, because a byte of it found no room.
static DROPPING: Mutex<Cell<bool>> = Mutex::new(Cell::new(false));
static FRAME_END: Mutex<Cell<Micros>> = Mutex::new(Cell::new(Micros(0)));

/// Bytes from the host.
pub type Inbox = Consumer<'static, u8, INBOX>;

/// Starts the port; returns main's ends of the queues.
///
/// # Safety
/// Only once, and with interrupts off.
pub unsafe fn start(usart: &USART0) -> (Inbox, Outbox<'static>) {
    // SAFETY: nothing else holds a reference into these cells yet.
    let (inbox, outbox) = unsafe {
        let (producer, inbox) = (*INBOX_QUEUE.0.get()).split();
        *RECEIVED.0.get() = Some(producer);
        let (outbox, consumer) = (*OUTBOX_QUEUE.0.get()).split();
        *TO_SEND.0.get() = Some(consumer);
        (inbox, outbox)
    };
    usart.ucsr0a().write(|write| write.u2x0().set_bit());
    // SAFETY: any value is valid.
    usart.ubrr0().write(|write| unsafe { write.bits(DIVIDER) });
    usart.ucsr0c().write(|write| write.ucsz0().chr8());
    usart.ucsr0b().write(|write| write.rxcie0().set_bit().rxen0().set_bit().txen0().set_bit());
    (inbox, outbox)
}

/// Stops the port.
pub fn disable(usart: &USART0) {
    usart.ucsr0b().reset();
}

/// Sends what is in the outbox.
pub fn send() {
    // The interrupt turns itself off when the queue is empty; if that happens between read and write, it finds the queue
    // empty again.
    // SAFETY: see above.
    unsafe { USART0::steal() }.ucsr0b().modify(|_, write| write.udrie0().set_bit());
}

/// Returns the time at which the last frame from the host ended.
pub fn frame_end() -> Micros {
    interrupt::free(|cs| FRAME_END.borrow(cs).get())
}

#[avr_device::interrupt(atmega328p)]
fn USART_RX() {
    // SAFETY: interrupts are off in an interrupt; only this one uses the cell and reads the register.
    let (cs, usart, received) = unsafe { (CriticalSection::new(), USART0::steal(), &mut *RECEIVED.0.get()) };
    let byte = usart.udr0().read().bits();
    if byte == 0 {
        FRAME_END.borrow(cs).set(clock::now_within(cs));
    }
    let Some(queue) = received else { return };
    // A frame without room is dropped to its end, which leaves the frames before and after it whole. What of it is in the
    // queue is damaged, which its CRC reveals.
    let dropping = DROPPING.borrow(cs);
    if byte == 0 {
        dropping.set(false);
    }
    if !dropping.get() && queue.enqueue(byte).is_err() {
        dropping.set(true);
    }
}

#[avr_device::interrupt(atmega328p)]
fn USART_UDRE() {
    // SAFETY: only this interrupt uses the cell and writes the register.
    let (usart, to_send) = unsafe { (USART0::steal(), &mut *TO_SEND.0.get()) };
    match to_send.as_mut().and_then(Consumer::dequeue) {
        // SAFETY: any value is valid.
        Some(byte) => usart.udr0().write(|write| unsafe { write.bits(byte) }),
        None => usart.ucsr0b().modify(|_, write| write.udrie0().clear_bit()),
    };
}
