//! The application: [`App::tick`] is one tick of the control loop, whose parts are in `attitude` and `motors`; `requests` carries
//! out the host's requests.
//!
//! The binary calls [`App::tick`] every 5 ms and [`App::after_tick`] after it, [`App::receive`] for every byte from the
//! host, and [`App::watch_link`] before each of them, so that the motors stop less than a tick after the host's deadline.

mod attitude;
mod motors;
mod requests;

use embedded_hal::digital::OutputPin;
use embedded_hal::i2c::I2c;
use embedded_hal::pwm::SetDutyCycle;
use protocol::units::{CentiRpm, Duty, Micros, SensorCounts};
use protocol::{Calibration, Fault, FaultRecord, Refusal, Request, ResetCause, Settings, State, Telemetry};

use crate::TICK_S;
use crate::attitude::Attitude;
use crate::calibration::GyroAverage;
use crate::drive::Motors;
use crate::encoder::{Edges, Encoder, centi_rpm_scale};
use crate::fault::{Latch, reset_cause};
use crate::gap::Gap;
use crate::guard::Guard;
use crate::imu::{Config, Imu};
use crate::link::{Answer, Link, Outbox};
use crate::schedule::Schedule;
use crate::settings::{Saving, Store};
use crate::speed::{Gains, SpeedControl, Turn, count_in_ticks};
use crate::storage::Storage;
use crate::supply::Supply;

/// The image's data about its own build.
#[derive(Clone, Copy, Debug)]
pub struct Build {
    /// [`protocol::Info::git_hash`].
    pub git_hash: [u8; 4],
    /// [`protocol::Info::git_dirty`].
    pub git_dirty: bool,
    /// Returns [`protocol::Info::ram_left`].
    pub ram_left: fn() -> u16,
}

/// Findings of the start-up code.
#[derive(Clone, Copy, Debug, Default)]
pub struct Start {
    /// [`FaultRecord::program_counter`] of the hang that led to this start.
    pub hang: Option<u16>,
    /// The hardware's reset flags.
    pub mcusr: u8,
    /// Whether this start came while a motor was on.
    pub cut_off: bool,
}

/// Inputs of a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tick {
    /// Now.
    pub time: Micros,
    /// Ticks missed since the one before.
    pub missed: u8,
    /// Encoders 1 and 2.
    pub edges: [Edges; 2],
    /// The bandgap reference, measured against the supply, if a measurement has ended: 1024 is the supply.
    pub bandgap_counts: Option<u16>,
}

/// The stages of a tick, marked as each ends so that an emulator can measure them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Stage {
    /// Waiting: the tick begins.
    Idle = 0x10,
    /// Reading the sensor.
    Imu = 0x11,
    /// Updating the attitude, or averaging the gyroscope.
    Attitude = 0x12,
    /// Measuring the speeds and setting the bridges.
    Motors = 0x13,
    /// Sending telemetry: the tick ends.
    Telemetry = 0x15,
}

/// The application: the program without the board's registers.
pub struct App<I2C, PIN, PWM, STORAGE> {
    imu: Imu<I2C>,
    attitude: Attitude,
    encoders: [Encoder; 2],
    control: [SpeedControl; 2],
    guards: [Guard; 2],
    motors: Motors<PIN, PWM>,
    link: Link,
    store: Store<STORAGE>,
    latch: Latch,
    schedule: Schedule,
    /// [`SetPoint::duties`](protocol::SetPoint::duties) of the set-point in force.
    duties: [u8; 2],
    /// Ticks left of the open-loop drive.
    drive_ticks: u16,
    /// The turn to positions.
    turn: Option<Turn>,
    supply: Supply,
    settings: Settings,
    /// Hundredths of rpm per count per µs. Stored, like the next three, because a division costs 500 cycles.
    speed_scale: f32,
    /// [`count_in_ticks`] of the encoders.
    count_in_ticks: i32,
    /// Half the turn in a tick per count of the gyroscope, rad.
    half_turn_scale: f32,
    speed_gains: Gains,
    /// The motors' deadline. Stored because it is checked between any two bytes.
    deadline_us: u32,
    build: Build,
    reset_cause: ResetCause,
    boot_count: u16,
    settings_stored: bool,
    /// The next frame of telemetry; also the app's record of target, speed and duty.
    telemetry: Telemetry,
    /// Ticks since the last update of the attitude, and the gyroscope's reading then.
    ticks_behind: u8,
    gyro_before: [SensorCounts; 3],
    gap: Gap,
    calibrating: Option<GyroAverage>,
    calibration: Calibration,
    /// The number of the request for the save in progress.
    save_request: u8,
}

