//! The chip: a safe interface to the shim over simavr. All of this package's unsafe code is here.
//!
//! An [`Mcu`] owns the devices around it. While it runs it calls them through [`Devices`], each call with the cycle at
//! which it happens; between runs [`Mcu::devices`] gives access to them.

use std::ffi::{c_char, c_int, c_void};

/// Cycles per second.
pub const FREQUENCY_HZ: u64 = 16_000_000;

/// Bytes of flash.
pub const FLASH_BYTES: u32 = 32 * 1024;

/// Registers that determine the chip's outputs to the bridge.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Outputs {
    /// PORTB
    pub port_b: u8,
    /// DDRB
    pub ddr_b: u8,
    /// PORTD
    pub port_d: u8,
    /// DDRD
    pub ddr_d: u8,
    /// TCCR0A
    pub tccr0a: u8,
    /// TCCR0B
    pub tccr0b: u8,
    /// OCR0A
    pub ocr0a: u8,
    /// TCCR2A
    pub tccr2a: u8,
    /// TCCR2B
    pub tccr2b: u8,
    /// OCR2A
    pub ocr2a: u8,
}

/// A device's reaction on SDA after a byte.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BusAnswer {
    /// Pulls it low in the ninth bit.
    Ack,
    /// Releases it.
    Nack,
    /// Keeps it low for good.
    Held,
}

/// Everything outside of the chip. `cycle` counts from the creation of the board and never decreases.
pub trait Devices {
    /// A START, or a repeated one, and the address byte.
    fn bus_address(&mut self, cycle: u64, address: u8) -> BusAnswer;
    /// A byte from the chip.
    fn bus_write(&mut self, cycle: u64, byte: u8) -> BusAnswer;
    /// A byte to the chip; `None` while SDA is held low.
    fn bus_read(&mut self, cycle: u64) -> Option<u8>;
    /// A STOP, or the chip's TWI switched off.
    fn bus_stop(&mut self, cycle: u64);
    /// The chip releases or pulls the lines. Returns whether the devices release SDA.
    fn bus_lines(&mut self, cycle: u64, sda: bool, scl: bool) -> bool;
    /// A byte has left the USART.
    fn serial_out(&mut self, cycle: u64, byte: u8);
    /// The byte that has just arrived at the USART; `None` while the line is quiet.
    fn serial_in(&mut self, cycle: u64) -> Option<u8>;
    /// The bridge's inputs have changed.
    fn outputs(&mut self, cycle: u64, outputs: &Outputs);
    /// The chip was reset, for any reason.
    fn reset(&mut self, cycle: u64);
    /// The program wrote GPIOR0.
    fn mark(&mut self, cycle: u64, value: u8);
    /// Called at the cycle that its last call returned, and once after each reset.
    fn wake(&mut self, cycle: u64, pins: &mut Pins) -> u64;
}

/// Why a run ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RunState {
    /// It reached the requested cycle.
    Running,
    /// The program ran into an opcode or an address that does not exist.
    Crashed,
}

/// The cause of a reset in MCUSR.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ResetCause {
    /// Power came up.
    PowerOn,
    /// The reset pin: the button, or the host opening the port.
    Pin,
}

/// The chip's pins, and the timers behind some of them.
pub struct Pins {
    raw: *mut Raw,
}

impl Pins {
    /// Drives the pins of port `port` ('B' to 'D') in `mask`.
    pub fn set(&mut self, port: char, mask: u8, levels: u8) {
        debug_assert!(('B'..='D').contains(&port));
        // SAFETY: the chip lives for as long as the call that lends this handle; the shim allows this call.
        unsafe { nano_set_pins(self.raw, port as c_char, mask, levels) }
    }

    /// Returns the cycles since the counter of timer 0 or 2 was last zero.
    pub fn timer_phase(&self, timer: u8) -> u64 {
        debug_assert!(timer == 0 || timer == 2);
        // SAFETY: as above.
        unsafe { nano_timer_phase(self.raw, timer.into()) }
    }
}

/// A chip with the devices around it.
pub struct Mcu<D: Devices> {
    raw: *mut Raw,
    // A raw pointer, because the shim holds it too; freed by `drop`.
    devices: *mut D,
}

