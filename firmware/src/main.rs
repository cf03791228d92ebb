//! The image for the ATmega328P: the board, the application, and the loop that joins them.

#![cfg_attr(target_arch = "avr", no_std, no_main)]
#![cfg_attr(target_arch = "avr", feature(abi_avr_interrupt, asm_experimental_arch))]

#[cfg(target_arch = "avr")]
mod board;

#[cfg(target_arch = "avr")]
mod nano {
    use core::mem::MaybeUninit;

    use avr_device::atmega328p::Peripherals;
    use avr_device::interrupt;
    use firmware::app::{App, Build, Start, Tick};
    use firmware::link::Outbox;

    use crate::board::eeprom::Eeprom;
    use crate::board::outputs::{Pin, Pwm};
    use crate::board::serial::Inbox;
    use crate::board::supply::SupplyMonitor;
    use crate::board::twi::Twi;
    use crate::board::{clock, crash, encoders, outputs, reset_registers, serial, test_point};

    // avr-libc instead of compiler_builtins: its f32 arithmetic is five times as fast, its memcpy a twentieth of the size.
    #[link(name = "m")]
    #[link(name = "c")]
    unsafe extern "C" {}

    /// Identifies this image to the host, in the file or in flash: 16 letters, the first four bytes of the commit in
    /// hexadecimal, `+` with or a space without uncommitted changes, and the protocol's version as a byte.
    #[unsafe(link_section = ".progmem.data")]
    static MARKER: [u8; 26] = marker();

    /// Not on the stack, where each access beyond 63 bytes takes five more instructions.
    static mut APP: MaybeUninit<App<Twi, Pin, Pwm, Eeprom>> = MaybeUninit::uninit();

    const HASH: &[u8; 8] = match env!("BIFLAG_GIT_HASH").as_bytes().first_chunk() {
        Some(digits) => digits,
        None => panic!("the hash of a commit has eight digits"),
    };

    const BUILD: Build =
        Build { git_hash: hash_bytes(), git_dirty: matches!(env!("BIFLAG_GIT_DIRTY").as_bytes(), b"1") };

    #[avr_device::entry]
    fn main() -> ! {
        // SAFETY: interrupts are off, and this is the only call.
        let (inbox, outbox, supply) = unsafe { set_up() };
        // SAFETY: `set_up` has made it, and only this loop uses it.
        let app = unsafe { (*(&raw mut APP)).assume_init_mut() };
        run(app, inbox, outbox, supply)
    }

    /// Sets up everything, the interrupts last. A function of its own, so that the loop has a short stack.
    ///
    /// # Safety
    /// Only once, and with interrupts off.
    #[inline(never)]
    unsafe fn set_up() -> (Inbox, Outbox<'static>, SupplyMonitor) {
        // SAFETY: this is the only place that takes the peripherals. `take` would refuse after a start by a jump.
        let peripherals = unsafe { Peripherals::steal() };
        let mcusr = crash::take_reset_flags(&peripherals.CPU);
        reset_registers(&peripherals);
        // Without a use, the linker drops it.
        core::hint::black_box(&raw const MARKER);
        let crash = crash::take_record(&peripherals.CPU);
        let start = Start { crash, program_counter: crash::program_counter(crash), mcusr };

        // SAFETY: this runs once, and interrupts are off.
        let (inbox, outbox) = unsafe { serial::start(&peripherals.USART0) };
        encoders::start(&peripherals.EXINT, &peripherals.PORTD);
        let motors = outputs::motors((peripherals.TC0, peripherals.TC2), (peripherals.PORTB, peripherals.PORTD));
        let bus = Twi::new(peripherals.TWI, peripherals.PORTC);
        // SAFETY: nothing else uses the place yet.
        let app = unsafe { (*(&raw mut APP)).write(App::new(bus, motors, Eeprom::new(peripherals.EEPROM), BUILD)) };
        app.start(start);

        clock::start(&peripherals.TC1);
        clock::enable_sleep(&peripherals.CPU);
        crash::start_watchdog(&peripherals.WDT);
        // SAFETY: everything that interrupts use is set up.
        unsafe { interrupt::enable() };
        (inbox, outbox, SupplyMonitor::new(peripherals.ADC))
    }

    fn run(
        app: &mut App<Twi, Pin, Pwm, Eeprom>,
        mut inbox: Inbox,
        mut outbox: Outbox<'static>,
        mut supply: SupplyMonitor,
    ) -> ! {
        loop {
            app.watch_link(clock::now());
            let due = clock::take_due();
            if due > 0 {
                // Edges first, so that none of them is later than the tick.
                let edges = encoders::edges();
                let tick = Tick { time: clock::now(), missed: due - 1, edges, bandgap_counts: supply.poll() };
                app.tick(&tick, &mut outbox, test_point::mark);
                app.after_tick(&mut outbox);
                crash::feed_watchdog();
                serial::send();
            } else if let Some(byte) = inbox.dequeue() {
                app.receive(byte, serial::frame_end(), &mut outbox);
                serial::send();
            } else {
                test_point::hang_if_asked();
                clock::sleep_unless(|| inbox.ready());
            }
        }
    }

    const fn hash_bytes() -> [u8; 4] {
        let mut bytes = [0; 4];
        let mut index = 0;
        while index < 8 {
            bytes[index / 2] = bytes[index / 2] << 4 | hex_value(HASH[index]);
            index += 1;
        }
        bytes
    }

    const fn hex_value(digit: u8) -> u8 {
        match digit {
            b'0'..=b'9' => digit - b'0',
            b'a'..=b'f' => digit - b'a' + 10,
            _ => panic!("the hash of a commit is hexadecimal"),
        }
    }

    const fn marker() -> [u8; 26] {
        let mut marker = *b"biflag-firmware:........ .";
        let mut index = 0;
        while index < HASH.len() {
            marker[16 + index] = HASH[index];
            index += 1;
        }
        if BUILD.git_dirty {
            marker[24] = b'+';
        }
        marker[25] = protocol::VERSION;
        marker
    }
}

#[cfg(not(target_arch = "avr"))]
fn main() {
    eprintln!("This program runs on an Arduino Nano: `sh firmware/build.sh` builds the image for it.");
}
