//! The Nano with everything that is wired to it, for tests and for the program `vnano`.
//!
//! ```no_run
//! use virtual_nano::{Board, BoardOptions, Image};
//!
//! let image = Image::from_elf("target/firmware.elf".as_ref())?;
//! let mut board = Board::new(&image, BoardOptions::default())?;
//! board.run_for(16_000_000);
//! println!("{:?}", board.take_serial());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::bridge::{Bridge, Drive};
use crate::clock::ProgramClock;
use crate::coupling::Coupling;
use crate::drift::{Supply, Wander};
use crate::encoder::{Disturbance, Encoder};
use crate::image::Image;
use crate::imu::source::Source;
use crate::imu::{self, Mpu6050};
use crate::marks::{Marks, TICK_BEGIN};
use crate::mcu::{BusAnswer, Devices, FLASH_BYTES, FREQUENCY_HZ, Mcu, Outputs, Pins, ResetCause, RunState};
use crate::motor::{Motor, STEP_S};
use crate::plant::Plant;
use crate::resonator::Resonator;
use crate::rig::RigKind;
use crate::serial::Serial;

/// Options of a board.
pub struct BoardOptions {
    /// Input of the sensor.
    pub source: Source,
    /// The sensor's WHO_AM_I.
    pub imu_id: u8,
    /// What is wired to the chip.
    pub rig: RigKind,
    /// Seed of all random events on the line.
    pub seed: u64,
}

impl Default for BoardOptions {
    fn default() -> Self {
        Self { source: Source::still(1), imu_id: imu::GENUINE_ID, rig: RigKind::default(), seed: 1 }
    }
}

/// Supply of a board on a good port, mV.
pub(crate) const SUPPLY_MV: u32 = 5000;

/// The bandgap reference (data sheet, section 29.5), mV.
pub(crate) const BANDGAP_MV: u32 = 1100;

/// A scheduled change of a board.
type Event = Box<dyn FnOnce(&mut Board) + Send>;

/// The board.
pub struct Board {
    /// The chip.
    pub mcu: Mcu<Rig>,
    start: u32,
    /// Bytes of SRAM for static data; `None` with a bootloader, which may load any program.
    pub static_bytes: Option<u16>,
    /// How the last run ended.
    pub state: RunState,
    vcc_mv: u32,
    bandgap_mv: u32,
    /// Scheduled changes, with their times (s).
    events: Vec<(f64, Event)>,
}

