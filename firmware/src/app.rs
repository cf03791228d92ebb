//! What the robot does: [`App::tick`] reads as its table of contents.
//!
//! The binary calls [`App::tick`] every 5 ms, [`App::receive`] for every byte from the host, and [`App::watch_link`]
//! before and after each tick, so that the motors stop less than a tick after the host's deadline.

use embedded_hal::digital::OutputPin;
use embedded_hal::i2c::I2c;
use embedded_hal::pwm::SetDutyCycle;
use protocol::units::{CentiRpm, Count, Duty, Micros};
use protocol::{Calibration, Command, Fault, Info, Refusal, Reply, ResetCause, Settings, State, Telemetry, VERSION};

use crate::attitude::{self, Attitude};
use crate::calibration::GyroAverage;
use crate::encoder::{Edges, Encoder, centi_rpm_scale};
use crate::fault::{Crash, Latch, reset_cause};
use crate::imu::{Config, Imu, Reading};
use crate::link::{Link, Outbox};
use crate::motor::{self, Motors, SpeedControl};
use crate::settings::{Saving, Storage, Store};
use crate::{TICK_MS, TICK_S};

/// What the program was built from.
#[derive(Clone, Copy, Debug, Default)]
pub struct Build {
    /// [`Info::git_hash`].
    pub git_hash: [u8; 4],
    /// [`Info::git_dirty`].
    pub git_dirty: bool,
}

/// What the start-up code found.
#[derive(Clone, Copy, Debug, Default)]
pub struct Start {
    /// The record of a crash.
    pub crash: Option<Crash>,
    /// The hardware's reset flags.
    pub mcusr: u8,
}

/// What the board knows when a tick begins.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tick {
    /// Now.
    pub time: Micros,
    /// Ticks left out since the one before.
    pub missed: u8,
    /// Encoders 1 and 2.
    pub edges: [Edges; 2],
}

/// The stages of a tick, told to whoever measures them as each ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Stage {
    /// Waiting: the tick begins.
    Idle = 0x10,
    /// Reading the sensor.
    Imu = 0x11,
    /// Following the attitude, or averaging the gyroscope.
    Attitude = 0x12,
    /// Measuring the speeds and setting the bridges.
    Motors = 0x13,
    /// Going on with a save of the settings.
    Settings = 0x14,
    /// Sending telemetry: the tick ends.
    Telemetry = 0x15,
}

/// The robot.
pub struct App<I2C, PIN, PWM, STORAGE> {
    imu: Imu<I2C>,
    attitude: Attitude,
    encoders: [Encoder; 2],
    control: [SpeedControl; 2],
    motors: Motors<PIN, PWM>,
    link: Link,
    store: Store<STORAGE>,
    latch: Latch,
    settings: Settings,
    scales: Scales,
    build: Build,
    reset_cause: ResetCause,
    boot_count: u16,
    settings_stored: bool,
    target: [CentiRpm; 2],
    /// The last good reading.
    reading: Reading,
    fresh: bool,
    /// Ticks since the attitude moved on.
    ticks_behind: u8,
    calibrating: Option<GyroAverage>,
    calibration: Calibration,
    /// The number of the request that a save has to answer.
    save_request: u8,
    missed_ticks: u16,
}

/// Factors that follow from the settings, kept because a division costs 500 cycles.
#[derive(Clone, Copy)]
struct Scales {
    /// Hundredths of rpm for one count per µs, by encoder.
    centi_rpm: [f32; 2],
    /// rad/s for one count of the gyroscope.
    rad_per_s: f32,
}

impl From<&Settings> for Scales {
    fn from(settings: &Settings) -> Self {
        let scale = centi_rpm_scale(settings.counts_per_turn);
        Self {
            centi_rpm: settings.encoder_reversed.map(|reversed| if reversed { -scale } else { scale }),
            rad_per_s: core::f32::consts::PI / 180.0 / settings.gyro_range.counts_per_dps(),
        }
    }
}

