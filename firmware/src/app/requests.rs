//! The host's requests: carrying them out and answering them.

use embedded_hal::digital::OutputPin;
use embedded_hal::i2c::I2c;
use embedded_hal::pwm::SetDutyCycle;
use protocol::units::{CentiRpm, Micros, Quaternion};
use protocol::{Command, Fault, Info, Refusal, Request, Settings, VERSION};

use super::App;
use crate::TICK_MS;
use crate::calibration::GyroAverage;
use crate::imu::Config;
use crate::link::{Answer, Link, Outbox};
use crate::settings::Storage;
use crate::wire::Writer;

impl<I2C, PIN, PWM, STORAGE> App<I2C, PIN, PWM, STORAGE>
where
    I2C: I2c,
    PIN: OutputPin,
    PWM: SetDutyCycle,
    STORAGE: Storage,
{
    #[inline(never)]
    pub(super) fn respond(&mut self, request: &Request, arrived: Micros, outbox: &mut Outbox) {
        let answer = match self.link.repetition(request) {
            Some(answer) => answer,
            None => self.carry_out(request, arrived),
        };
        self.link.remember(request.seq, answer);
        self.answer(request.seq, answer, outbox);
    }

    /// Carries out a request and returns its answer.
    #[inline(never)]
    fn carry_out(&mut self, request: &Request, arrived: Micros) -> Answer {
        let outcome = match &request.command {
            Command::Hello => return Answer::Info,
            Command::Ping => return Answer::Pong(arrived),
            Command::ReadSettings => return Answer::Settings,
            Command::ReadCalibration => match self.refuse_if_calibrating() {
                Ok(()) => return Answer::Calibration,
                refused => refused,
            },
            Command::SaveSettings => {
                self.save_request = request.seq;
                self.store.begin_save();
                return Answer::Later;
            }
            Command::SetSpeeds(target) => self.set_speeds(*target),
            Command::Stop => {
                self.stop();
                Ok(())
            }
            Command::Stream { rate_hz } => self.link.set_stream(*rate_hz),
            Command::CalibrateGyro { duration_ms } => self.begin_calibration(*duration_ms),
            Command::WriteSettings(settings) => self.set_settings(settings),
            Command::ClearFault => self.clear_fault(),
        };
        Answer::from(outcome)
    }

    #[inline(never)]
    pub(super) fn answer(&self, to: u8, answer: Answer, outbox: &mut Outbox) {
        let mut writer = Writer::default();
        match answer {
            Answer::Done => writer.done(to),
            Answer::Refused(refusal) => writer.refused(to, refusal),
            Answer::Pong(time) => writer.pong(to, time),
            Answer::Info => writer.info(to, &self.info()),
            Answer::Settings => writer.settings(to, &self.settings),
            Answer::Calibration => writer.calibration(to, &self.calibration),
            Answer::Later => return,
        }
        Link::send(writer.finish(), outbox);
    }

    fn set_speeds(&mut self, target: [CentiRpm; 2]) -> Result<(), Refusal> {
        if target.iter().any(|speed| speed.0.unsigned_abs() > CentiRpm::LIMIT.0.unsigned_abs()) {
            return Err(Refusal::OutOfRange);
        }
        self.refuse_if_faulted()?;
        self.refuse_if_calibrating()?;
        self.telemetry.target = target;
        if !self.is_running() {
            self.stop();
        }
        Ok(())
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
    fn set_settings(&mut self, settings: &Settings) -> Result<(), Refusal> {
        if !settings.is_valid() {
            return Err(Refusal::OutOfRange);
        }
        self.refuse_if_running()?;
        self.refuse_if_calibrating()?;
        self.settings = *settings;
        self.rescale();
        self.imu.configure(Config::from(settings));
        // The new settings may map the axes differently.
        self.attitude.restart();
        self.telemetry.attitude = Quaternion::IDENTITY;
        Ok(())
    }

    fn clear_fault(&mut self) -> Result<(), Refusal> {
        // Only a cause in the sensor can last: the motors are off, the host is heard, the program runs.
        let of_imu = matches!(self.latch.get(), Fault::ImuSilent | Fault::ImuBusStuck | Fault::ImuFrozen);
        if of_imu && self.imu.fault() != Fault::None {
            return Err(Refusal::Faulted);
        }
        self.latch.clear();
        Ok(())
    }

    #[inline(never)]
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

/// Parses a decimal number.
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