impl Board {
    /// Returns a board with `image` in its flash that has just got power.
    pub fn new(image: &Image, options: BoardOptions) -> Result<Self, &'static str> {
        let mut board = Self::with_start(image, 0, options)?;
        board.static_bytes = Some(image.static_bytes);
        Ok(board)
    }

    /// Returns a board with a bootloader as its image: every reset starts at the image's lowest address, and the rest of
    /// flash is blank.
    pub fn with_bootloader(image: &Image, options: BoardOptions) -> Result<Self, &'static str> {
        Self::with_start(image, image.start(), options)
    }

    fn with_start(image: &Image, start: u32, options: BoardOptions) -> Result<Self, &'static str> {
        let kind = options.rig;
        let mut rig = Rig {
            kind,
            imu: Mpu6050::new(options.imu_id, options.source),
            bridge: Bridge::default(),
            motors: kind.motors.map(Motor::new),
            supply: kind.supply,
            motors_swapped: false,
            shaking_dps: 0.0,
            motors_at_s: 0.0,
            encoders: [1, 2].map(|motor| Encoder::new(options.seed ^ motor << 32)),
            coupling: Coupling::default(),
            pull_ups: 0,
            resonator: Resonator::default(),
            serial: Serial::new(options.seed),
            marks: Marks::default(),
            clock: ProgramClock::default(),
        };
        for (motor, deviation) in kind.wander.into_iter().enumerate() {
            rig.motors[motor].wander = Wander::new(deviation, options.seed ^ (motor as u64 + 3) << 32);
            rig.encoders[motor].absent = !kind.has_encoders;
        }
        let mut mcu = Mcu::new(rig, image.end().max(FLASH_BYTES))?;
        for (address, bytes) in &image.segments {
            // An image's segments were checked against the size of flash.
            assert!(mcu.write_flash(*address, bytes), "an image that does not fit");
        }
        mcu.reset(start, ResetCause::PowerOn);
        let clock_error = mcu.devices().imu.source.part.errors.board_clock_error;
        mcu.devices_mut().resonator.set_error(0, clock_error);
        Ok(Self {
            mcu,
            start,
            static_bytes: None,
            state: RunState::Running,
            vcc_mv: SUPPLY_MV,
            bandgap_mv: BANDGAP_MV,
            events: Vec::new(),
        })
    }

    /// Pulls the reset pin.
    pub fn reset(&mut self) {
        self.mcu.reset(self.start, ResetCause::Pin);
        self.state = RunState::Running;
    }

    /// Runs until `cycle`. After a crash, the program and the board's time stand still until a reset.
    pub fn run_until(&mut self, cycle: u64) -> RunState {
        while self.state == RunState::Running && self.cycle() < cycle {
            let due = self.events.iter().map(|(at_s, _)| self.rig().resonator.cycle(*at_s)).min().unwrap_or(u64::MAX);
            self.state = self.mcu.run_until(cycle.min(due.max(self.cycle() + 1)));
            let now_s = self.seconds();
            for (_, event) in self.events.extract_if(.., |(at_s, _)| *at_s <= now_s).collect::<Vec<_>>() {
                event(self);
            }
        }
        self.state
    }

    /// Changes the board at a time (s) since power came up.
    pub(crate) fn later(&mut self, at_s: f64, event: impl FnOnce(&mut Self) + Send + 'static) {
        self.events.push((at_s, Box::new(event)));
    }

    /// Ends every fault that can end, and cancels those that have not begun. Their effects on registers and on the program
    /// stay.
    pub fn clear_faults(&mut self) {
        self.events.clear();
        self.end_faults();
    }

    /// Runs for `cycles`.
    pub fn run_for(&mut self, cycles: u64) -> RunState {
        self.run_until(self.cycle() + cycles)
    }

    /// Returns the cycles since power came up.
    pub fn cycle(&self) -> u64 {
        self.mcu.cycle()
    }

    /// Returns the time since power came up, s. It differs from the nominal time of the cycles if the resonator has an
    /// error.
    pub fn seconds(&self) -> f64 {
        self.rig().resonator.seconds(self.cycle())
    }

    /// Returns everything outside of the chip.
    pub fn rig(&self) -> &Rig {
        self.mcu.devices()
    }

    /// Returns everything outside of the chip, to change it. The sensor is changed by [`Self::change_imu`].
    pub fn rig_mut(&mut self) -> &mut Rig {
        self.mcu.devices_mut()
    }

    /// Makes the resonator too fast by a fraction.
    pub fn set_resonator_error(&mut self, fraction: f64) {
        let cycle = self.cycle();
        self.rig_mut().resonator.set_error(cycle, fraction);
    }

    /// Sends bytes from the host.
    pub fn send(&mut self, bytes: &[u8]) {
        self.rig_mut().serial.send(bytes);
        self.mcu.serial_wake();
    }

    /// Takes the bytes that the board has sent since the last call.
    pub fn take_serial(&mut self) -> Vec<u8> {
        let now_s = self.seconds();
        self.rig_mut().serial.take(now_s)
    }

    /// Returns the speed of the board's end of the line, bit/s.
    pub fn baud(&self) -> f64 {
        10.0 * self.rig().resonator.hz / f64::from(self.mcu.serial_byte_cycles())
    }

    /// Changes the sensor or its input.
    pub fn change_imu<T>(&mut self, change: impl FnOnce(&mut Mpu6050) -> T) -> T {
        let result = change(&mut self.rig_mut().imu);
        // The sensor may have released SDA, or pulled it.
        self.mcu.bus_changed();
        result
    }

    /// Connects each of the bridge's outputs to the other's motor, or to its own.
    pub fn swap_motors(&mut self, swapped: bool) {
        let rig = self.rig_mut();
        rig.motors_swapped = swapped;
        rig.drive_motors();
    }

    /// Disturbs a line (channel 0 or 1) of the encoder of motor 0 or 1 from now on.
    pub fn disturb_encoder(&mut self, motor: usize, channel: usize, disturbance: Disturbance) {
        let now_s = self.seconds();
        self.rig_mut().encoders[motor].disturb(channel, disturbance, now_s);
    }

    /// Keeps the program busy for a time, with interrupts on.
    pub fn keep_busy_ms(&mut self, ms: f64) {
        let cycle = self.cycle() + (ms * 1e-3 * self.rig().resonator.hz).round() as u64;
        self.mcu.busy(cycle);
    }

    /// Sets the supply of the chip, mV. Below 2700 mV it is in reset.
    pub fn set_supply_mv(&mut self, vcc_mv: u32) {
        self.vcc_mv = vcc_mv;
        self.mcu.set_supply(self.vcc_mv, self.bandgap_mv);
    }

    /// Sets the chip's bandgap reference, mV. The data sheet allows 1000 to 1200.
    pub fn set_bandgap_mv(&mut self, bandgap_mv: u32) {
        self.bandgap_mv = bandgap_mv;
        self.mcu.set_supply(self.vcc_mv, self.bandgap_mv);
    }

    /// Sets the time that a line of the bus takes to rise, µs.
    pub fn set_bus_rise_us(&mut self, rise_us: f64) {
        self.mcu.set_bus_rise((rise_us * 1e-6 * FREQUENCY_HZ as f64).round() as u32);
    }

    /// Returns the simulated robot that the board is built into, if there is one.
    pub fn plant(&self) -> Option<&Plant> {
        self.rig().imu.source.plant_ref()
    }

    /// Returns the simulated robot, to take its samples.
    pub fn plant_mut(&mut self) -> Option<&mut Plant> {
        self.rig_mut().imu.source.plant_mut()
    }

    /// Returns the largest number of bytes of stack used so far; not known behind a bootloader.
    pub fn deepest_stack(&self) -> Option<u16> {
        self.static_bytes.map(|bytes| self.mcu.deepest_stack(0x100 + bytes))
    }
}

