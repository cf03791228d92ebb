//! The host's requests: carrying them out and answering them.

use embedded_hal::digital::OutputPin;
use embedded_hal::i2c::I2c;
use embedded_hal::pwm::SetDutyCycle;
use protocol::units::{CentiRpm, Duty, EncoderCounts, Micros, Quaternion};
use protocol::{
    Command, FAULT_RECORDS, Fault, Info, MAX_DRIVE_MS, MAX_TURN_SPEED, MessageRef, Refusal, Reply, Request, SCHEMA,
    Settings, VERSION,
};

use super::App;
use crate::TICK_MS;
use crate::calibration::GyroAverage;
use crate::gap::Gap;
use crate::guard::Guard;
use crate::imu::Config;
use crate::link::{Answer, Link, Outbox};
use crate::speed::Turn;
use crate::storage::Storage;

impl<I2C: I2c, PIN: OutputPin, PWM: SetDutyCycle, STORAGE: Storage> App<I2C, PIN, PWM, STORAGE> {
    pub(super) fn respond(&mut self, request: &Request, arrived: Micros, outbox: &mut impl Outbox) {
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
            Command::ReadCalibration if self.calibrating.is_some() => Err(Refusal::Calibrating),
            Command::ReadCalibration => return Answer::Calibration,
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
            Command::SetPoint { index, point } => match self.refuse_if_running() {
                Ok(()) if !self.schedule.set(*index, point) => Err(Refusal::OutOfRange),
                outcome => outcome,
            },
            Command::StartSchedule { count, at } => self.start_schedule(*count, *at, arrived),
            Command::Drive { duty, duration_ms } => self.drive(*duty, *duration_ms),
            Command::ReadFault { index } if *index < FAULT_RECORDS => return Answer::FaultRecord(*index),
            Command::ReadFault { .. } => Err(Refusal::OutOfRange),
            Command::TurnTo { position, speed } => self.turn_to(*position, *speed),
            Command::Align => self.align(),
            Command::ReadNote { index } => return Answer::Pong(Micros(self.store.read_note(*index))),
            Command::WriteNote { index, byte } => {
                self.refuse_if_running().map(|()| self.store.write_note(*index, *byte))
            }
        };
        Answer::from(outcome)
    }

    #[inline(never)]
    pub(super) fn answer(&mut self, to: u8, answer: Answer, outbox: &mut impl Outbox) {
        let reply = match answer {
            Answer::Done => Reply::Done,
            Answer::Refused(refusal) => Reply::Refused(refusal),
            Answer::Pong(time) => Reply::Pong(time),
            Answer::Info => Reply::Info(self.info()),
            Answer::Settings => Reply::Settings(self.settings),
            Answer::Calibration => Reply::Calibration(self.calibration),
            Answer::FaultRecord(index) => Reply::FaultRecord(self.store.read_fault(index).unwrap_or_default()),
            Answer::Later => return,
        };
        Link::send(&MessageRef::Reply { to, reply: &reply }, outbox);
    }

    fn set_speeds(&mut self, target: [CentiRpm; 2]) -> Result<(), Refusal> {
        if target.iter().any(|speed| speed.0.unsigned_abs() > CentiRpm::LIMIT.0.unsigned_abs()) {
            return Err(Refusal::OutOfRange);
        }
        if self.latch.is_set() {
            return Err(Refusal::Faulted);
        }
        if self.calibrating.is_some() {
            return Err(Refusal::Calibrating);
        }
        if self.schedule.is_active() {
            return Err(Refusal::Running);
        }
        if target[0].0 | target[1].0 != 0 {
            self.refuse_without_encoders()?;
        }
        self.telemetry.phase = 0;
        self.drive_ticks = 0;
        self.turn = None;
        self.telemetry.target = target;
        if !self.is_running() {
            self.turn_off();
        }
        Ok(())
    }

    fn start_schedule(&mut self, count: u8, at: Micros, now: Micros) -> Result<(), Refusal> {
        self.refuse_unless_ready()?;
        if !self.schedule.start(count, at, now) {
            return Err(Refusal::NotASchedule);
        }
        self.telemetry.phase = 0;
        Ok(())
    }

    fn drive(&mut self, duty: [Duty; 2], duration_ms: u16) -> Result<(), Refusal> {
        let in_range = |duty: &Duty| duty.0.unsigned_abs() <= Duty::FULL.0.unsigned_abs();
        if !duty.iter().all(in_range) || !(1..=MAX_DRIVE_MS).contains(&duration_ms) {
            return Err(Refusal::OutOfRange);
        }
        self.refuse_unless_ready()?;
        self.telemetry.phase = 0;
        self.telemetry.duty = duty;
        self.drive_ticks = duration_ms.div_ceil(TICK_MS) + 1;
        if self.store.positions.may_change() {
            self.motors.drive(&duty, &self.settings);
        }
        Ok(())
    }

    fn turn_to(&mut self, position: [EncoderCounts; 2], speed: CentiRpm) -> Result<(), Refusal> {
        if !(1..=MAX_TURN_SPEED.0).contains(&speed.0) {
            return Err(Refusal::OutOfRange);
        }
        self.refuse_unless_ready()?;
        self.refuse_without_encoders()?;
        self.telemetry.phase = 0;
        self.turn = Some(Turn { position, speed });
        Ok(())
    }

    fn align(&mut self) -> Result<(), Refusal> {
        self.refuse_if_running()?;
        self.refuse_without_encoders()?;
        self.telemetry.encoder = [EncoderCounts(0); 2];
        self.store.positions.align();
        Ok(())
    }

    fn begin_calibration(&mut self, duration_ms: u16) -> Result<(), Refusal> {
        if !(100..=60_000).contains(&duration_ms) {
            return Err(Refusal::OutOfRange);
        }
        self.refuse_unless_ready()?;
        self.calibrating = Some(GyroAverage::new(duration_ms / TICK_MS));
        Ok(())
    }

    fn set_settings(&mut self, settings: &Settings) -> Result<(), Refusal> {
        if !settings.is_valid() {
            return Err(Refusal::OutOfRange);
        }
        self.refuse_if_busy()?;
        if self.settings.encoder_reversed != settings.encoder_reversed
            || self.settings.speed_from != settings.speed_from
        {
            self.store.positions.lose();
        }
        self.settings = *settings;
        self.rescale();
        self.imu.configure(Config::from(settings));
        // The new settings may map the axes differently, or have another range.
        self.attitude.restart();
        self.gap = Gap::default();
        self.telemetry.attitude = Quaternion::IDENTITY;
        Ok(())
    }

    fn clear_fault(&mut self) -> Result<(), Refusal> {
        // The causes that can last; the others are over, because the motors are off, the host is heard and the program
        // runs.
        let lasts = match self.latch.get() {
            Fault::ImuSilent | Fault::ImuBusStuck | Fault::ImuFrozen | Fault::ImuLostConfig => {
                self.imu.fault() != Fault::None
            }
            Fault::SupplyLow => self.supply.fault() != Fault::None,
            Fault::Motor1Overloaded | Fault::Motor2Overloaded => self.guards.iter().any(Guard::is_hot),
            _ => false,
        };
        if lasts {
            return Err(Refusal::Faulted);
        }
        self.latch.clear();
        Ok(())
    }

    fn info(&self) -> Info {
        // First, so that no field waits for it on the stack.
        let ram_left = (self.build.ram_left)();
        Info {
            protocol: VERSION,
            schema: SCHEMA,
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
            angles_known: self.store.positions.are_known(),
            encoder: self.telemetry.encoder,
            ram_left,
        }
    }

    /// Refuses unless the motors are off and there is neither a calibration nor a fault.
    #[inline(never)]
    fn refuse_unless_ready(&self) -> Result<(), Refusal> {
        if self.latch.is_set() { Err(Refusal::Faulted) } else { self.refuse_if_busy() }
    }

    #[inline(never)]
    fn refuse_without_encoders(&self) -> Result<(), Refusal> {
        if self.is_blind() { Err(Refusal::NoEncoders) } else { Ok(()) }
    }

    /// Refuses unless the motors are off and there is no calibration.
    #[inline(never)]
    fn refuse_if_busy(&self) -> Result<(), Refusal> {
        self.refuse_if_running()?;
        if self.calibrating.is_some() { Err(Refusal::Calibrating) } else { Ok(()) }
    }

    #[inline(never)]
    fn refuse_if_running(&self) -> Result<(), Refusal> {
        if self.is_driven() || self.schedule.is_active() { Err(Refusal::Running) } else { Ok(()) }
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

#[cfg(test)]
mod tests {
    use super::decimal;

    #[test]
    fn versions_may_have_any_number_of_digits() {
        assert_eq!(["0", "7", "10", "42", "255"].map(decimal), [0, 7, 10, 42, 255]);
    }
}