// SAFETY: a chip shares no state with another, except simavr's logger, which is the same function for all.
unsafe impl<D: Devices + Send> Send for Mcu<D> {}

impl<D: Devices> Mcu<D> {
    /// Returns a chip with this much blank flash. Load it and [`reset`](Self::reset) it before running it.
    pub fn new(devices: D, flash_bytes: u32) -> Result<Self, &'static str> {
        let devices = Box::into_raw(Box::new(devices));
        let table = Table {
            context: devices.cast(),
            bus_address: bus_address::<D>,
            bus_write: bus_write::<D>,
            bus_read: bus_read::<D>,
            bus_stop: bus_stop::<D>,
            bus_lines: bus_lines::<D>,
            serial_out: serial_out::<D>,
            serial_in: serial_in::<D>,
            outputs: outputs::<D>,
            reset: reset::<D>,
            mark: mark::<D>,
            wake: wake::<D>,
        };
        // SAFETY: the shim copies the table, and `devices` lives until `drop`.
        let raw = unsafe { nano_new(&table, flash_bytes) };
        if raw.is_null() {
            // SAFETY: made above, and nobody else has it.
            drop(unsafe { Box::from_raw(devices) });
            return Err("this simavr has no ATmega328P; install libsimavr-dev 1.6 or later");
        }
        Ok(Self { raw, devices })
    }

    /// Returns the devices.
    pub fn devices(&self) -> &D {
        // SAFETY: alive until `drop`; the shim touches them only during calls that take `&mut self`.
        unsafe { &*self.devices }
    }

    /// Returns the devices, to change them.
    pub fn devices_mut(&mut self) -> &mut D {
        // SAFETY: as above, and `self` is borrowed for as long as the result.
        unsafe { &mut *self.devices }
    }

    /// Copies `bytes` into flash. Returns whether they fit.
    #[must_use]
    pub fn write_flash(&mut self, address: u32, bytes: &[u8]) -> bool {
        let Ok(length) = u32::try_from(bytes.len()) else { return false };
        // SAFETY: the shim checks the bounds of flash.
        unsafe { nano_flash(self.raw, address, bytes.as_ptr(), length) != 0 }
    }

    /// Returns the EEPROM: 1 KB, 0xFF where blank.
    pub fn eeprom_mut(&mut self) -> &mut [u8] {
        let mut length = 0;
        // SAFETY: simavr allocates the EEPROM with the chip and frees it with it.
        unsafe {
            let bytes = nano_eeprom(self.raw, &mut length);
            std::slice::from_raw_parts_mut(bytes, length as usize)
        }
    }

    /// Resets the chip, which then starts at the byte address `start`. SRAM keeps its content.
    pub fn reset(&mut self, start: u32, cause: ResetCause) {
        let mcusr = match cause {
            ResetCause::PowerOn => 1,
            ResetCause::Pin => 2,
        };
        // SAFETY: `raw` is a chip.
        unsafe { nano_reset(self.raw, start, mcusr) }
    }

    /// Sets the supply and the bandgap reference, mV. Below 2700 mV the brown-out detector keeps the chip in reset.
    pub fn set_supply(&mut self, vcc_mv: u32, bandgap_mv: u32) {
        // SAFETY: `raw` is a chip, and no reference to the devices is alive.
        unsafe { nano_set_supply(self.raw, vcc_mv, bandgap_mv) }
    }

    /// Sets the cycles that a line of the bus takes to rise.
    pub fn set_bus_rise(&mut self, cycles: u32) {
        // SAFETY: `raw` is a chip.
        unsafe { nano_set_bus_rise(self.raw, cycles) }
    }

    /// Sends the program into an endless loop, with interrupts on or off.
    ///
    /// # Panics
    /// If all of flash is taken: the loop needs two bytes.
    pub fn hang(&mut self, interrupts: bool) {
        // SAFETY: `raw` is a chip.
        let found = unsafe { nano_hang(self.raw, interrupts.into()) } != 0;
        assert!(found, "no room in flash for an endless loop");
    }

    /// Keeps the program busy until `cycle`, with interrupts on.
    ///
    /// # Panics
    /// As [`Self::hang`].
    pub fn busy(&mut self, cycle: u64) {
        // SAFETY: `raw` is a chip.
        let found = unsafe { nano_busy(self.raw, cycle) } != 0;
        assert!(found, "no room in flash for an endless loop");
    }

    /// Runs until `cycle`, or past it by the rest of an instruction.
    pub fn run_until(&mut self, cycle: u64) -> RunState {
        // SAFETY: `raw` is a chip, and no reference to the devices is alive.
        match unsafe { nano_run_until(self.raw, cycle) } {
            0 => RunState::Running,
            _ => RunState::Crashed,
        }
    }

    /// Returns the cycles since the chip was made.
    pub fn cycle(&self) -> u64 {
        // SAFETY: `raw` is a chip.
        unsafe { nano_cycle(self.raw) }
    }

    /// Updates the level of SDA. Must be called after a device changed its level outside of a run.
    pub fn bus_changed(&mut self) {
        // SAFETY: as in `run_until`.
        unsafe { nano_bus_changed(self.raw) }
    }

    /// Starts the reception of bytes. Must be called after [`Devices::serial_in`] got bytes outside of a run.
    pub fn serial_wake(&mut self) {
        // SAFETY: `raw` is a chip.
        unsafe { nano_serial_wake(self.raw) }
    }

    /// Returns the cycles that a byte lasts on the line.
    pub fn serial_byte_cycles(&self) -> u32 {
        // SAFETY: `raw` is a chip.
        unsafe { nano_serial_byte_cycles(self.raw) }
    }

    /// Returns the number of bytes that the program read too late.
    pub fn serial_overruns(&self) -> u64 {
        // SAFETY: `raw` is a chip.
        unsafe { nano_serial_overruns(self.raw) }
    }

    /// Returns a byte of data space: registers, then SRAM. Reading a register here has no effect on it.
    pub fn peek(&self, address: u16) -> u8 {
        // SAFETY: the shim checks the bounds.
        unsafe { nano_peek(self.raw, address) }
    }

    /// Returns the largest number of bytes of stack used, if static data end before `bottom`.
    pub fn deepest_stack(&self, bottom: u16) -> u16 {
        // SAFETY: `raw` is a chip.
        unsafe { nano_deepest_stack(self.raw, bottom) }
    }

    /// Returns the program counter as a byte address.
    pub fn pc(&self) -> u32 {
        // SAFETY: `raw` is a chip.
        unsafe { nano_pc(self.raw) }
    }
}

