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
    use protocol::units::Micros;

    use crate::board::eeprom::Eeprom;
    use crate::board::outputs::{Pin, Pwm};
    use crate::board::serial::{Inbox, Outbox};
    use crate::board::supply::SupplyMonitor;
    use crate::board::twi::Twi;
    use crate::board::{clock, crash, encoders, outputs, reset_registers, serial, stack, test_point};

    // avr-libc instead of compiler_builtins: its f32 arithmetic is five times as fast, its memcpy a twentieth of the size.
    #[link(name = "m")]
    #[link(name = "c")]
    unsafe extern "C" {}

    /// Identifies this image to the host, in the file or in flash: 16 letters, the first four bytes of the commit in
    /// hexadecimal, `+` if there are uncommitted changes and a space if not, and the protocol's version as a byte.
    #[unsafe(link_section = ".progmem.data")]
    static MARKER: [u8; 26] = marker();

    /// Not on the stack, where each access beyond 63 bytes takes five more instructions.
    static mut APP: MaybeUninit<Firmware> = MaybeUninit::uninit();

    const HASH: &[u8; 8] = match env!("BIFLAG_GIT_HASH").as_bytes().first_chunk() {
        Some(digits) => digits,
        None => panic!("the hash of a commit has eight digits"),
    };

    const BUILD: Build = Build {
        git_hash: hash_bytes(),
        git_dirty: matches!(env!("BIFLAG_GIT_DIRTY").as_bytes(), b"1"),
        ram_left: stack::ram_left,
    };

    type Firmware = App<Twi, Pin, Pwm, Eeprom>;

    #[avr_device::entry]
    fn main() -> ! {
        // SAFETY: this is the only place that takes the peripherals. `take` would refuse after a start by a jump.
        let peripherals = unsafe { Peripherals::steal() };
        let mcusr = crash::take_reset_flags(&peripherals.CPU);
        reset_registers(&peripherals);
        // Without a use, the linker drops it.
        core::hint::black_box(&raw const MARKER);
        let hang = crash::take_hang(&peripherals.CPU);
        // SAFETY: this runs once, and interrupts are off.
        let (inbox, outbox) = unsafe { serial::start(&peripherals.USART0) };
        encoders::pull_up(&peripherals.PORTD);
        make_app();
        // SAFETY: `make_app` has made it, and only this function uses it.
        let app = unsafe { (*(&raw mut APP)).assume_init_mut() };
        app.start(Start { hang, mcusr, cut_off: crash::was_driven() });
        encoders::start(&peripherals.EXINT);
        clock::start(&peripherals.TC1);
        clock::enable_sleep(&peripherals.CPU);
        crash::start_watchdog(&peripherals.WDT);
        // SAFETY: everything that interrupts use is set up.
        unsafe { interrupt::enable() };
        run(app, inbox, outbox, SupplyMonitor::new(peripherals.ADC))
    }

    /// Makes the application. A separate function, so that nothing else is called from its large frame.
    #[inline(never)]
    fn make_app() {
        // SAFETY: called once, from `main`, which does not use these peripherals.
        let Peripherals { TC0, TC2, PORTB, PORTC, PORTD, TWI, EEPROM, .. } = unsafe { Peripherals::steal() };
        let motors = outputs::motors((TC0, TC2), (PORTB, PORTD));
        let app = App::new(Twi::new(TWI, PORTC), motors, Eeprom::new(EEPROM), BUILD);
        // SAFETY: nothing else uses the place yet.
        unsafe { (*(&raw mut APP)).write(app) };
    }

    fn run(app: &mut Firmware, mut inbox: Inbox, mut outbox: Outbox, mut supply: SupplyMonitor) -> ! {
        loop {
            app.watch_link(clock::now());
            let due = clock::take_due();
            if due > 0 {
                // Edges first, so that none of them is later than the tick.
                let edges = encoders::take(app.counts_edges());
                let tick = Tick { time: clock::now(), missed: due - 1, edges, bandgap_counts: supply.poll() };
                app.tick(&tick, &mut outbox, test_point::mark);
                app.after_tick(&mut outbox);
                crash::feed_watchdog();
            } else if inbox.ready() {
                // To the end of a frame at once: a check of clock and tick between any two bytes would take longer than
                // the bytes.
                while let Some(byte) = inbox.dequeue() {
                    if byte == 0 {
                        app.receive(byte, serial::frame_end(), &mut outbox);
                        break;
                    }
                    app.receive(byte, Micros(0), &mut outbox);
                }
            } else {
                clock::sleep_unless(|| inbox.ready());
                continue;
            }
            // At once: a motor that starts may pull the supply down.
            crash::keep(app.is_driven(), app.is_logging());
            serial::send();
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
