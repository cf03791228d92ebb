//! The serial port, with a queue of bytes either way that its interrupts fill and empty.

use core::cell::{Cell, UnsafeCell};

use avr_device::atmega328p::USART0;
use avr_device::interrupt::{self, CriticalSection, Mutex};
use firmware::link::{OUTBOX, Outbox};
use heapless::spsc::{Consumer, Producer, Queue};
use protocol::BAUD;
use protocol::units::Micros;

use super::{CPU_HZ, clock};

/// The longest request and a short one, as they may come in during a tick.
const INBOX: usize = 64;

/// With U2X the line runs at the crystal's frequency by 8 and by this, plus one.
const DIVIDER: u16 = (CPU_HZ / 8 / BAUD) as u16 - 1;
const _: () = assert!(CPU_HZ == 8 * BAUD * (DIVIDER as u32 + 1), "the rate is not exact");

/// A place that main and one interrupt share by the rules of the queue in it: one end each.
struct Shared<T>(UnsafeCell<T>);

// SAFETY: the cells are filled by `start`, before interrupts are on; afterwards each is used by one interrupt alone.
unsafe impl<T> Sync for Shared<T> {}

static INBOX_QUEUE: Shared<Queue<u8, INBOX>> = Shared(UnsafeCell::new(Queue::new()));
static OUTBOX_QUEUE: Shared<Queue<u8, OUTBOX>> = Shared(UnsafeCell::new(Queue::new()));
static RECEIVED: Shared<Option<Producer<'static, u8, INBOX>>> = Shared(UnsafeCell::new(None));
static TO_SEND: Shared<Option<Consumer<'static, u8, OUTBOX>>> = Shared(UnsafeCell::new(None));
static FRAME_END: Mutex<Cell<Micros>> = Mutex::new(Cell::new(Micros(0)));

/// What the host sent.
pub type Inbox = Consumer<'static, u8, INBOX>;

/// Starts the port. Answers main's ends of the queues.
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

/// Stops it.
pub fn disable(usart: &USART0) {
    usart.ucsr0b().reset();
}

/// Sends what is in the outbox.
pub fn send() {
    // The interrupt turns itself off when the queue is empty; should that come between read and write, it finds the queue
    // empty once more.
    // SAFETY: see above.
    unsafe { USART0::steal() }.ucsr0b().modify(|_, write| write.udrie0().set_bit());
}

/// When the last frame from the host ended.
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
    if let Some(queue) = received {
        // A byte too many is lost, and its frame's CRC tells.
        queue.enqueue(byte).ok();
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