impl<D: Devices> Drop for Mcu<D> {
    fn drop(&mut self) {
        // SAFETY: both were made in `new` and are freed once; the chip goes first, because it points to the devices.
        unsafe {
            nano_free(self.raw);
            drop(Box::from_raw(self.devices));
        }
    }
}

#[repr(C)]
struct Raw {
    _private: [u8; 0],
}

/// `struct nano_devices` in `nano.h`.
#[repr(C)]
struct Table {
    context: *mut c_void,
    bus_address: extern "C" fn(*mut c_void, u64, u8) -> u32,
    bus_write: extern "C" fn(*mut c_void, u64, u8) -> u32,
    bus_read: extern "C" fn(*mut c_void, u64) -> u32,
    bus_stop: extern "C" fn(*mut c_void, u64),
    bus_lines: extern "C" fn(*mut c_void, u64, c_int, c_int) -> c_int,
    serial_out: extern "C" fn(*mut c_void, u64, u8),
    serial_in: extern "C" fn(*mut c_void, u64) -> i32,
    outputs: extern "C" fn(*mut c_void, u64, *const Outputs),
    reset: extern "C" fn(*mut c_void, u64),
    mark: extern "C" fn(*mut c_void, u64, u8),
    wake: extern "C" fn(*mut c_void, *mut Raw, u64) -> u64,
}