impl<I2C: I2c, PIN: OutputPin, PWM: SetDutyCycle, STORAGE: Storage> App<I2C, PIN, PWM, STORAGE> {
    /// Returns the application with the motors off and the default settings; call [`App::start`] next.
    pub fn new(bus: I2C, motors: Motors<PIN, PWM>, storage: STORAGE, build: Build) -> Self {
        Self {
            imu: Imu::new(bus),
            attitude: Attitude::default(),
            encoders: Default::default(),
            control: Default::default(),
            guards: Default::default(),
            motors,
            link: Link::default(),
            store: Store::new(storage),
            latch: Latch::default(),
            schedule: Schedule::default(),
            duties: [0; 2],
            drive_ticks: 0,
            turn: None,
            supply: Supply::default(),
            speed_scale: 0.0,
            count_in_ticks: 0,
            half_turn_scale: 0.0,
            speed_gains: Gains::default(),
            deadline_us: 0,
            settings: Settings::DEFAULT,
            build,
            reset_cause: ResetCause::Unknown,
            boot_count: 0,
            settings_stored: false,
            telemetry: Telemetry::default(),
            ticks_behind: 0,
            gyro_before: Default::default(),
            gap: Gap::default(),
            calibrating: None,
            calibration: Calibration::default(),
            save_request: 0,
        }
    }

    /// Counts the start, loads settings and positions, sets up the sensor.
    #[inline(never)]
    pub fn start(&mut self, start: Start) {
        self.boot_count = self.store.count_start();
        self.settings_stored = self.store.load(self.link.accumulator(), &mut self.settings);
        if let Some(positions) = self.store.open_positions(self.boot_count as u8) {
            self.telemetry.encoder = positions;
        }
        self.reset_cause = reset_cause(start.hang.is_some(), start.mcusr);
        self.rescale();
        self.imu.configure(Config::from(&self.settings));
        // The handshake names the sensor.
        self.imu.poll();
        if start.hang.is_some() || start.cut_off {
            self.log_and_latch(Fault::Hang, start.hang.unwrap_or_default());
        }
    }

    /// Does one tick of the control loop.
    #[inline(never)]
    pub fn tick(&mut self, tick: &Tick, outbox: &mut impl Outbox, mark: impl Fn(Stage)) {
        mark(Stage::Idle);
        self.count_ticks(tick);
        self.watch_supply(tick);
        self.read_imu();
        mark(Stage::Imu);
        self.calibrate_gyro();
        self.follow_attitude();
        mark(Stage::Attitude);
        self.measure_speed(0, tick);
        self.measure_speed(1, tick);
        self.follow_schedule(tick);
        self.follow_turn();
        self.drive_motors();
        mark(Stage::Motors);
        self.report(outbox);
        mark(Stage::Telemetry);
    }

    /// Does the work that can wait until after a tick: ends a calibration, writes to the EEPROM.
    pub fn after_tick(&mut self, outbox: &mut impl Outbox) {
        self.finish_calibration();
        if !self.record_positions() {
            self.save_settings(outbox);
        }
    }

    /// Takes a byte from the host and answers the request that it ends. `arrived` is the time of a byte that ends a frame.
    #[inline(never)]
    pub fn receive(&mut self, byte: u8, arrived: Micros, outbox: &mut impl Outbox) {
        if let Some(payload) = self.link.receive(byte, arrived)
            && let Some(request) = &Request::read(payload)
            && self.link.has_room(&request.command, outbox)
        {
            self.respond(request, arrived, outbox);
        }
    }

    /// Stops the motors when the host has been silent for too long.
    pub fn watch_link(&mut self, now: Micros) {
        if self.link.is_silent(now, self.deadline_us) && (self.is_driven() || self.schedule.will_move()) {
            self.raise(Fault::LinkLost);
        }
    }