/// Everything outside of the chip.
pub struct Rig {
    /// What is wired to the chip.
    pub kind: RigKind,
    /// The sensor.
    pub imu: Mpu6050,
    /// The present state of the bridge.
    pub bridge: Bridge,
    /// Motors 1 and 2.
    pub motors: [Motor; 2],
    /// Their supply.
    pub supply: Supply,
    motors_swapped: bool,
    /// By how much the gears shake the sensor, °/s.
    pub shaking_dps: f64,
    /// The time up to which the motors have turned, s.
    motors_at_s: f64,
    /// Encoders 1 and 2.
    pub encoders: [Encoder; 2],
    /// Leads that share a cable.
    pub coupling: Coupling,
    /// Pull-ups on port D.
    pull_ups: u8,
    /// The chip's resonator.
    pub resonator: Resonator,
    /// The line to the host.
    pub serial: Serial,
    /// The program's marks.
    pub marks: Marks,
    /// The program's own clock.
    pub clock: ProgramClock,
}

/// Pins of port D for C1 and C2 of both encoders.
const ENCODER_PINS: [[u8; 2]; 2] = [[3, 5], [2, 4]];

/// The timers whose PWM drives motors 1 and 2.
const PWM_TIMERS: [u8; 2] = [0, 2];

impl Rig {
    /// Turns the motors until this cycle. Returns its time, s.
    fn turn_motors(&mut self, cycle: u64) -> f64 {
        let now_s = self.resonator.seconds(cycle);
        let passed_s = now_s - self.motors_at_s;
        if self.bridge.drive.iter().any(|drive| !matches!(drive, Drive::Coast | Drive::Brake)) {
            self.supply.on_s += passed_s;
        }
        for motor in &mut self.motors {
            motor.set_supply(self.supply.now_v(), self.kind.bridge.lost_v());
            motor.advance(passed_s);
        }
        self.motors_at_s = now_s;
        self.imu.source.shaken_dps = self.shaking_dps * self.motors.iter().map(Motor::shaking).sum::<f64>();
        if let Some(plant) = self.imu.source.plant_mut() {
            plant.follow(now_s, &self.motors);
        }
        now_s
    }