unsafe extern "C" {
    fn nano_new(devices: *const Table, flash_bytes: u32) -> *mut Raw;
    fn nano_free(nano: *mut Raw);
    fn nano_flash(nano: *mut Raw, address: u32, bytes: *const u8, length: u32) -> c_int;
    fn nano_eeprom(nano: *mut Raw, length: *mut u32) -> *mut u8;
    fn nano_reset(nano: *mut Raw, start: u32, cause: u8);
    fn nano_set_supply(nano: *mut Raw, vcc_mv: u32, bandgap_mv: u32);
    fn nano_set_bus_rise(nano: *mut Raw, cycles: u32);
    fn nano_hang(nano: *mut Raw, interrupts: c_int) -> c_int;
    fn nano_busy(nano: *mut Raw, cycle: u64) -> c_int;
    fn nano_run_until(nano: *mut Raw, cycle: u64) -> c_int;
    fn nano_cycle(nano: *const Raw) -> u64;
    fn nano_set_pins(nano: *mut Raw, port: c_char, mask: u8, levels: u8);
    fn nano_timer_phase(nano: *const Raw, timer: c_int) -> u64;
    fn nano_bus_changed(nano: *mut Raw);
    fn nano_serial_wake(nano: *mut Raw);
    fn nano_serial_byte_cycles(nano: *const Raw) -> u32;
    fn nano_serial_overruns(nano: *const Raw) -> u64;
    fn nano_peek(nano: *const Raw, address: u16) -> u8;
    fn nano_deepest_stack(nano: *const Raw, bottom: u16) -> u16;
    fn nano_pc(nano: *const Raw) -> u32;
}

/// Returns the devices behind a callback's context.
///
/// # Safety
/// `context` is the `devices` of an [`Mcu`] of the same `D` that is running, so that nothing else refers to them.
unsafe fn behind<'a, D: Devices>(context: *mut c_void) -> &'a mut D {
    // SAFETY: the caller's promise.
    unsafe { &mut *context.cast() }
}

const ACK: u32 = 0x100;
const HELD: u32 = 0x200;

fn answer_bits(answer: BusAnswer) -> u32 {
    match answer {
        BusAnswer::Ack => ACK,
        BusAnswer::Nack => 0,
        BusAnswer::Held => HELD,
    }
}

// In each of these the shim passes on the context from `Mcu::new`, as `behind` requires.

extern "C" fn bus_address<D: Devices>(context: *mut c_void, cycle: u64, address: u8) -> u32 {
    answer_bits(unsafe { behind::<D>(context) }.bus_address(cycle, address))
}

extern "C" fn bus_write<D: Devices>(context: *mut c_void, cycle: u64, byte: u8) -> u32 {
    answer_bits(unsafe { behind::<D>(context) }.bus_write(cycle, byte))
}

extern "C" fn bus_read<D: Devices>(context: *mut c_void, cycle: u64) -> u32 {
    unsafe { behind::<D>(context) }.bus_read(cycle).map_or(HELD, u32::from)
}

extern "C" fn bus_stop<D: Devices>(context: *mut c_void, cycle: u64) {
    unsafe { behind::<D>(context) }.bus_stop(cycle);
}

extern "C" fn bus_lines<D: Devices>(context: *mut c_void, cycle: u64, sda: c_int, scl: c_int) -> c_int {
    unsafe { behind::<D>(context) }.bus_lines(cycle, sda != 0, scl != 0).into()
}

extern "C" fn serial_out<D: Devices>(context: *mut c_void, cycle: u64, byte: u8) {
    unsafe { behind::<D>(context) }.serial_out(cycle, byte);
}

extern "C" fn serial_in<D: Devices>(context: *mut c_void, cycle: u64) -> i32 {
    unsafe { behind::<D>(context) }.serial_in(cycle).map_or(-1, i32::from)
}

extern "C" fn outputs<D: Devices>(context: *mut c_void, cycle: u64, outputs: *const Outputs) {
    let outputs = unsafe { *outputs };
    unsafe { behind::<D>(context) }.outputs(cycle, &outputs);
}

extern "C" fn reset<D: Devices>(context: *mut c_void, cycle: u64) {
    unsafe { behind::<D>(context) }.reset(cycle);
}

extern "C" fn mark<D: Devices>(context: *mut c_void, cycle: u64, value: u8) {
    unsafe { behind::<D>(context) }.mark(cycle, value);
}

extern "C" fn wake<D: Devices>(context: *mut c_void, raw: *mut Raw, cycle: u64) -> u64 {
    unsafe { behind::<D>(context) }.wake(cycle, &mut Pins { raw })
}