    fn count_ticks(&mut self, tick: &Tick) {
        self.telemetry.time = tick.time;
        self.telemetry.missed_ticks.0 = self.telemetry.missed_ticks.0.wrapping_add(u16::from(tick.missed));
        self.ticks_behind = self.ticks_behind.saturating_add(tick.missed).saturating_add(1);
    }

    #[inline(never)]
    fn watch_supply(&mut self, tick: &Tick) {
        if let Some(counts) = tick.bandgap_counts {
            self.telemetry.supply = self.supply.update(counts, self.settings.bandgap);
            self.raise(self.supply.fault());
        }
    }

    #[inline(never)]
    fn record_positions(&mut self) -> bool {
        let moves = self.is_driven() || self.schedule.will_move();
        let at_rest = !moves && self.encoders.iter().all(Encoder::is_still);
        self.store.step_positions(&self.telemetry.encoder, at_rest)
    }

    #[inline(never)]
    fn save_settings(&mut self, outbox: &mut impl Outbox) {
        let answer = match self.store.step(&self.settings) {
            Saving::Idle | Saving::Busy => return,
            Saving::Done => {
                self.settings_stored = true;
                Answer::Done
            }
            Saving::Failed => Answer::Refused(Refusal::EepromFailed),
        };
        self.link.remember_late(self.save_request, answer);
        self.answer(self.save_request, answer, outbox);
    }

    #[inline(never)]
    fn report(&mut self, outbox: &mut impl Outbox) {
        if self.link.is_frame_due() {
            self.telemetry.state = self.state();
            self.telemetry.fault = self.latch.get();
            self.link.stream(&mut self.telemetry, outbox);
        }
    }

    fn state(&self) -> State {
        if self.latch.is_set() {
            State::Faulted
        } else if self.calibrating.is_some() {
            State::Calibrating
        } else if self.is_running() {
            State::Running
        } else if self.drive_ticks > 0 {
            State::Driving
        } else {
            State::Idle
        }
    }

    #[inline(never)]
    fn is_running(&self) -> bool {
        let [first, second] = self.telemetry.target;
        first.0 | second.0 != 0 || self.turn.is_some()
    }

    /// Returns whether edges of the encoders are counted. They are not after the fault of a noisy encoder, whose edges would
    /// take a quarter of each tick: the positions are lost by then.
    pub fn counts_edges(&self) -> bool {
        !matches!(self.latch.get(), Fault::Encoder1Noisy | Fault::Encoder2Noisy)
    }

    /// Returns whether a motor is on.
    pub fn is_driven(&self) -> bool {
        self.is_running() || self.drive_ticks > 0
    }

    /// Returns whether a fault is still being written to the fault log.
    pub fn is_logging(&self) -> bool {
        self.store.is_logging()
    }

    /// Turns the motors off, and ends the schedule and a calibration.
    #[inline(never)]
    fn stop(&mut self) {
        self.calibrating = None;
        self.schedule.stop();
        self.telemetry.phase = 0;
        self.turn_off();
    }

    #[inline(never)]
    fn turn_off(&mut self) {
        self.motors.stop();
        self.drive_ticks = 0;
        self.turn = None;
        self.telemetry.target = [CentiRpm(0); 2];
        self.telemetry.duty = [Duty(0); 2];
        self.control = Default::default();
    }

    fn rescale(&mut self) {
        self.speed_scale = centi_rpm_scale(self.settings.counts_per_turn);
        self.count_in_ticks = count_in_ticks(self.settings.counts_per_turn);
        self.half_turn_scale = core::f32::consts::PI / 360.0 * TICK_S / self.settings.gyro_range.counts_per_dps();
        self.deadline_us = u32::from(self.settings.deadline_ms) * 1000;
        self.speed_gains = Gains::new(self.settings.speed_kp, self.settings.speed_ki);
    }

    /// Latches a fault, adds it to the fault log, and stops the motors.
    #[inline(never)]
    fn raise(&mut self, fault: Fault) {
        self.log_and_latch(fault, 0);
    }

    #[inline(never)]
    fn log_and_latch(&mut self, fault: Fault, program_counter: u16) {
        if self.latch.set(fault) {
            let Telemetry { time, duty, speed, .. } = self.telemetry;
            self.stop();
            self.store.log_fault(&FaultRecord { boot: self.boot_count, time, fault, duty, speed, program_counter });
        }
    }
}