    fn drive_motors(&mut self) {
        for (motor, drive) in self.bridge.drive.into_iter().enumerate() {
            let motor = if self.motors_swapped { 1 - motor } else { motor };
            self.motors[motor].drive = drive;
        }
    }
}

impl Devices for Rig {
    fn bus_address(&mut self, cycle: u64, address: u8) -> BusAnswer {
        let now_s = self.turn_motors(cycle);
        self.imu.address(now_s, address)
    }

    fn bus_write(&mut self, _cycle: u64, byte: u8) -> BusAnswer {
        self.imu.write(byte)
    }

    fn bus_read(&mut self, _cycle: u64) -> Option<u8> {
        self.imu.read()
    }

    fn bus_stop(&mut self, _cycle: u64) {
        self.imu.stop();
    }

    fn bus_lines(&mut self, _cycle: u64, _sda: bool, scl: bool) -> bool {
        self.imu.lines(scl)
    }

    fn serial_out(&mut self, _cycle: u64, byte: u8) {
        self.clock.hear(byte);
        self.serial.from_chip(byte);
    }

    fn serial_in(&mut self, _cycle: u64) -> Option<u8> {
        self.serial.to_chip()
    }

    fn outputs(&mut self, cycle: u64, outputs: &Outputs) {
        self.pull_ups = outputs.port_d & !outputs.ddr_d;
        let bridge = Bridge::from_outputs(self.kind.bridge, outputs);
        if bridge == self.bridge {
            return;
        }
        self.turn_motors(cycle);
        self.bridge = bridge;
        self.drive_motors();
        let periods = bridge.pwm_hz.map(|hz| if hz > 0.0 { (FREQUENCY_HZ as f64 / hz) as u64 } else { 0 });
        self.coupling.drive(cycle, &bridge, [outputs.ocr0a, outputs.ocr2a], periods);
    }

    fn reset(&mut self, _cycle: u64) {
        self.marks.reset();
        self.clock = ProgramClock::default();
    }

    fn mark(&mut self, cycle: u64, value: u8) {
        if value == TICK_BEGIN {
            self.clock.tick(cycle);
        }
        self.marks.mark(cycle, value);
    }

    fn wake(&mut self, cycle: u64, pins: &mut Pins) -> u64 {
        let now_s = self.turn_motors(cycle);
        let (mut mask, mut levels, mut next_s) = (0, 0, STEP_S);
        let (struck, next_spike) = self.coupling.strike(cycle, PWM_TIMERS.map(|timer| pins.timer_phase(timer)));
        for (((encoder, motor), bits), struck) in
            self.encoders.iter_mut().zip(&self.motors).zip(ENCODER_PINS).zip(struck)
        {
            let pull_ups = bits.map(|bit| self.pull_ups >> bit & 1 == 1);
            let released = encoder.levels(motor.counts, now_s, pull_ups);
            for ((bit, level), struck) in bits.into_iter().zip(released).zip(struck) {
                mask |= 1 << bit;
                levels |= u8::from(level != struck) << bit;
            }
            next_s = encoder.next_event_s(motor.counts, motor.counts_per_second(), now_s, next_s);
        }
        pins.set('D', mask, levels);
        cycle + next_spike.min((next_s * self.resonator.hz).ceil() as u64)
    }
}