impl<I2C, PIN, PWM, STORAGE> App<I2C, PIN, PWM, STORAGE>
where
    I2C: I2c,
    PIN: OutputPin,
    PWM: SetDutyCycle,
    STORAGE: Storage,
{
    /// Starts with the motors off and the settings that `storage` holds.
    #[inline(never)]
    pub fn new(bus: I2C, motors: Motors<PIN, PWM>, storage: STORAGE, build: Build, start: Start) -> Self {
        let mut store = Store::new(storage);
        let boot_count = store.count_start();
        let stored = store.load();
        let settings = stored.unwrap_or(Settings::DEFAULT);
        let mut latch = Latch::default();
        if let Some(crash) = start.crash {
            latch.set(crash.fault());
        }
        Self {
            imu: Imu::new(bus, Config::from(&settings)),
            attitude: Attitude::default(),
            encoders: Default::default(),
            control: Default::default(),
            motors,
            link: Link::new(),
            store,
            latch,
            scales: Scales::from(&settings),
            settings,
            build,
            reset_cause: reset_cause(start.crash, start.mcusr),
            boot_count,
            settings_stored: stored.is_some(),
            target: [CentiRpm(0); 2],
            reading: Reading::default(),
            fresh: false,
            ticks_behind: 0,
            calibrating: None,
            calibration: Calibration::default(),
            save_request: 0,
            missed_ticks: 0,
        }
    }

    /// One tick of the control loop.
    #[inline(never)]
    pub fn tick(&mut self, tick: &Tick, outbox: &mut Outbox, mark: impl Fn(Stage)) {
        mark(Stage::Idle);
        self.count_ticks(tick.missed);
        self.read_imu();
        mark(Stage::Imu);
        self.calibrate_gyro();
        self.follow_attitude();
        mark(Stage::Attitude);
        self.measure_speeds(tick);
        self.drive_motors();
        mark(Stage::Motors);
        self.save_settings(outbox);
        mark(Stage::Settings);
        self.report(tick.time, outbox);
        mark(Stage::Telemetry);
    }

    /// Takes a byte from the host, and answers the request that it ends. `arrived` is when the frame ended, if it ends
    /// one.
    #[inline(never)]
    pub fn receive(&mut self, byte: u8, arrived: Micros, outbox: &mut Outbox) {
        let Some(request) = self.link.receive(byte, arrived) else { return };
        let reply = match self.link.repetition(&request) {
            Some(reply) => reply,
            None => match self.carry_out(request.seq, &request.command, arrived) {
                Ok(Some(reply)) => reply,
                Ok(None) => return,
                Err(refusal) => Reply::Refused(refusal),
            },
        };
        self.link.answer(request.seq, reply, outbox);
    }

    /// Stops the motors when the host has been silent for too long.
    pub fn watch_link(&mut self, now: Micros) {
        if self.is_running() && self.link.is_silent(now, self.settings.deadline_ms) {
            self.raise(Fault::LinkLost);
        }
    }

    /// Does what a request asks for. `None` where the answer comes later.
    #[inline(never)]
    fn carry_out(&mut self, seq: u8, command: &Command, arrived: Micros) -> Result<Option<Reply>, Refusal> {
        match *command {
            Command::Hello => return Ok(Some(Reply::Info(self.info()))),
            Command::SetSpeeds(target) => self.set_speeds(target)?,
            Command::Stop => self.stop(),
            Command::Stream { rate_hz } => self.link.set_stream(rate_hz)?,
            Command::CalibrateGyro { duration_ms } => self.begin_calibration(duration_ms)?,
            Command::ReadCalibration => {
                self.refuse_if_calibrating()?;
                return Ok(Some(Reply::Calibration(self.calibration)));
            }
            Command::ReadSettings => return Ok(Some(Reply::Settings(self.settings))),
            Command::WriteSettings(settings) => self.set_settings(settings)?,
            Command::SaveSettings => {
                self.save_request = seq;
                self.store.begin_save();
                return Ok(None);
            }
            Command::Ping => return Ok(Some(Reply::Pong(arrived))),
            Command::ClearFault => self.clear_fault()?,
        }
        Ok(Some(Reply::Done))
    }

    fn count_ticks(&mut self, missed: u8) {
        self.missed_ticks = self.missed_ticks.wrapping_add(u16::from(missed));
        self.ticks_behind = self.ticks_behind.saturating_add(missed).saturating_add(1);
    }

    #[inline(never)]
    fn read_imu(&mut self) {
        let reading = self.imu.poll();
        self.fresh = reading.is_some();
        if let Some(reading) = reading {
            self.reading = reading;
        }
        self.raise(self.imu.fault());
    }

    #[inline(never)]
    fn calibrate_gyro(&mut self) {
        let Some(average) = &mut self.calibrating else { return };
        if average.update(self.fresh.then_some(self.reading.gyro)) {
            self.calibration = average.result(self.settings.gyro_range);
            self.calibrating = None;
            if self.calibration.still {
                self.settings.gyro_bias = self.calibration.bias;
            }
        }
    }

    #[inline(never)]
    fn follow_attitude(&mut self) {
        if !self.fresh {
            return;
        }
        let Settings { gyro_bias, gyro_axes, accel_axes, attitude_kp: kp, attitude_ki: ki, .. } = self.settings;
        let mut rates = self.reading.gyro.map(|counts| f32::from(counts.0));
        for (rate, bias) in rates.iter_mut().zip(gyro_bias) {
            *rate = (*rate - bias) * self.scales.rad_per_s;
        }
        let acceleration = self.reading.accel.map(|counts| f32::from(counts.0));
        let dt = f32::from(core::mem::take(&mut self.ticks_behind)) * TICK_S;
        let gains = attitude::Gains { kp, ki };
        self.attitude.update(gyro_axes.apply(rates), accel_axes.apply(acceleration), dt, gains);
    }

    #[inline(never)]
    fn measure_speeds(&mut self, tick: &Tick) {
        for ((encoder, edges), scale) in self.encoders.iter_mut().zip(tick.edges).zip(self.scales.centi_rpm) {
            encoder.update(edges, tick.time, scale);
        }
    }

    #[inline(never)]
    fn drive_motors(&mut self) {
        if !self.is_running() {
            return;
        }
        let gains = motor::Gains { kp: self.settings.speed_kp, ki: self.settings.speed_ki };
        let mut duty = [Duty(0); 2];
        let mut stalled = Fault::None;
        for (motor, fault) in [Fault::Motor1Stalled, Fault::Motor2Stalled].into_iter().enumerate() {
            let (control, encoder) = (&mut self.control[motor], &self.encoders[motor]);
            duty[motor] = control.duty(self.target[motor], encoder.speed(), gains);
            if control.is_stalled(duty[motor], encoder.moved()) && stalled == Fault::None {
                stalled = fault;
            }
        }
        self.motors.drive(duty, self.settings.motor_reversed);
        self.raise(stalled);
    }

    fn save_settings(&mut self, outbox: &mut Outbox) {
        let reply = match self.store.step(&self.settings) {
            Saving::Idle | Saving::Busy => return,
            Saving::Done => Reply::Done,
            Saving::Failed => Reply::Refused(Refusal::EepromFailed),
        };
        self.link.answer(self.save_request, reply, outbox);
    }

    #[inline(never)]
    fn report(&mut self, time: Micros, outbox: &mut Outbox) {
        if !self.link.is_frame_due() {
            return;
        }
        let mut encoder = self.encoders.each_ref().map(Encoder::position);
        for (position, reversed) in encoder.iter_mut().zip(self.settings.encoder_reversed) {
            if reversed {
                position.0 = position.0.wrapping_neg();
            }
        }
        let telemetry = Telemetry {
            time,
            attitude: self.attitude.quaternion(),
            gyro: self.reading.gyro,
            accel: self.reading.accel,
            temperature: self.reading.temperature,
            target: self.target,
            speed: self.encoders.each_ref().map(Encoder::speed),
            duty: self.motors.duty(),
            encoder,
            state: self.state(),
            fault: self.latch.get(),
            imu_fresh: self.fresh,
            imu_errors: Count(self.imu.errors()),
            missed_ticks: Count(self.missed_ticks),
            ..Telemetry::default()
        };
        self.link.stream(telemetry, outbox);
    }

    fn info(&self) -> Info {
        Info {
            protocol: VERSION,
            firmware: [
                const { decimal(env!("CARGO_PKG_VERSION_MAJOR")) },
                const { decimal(env!("CARGO_PKG_VERSION_MINOR")) },
                const { decimal(env!("CARGO_PKG_VERSION_PATCH")) },
            ],
            git_hash: self.build.git_hash,
            git_dirty: self.build.git_dirty,
            board_id: self.settings.board_id,
            imu_id: self.imu.id(),
            gyro_range: self.settings.gyro_range,
            accel_range: self.settings.accel_range,
            settings_stored: self.settings_stored,
            reset_cause: self.reset_cause,
            boot_count: self.boot_count,
        }
    }

    fn state(&self) -> State {
        if self.latch.is_set() {
            State::Faulted
        } else if self.calibrating.is_some() {
            State::Calibrating
        } else if self.is_running() {
            State::Running
        } else {
            State::Idle
        }
    }

    fn is_running(&self) -> bool {
        self.target != [CentiRpm(0); 2]
    }

    fn set_speeds(&mut self, target: [CentiRpm; 2]) -> Result<(), Refusal> {
        let limit = CentiRpm::LIMIT.0;
        if !target.iter().all(|speed| (-limit..=limit).contains(&speed.0)) {
            return Err(Refusal::OutOfRange);
        }
        self.refuse_if_faulted()?;
        self.refuse_if_calibrating()?;
        if target == [CentiRpm(0); 2] {
            self.stop();
        }
        self.target = target;
        Ok(())
    }

    #[inline(never)]
    fn stop(&mut self) {
        self.target = [CentiRpm(0); 2];
        self.motors.stop();
        self.control = Default::default();
    }

    fn begin_calibration(&mut self, duration_ms: u16) -> Result<(), Refusal> {
        if !(100..=60_000).contains(&duration_ms) {
            return Err(Refusal::OutOfRange);
        }
        self.refuse_if_faulted()?;
        self.refuse_if_running()?;
        self.refuse_if_calibrating()?;
        self.calibrating = Some(GyroAverage::new(duration_ms / TICK_MS));
        Ok(())
    }

    #[inline(never)]
    fn set_settings(&mut self, settings: Settings) -> Result<(), Refusal> {
        if !settings.is_valid() {
            return Err(Refusal::OutOfRange);
        }
        self.refuse_if_running()?;
        self.refuse_if_calibrating()?;
        self.settings = settings;
        self.scales = Scales::from(&settings);
        self.imu.configure(Config::from(&settings));
        // The body's axes may be others now.
        self.attitude.restart();
        Ok(())
    }

    fn clear_fault(&mut self) -> Result<(), Refusal> {
        // Of the causes, only the sensor's can last: the motors are off, the host is heard, the program runs.
        let of_imu = matches!(self.latch.get(), Fault::ImuSilent | Fault::ImuBusStuck | Fault::ImuFrozen);
        if of_imu && self.imu.fault() != Fault::None {
            return Err(Refusal::Faulted);
        }
        self.latch.clear();
        Ok(())
    }

    /// Latches a fault and stops the motors.
    fn raise(&mut self, fault: Fault) {
        if self.latch.set(fault) {
            self.stop();
            self.calibrating = None;
        }
    }

    fn refuse_if_faulted(&self) -> Result<(), Refusal> {
        if self.latch.is_set() { Err(Refusal::Faulted) } else { Ok(()) }
    }

    fn refuse_if_running(&self) -> Result<(), Refusal> {
        if self.is_running() { Err(Refusal::Running) } else { Ok(()) }
    }

    fn refuse_if_calibrating(&self) -> Result<(), Refusal> {
        if self.calibrating.is_some() { Err(Refusal::Calibrating) } else { Ok(()) }
    }
}

/// A number of at most three digits.
const fn decimal(digits: &str) -> u8 {
    let digits = digits.as_bytes();
    let mut value = 0;
    let mut index = 0;
    while index < digits.len() {
        value = value * 10 + (digits[index] - b'0');
        index += 1;
    }
    value
}
