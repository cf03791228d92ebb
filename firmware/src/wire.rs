//! Messages as bytes, encoded by hand: the same bytes as with serde's derived code for postcard, in a quarter of the flash
//! and half the time. The derived code of the requests and answers takes 8 KB here, a quarter of the chip.
//!
//! The crate `protocol` is the definition: the tests compare both codes for every message, and fail if one changes without
//! the other. The number of a variant is one byte; numbers have a fixed width and are little-endian, except for two that
//! postcard writes in groups of seven bits, the lowest first.

#[cfg(doc)]
use protocol::Reply;
use protocol::frame::{self, MAX_FRAME};
use protocol::units::{AccelRange, Axis, AxisMap, CentiRpm, GyroRange, Micros, SensorCounts};
use protocol::{Calibration, Command, Info, Refusal, Request, Settings, Telemetry};

/// A frame being written.
pub struct Writer {
    buffer: [u8; MAX_FRAME],
    /// Bytes of payload.
    length: u8,
}

impl Default for Writer {
    fn default() -> Self {
        Self { buffer: [0; MAX_FRAME], length: 0 }
    }
}

impl Writer {
    /// Writes [`Reply::Info`] to the request numbered `to`.
    #[inline(never)]
    pub fn info(&mut self, to: u8, info: &Info) {
        self.reply(to, 0);
        self.byte(info.protocol);
        self.bytes(&info.firmware);
        self.bytes(&info.git_hash);
        self.flag(info.git_dirty);
        self.varint(info.board_id);
        self.byte(info.imu_id);
        self.byte(info.gyro_range as u8);
        self.byte(info.accel_range as u8);
        self.flag(info.settings_stored);
        self.byte(info.reset_cause as u8);
        self.u16(info.boot_count);
    }

    /// Writes [`Reply::Done`].
    pub fn done(&mut self, to: u8) {
        self.reply(to, 1);
    }

    /// Writes [`Reply::Refused`].
    pub fn refused(&mut self, to: u8, refusal: Refusal) {
        self.reply(to, 2);
        self.byte(refusal as u8);
    }

    /// Writes [`Reply::Settings`].
    pub fn settings(&mut self, to: u8, settings: &Settings) {
        self.reply(to, 3);
        self.all_of(settings);
    }

    /// Writes [`Reply::Calibration`].
    pub fn calibration(&mut self, to: u8, calibration: &Calibration) {
        self.reply(to, 4);
        self.flag(calibration.still);
        self.floats(&calibration.bias);
        self.u16(calibration.noise);
        self.u16(calibration.samples);
    }

    /// Writes [`Reply::Pong`].
    pub fn pong(&mut self, to: u8, time: Micros) {
        self.reply(to, 5);
        self.u32(time.0);
    }

    /// Writes a frame of the stream.
    #[inline(never)]
    pub fn telemetry(&mut self, telemetry: &Telemetry) {
        self.byte(1);
        self.u16(telemetry.seq.0);
        self.u32(telemetry.time.0);
        for part in &telemetry.attitude.0 {
            self.u16(part.0 as u16);
        }
        self.sensor(&telemetry.gyro);
        self.sensor(&telemetry.accel);
        self.u16(telemetry.temperature.0 as u16);
        self.speeds(&telemetry.target);
        self.speeds(&telemetry.speed);
        for duty in &telemetry.duty {
            self.u16(duty.0 as u16);
        }
        for position in &telemetry.encoder {
            self.u32(position.0 as u32);
        }
        self.byte(telemetry.state as u8);
        self.byte(telemetry.fault as u8);
        self.flag(telemetry.imu_fresh);
        for count in [telemetry.unsent, telemetry.imu_errors, telemetry.bad_frames, telemetry.missed_ticks] {
            self.u16(count.0);
        }
    }

    /// Writes the request [`Command::WriteSettings`].
    #[inline(never)]
    pub fn write_settings(&mut self, seq: u8, settings: &Settings) {
        self.byte(seq);
        self.byte(7);
        self.all_of(settings);
    }

    /// Returns the frame.
    pub fn finish(&mut self) -> &[u8] {
        // Every message fits, as the tests show.
        frame::seal(&mut self.buffer, usize::from(self.length)).map(|frame| &*frame).unwrap_or_default()
    }

    #[inline(never)]
    fn reply(&mut self, to: u8, variant: u8) {
        self.bytes(&[0, to, variant]);
    }

    #[inline(never)]
    fn all_of(&mut self, settings: &Settings) {
        self.u16(settings.board_id);
        self.byte(settings.gyro_range as u8);
        self.byte(settings.accel_range as u8);
        self.byte(settings.low_pass);
        self.axes(settings.gyro_axes);
        self.axes(settings.accel_axes);
        self.floats(&settings.gyro_bias);
        self.floats(&[
            settings.attitude_kp,
            settings.attitude_ki,
            settings.speed_kp,
            settings.speed_ki,
            settings.counts_per_turn,
        ]);
        self.flags(settings.motor_reversed);
        self.flags(settings.encoder_reversed);
        self.u16(settings.deadline_ms);
    }

    fn axes(&mut self, map: AxisMap) {
        for axis in map.0 {
            self.byte(axis as u8);
        }
    }

    #[inline(never)]
    fn sensor(&mut self, counts: &[SensorCounts; 3]) {
        for counts in counts {
            self.u16(counts.0 as u16);
        }
    }

    #[inline(never)]
    fn speeds(&mut self, speeds: &[CentiRpm; 2]) {
        for speed in speeds {
            self.u16(speed.0 as u16);
        }
    }

    fn flags(&mut self, flags: [bool; 2]) {
        for flag in flags {
            self.flag(flag);
        }
    }

    fn floats(&mut self, floats: &[f32]) {
        for float in floats {
            self.u32(float.to_bits());
        }
    }

    fn flag(&mut self, flag: bool) {
        self.byte(u8::from(flag));
    }

    #[inline(never)]
    fn u32(&mut self, number: u32) {
        self.bytes(&number.to_le_bytes());
    }

    #[inline(never)]
    fn u16(&mut self, number: u16) {
        let [low, high] = number.to_le_bytes();
        self.byte(low);
        self.byte(high);
    }

    fn varint(&mut self, mut number: u16) {
        while number > 0x7F {
            self.byte(number as u8 | 0x80);
            number >>= 7;
        }
        self.byte(number as u8);
    }

    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.byte(*byte);
        }
    }

    #[inline(never)]
    fn byte(&mut self, byte: u8) {
        self.length += 1;
        if let Some(place) = self.buffer.get_mut(usize::from(self.length)) {
            *place = byte;
        }
    }
}

/// Returns the request in a frame's payload, or `None` if there is none.
#[inline(never)]
pub fn read_request(payload: &[u8]) -> Option<Request> {
    let mut reader = Reader { payload, is_wrong: false };
    let seq = reader.byte();
    let command = match reader.byte() {
        0 => Command::Hello,
        1 => Command::SetSpeeds([CentiRpm(reader.u16() as i16), CentiRpm(reader.u16() as i16)]),
        2 => Command::Stop,
        3 => Command::Stream { rate_hz: reader.byte() },
        4 => Command::CalibrateGyro { duration_ms: reader.varint() },
        5 => Command::ReadCalibration,
        6 => Command::ReadSettings,
        7 => Command::WriteSettings(reader.settings()),
        8 => Command::SaveSettings,
        9 => Command::Ping,
        10 => Command::ClearFault,
        _ => return None,
    };
    (!reader.is_wrong && reader.payload.is_empty()).then_some(Request { seq, command })
}

/// A payload being read. Errors are collected and checked once, at the end.
struct Reader<'a> {
    payload: &'a [u8],
    is_wrong: bool,
}

impl Reader<'_> {
    fn settings(&mut self) -> Settings {
        Settings {
            board_id: self.u16(),
            gyro_range: match self.byte() {
                0 => GyroRange::Dps250,
                1 => GyroRange::Dps500,
                2 => GyroRange::Dps1000,
                3 => GyroRange::Dps2000,
                _ => self.wrong(),
            },
            accel_range: match self.byte() {
                0 => AccelRange::G2,
                1 => AccelRange::G4,
                2 => AccelRange::G8,
                3 => AccelRange::G16,
                _ => self.wrong(),
            },
            low_pass: self.byte(),
            gyro_axes: self.axes(),
            accel_axes: self.axes(),
            gyro_bias: [0; 3].map(|_| self.float()),
            attitude_kp: self.float(),
            attitude_ki: self.float(),
            speed_kp: self.float(),
            speed_ki: self.float(),
            counts_per_turn: self.float(),
            motor_reversed: self.flags(),
            encoder_reversed: self.flags(),
            deadline_ms: self.u16(),
        }
    }

    #[inline(never)]
    fn axes(&mut self) -> AxisMap {
        AxisMap([0; 3].map(|_| match self.byte() {
            0 => Axis::PlusX,
            1 => Axis::MinusX,
            2 => Axis::PlusY,
            3 => Axis::MinusY,
            4 => Axis::PlusZ,
            5 => Axis::MinusZ,
            _ => {
                self.is_wrong = true;
                Axis::PlusX
            }
        }))
    }

    #[inline(never)]
    fn flags(&mut self) -> [bool; 2] {
        [0; 2].map(|_| {
            let byte = self.byte();
            self.is_wrong |= byte > 1;
            byte == 1
        })
    }

    #[inline(never)]
    fn float(&mut self) -> f32 {
        f32::from_le_bytes([0; 4].map(|_| self.byte()))
    }

    #[inline(never)]
    fn u16(&mut self) -> u16 {
        u16::from_le_bytes([0; 2].map(|_| self.byte()))
    }

    fn varint(&mut self) -> u16 {
        let mut number = 0;
        for shift in [0, 7, 14] {
            let byte = self.byte();
            number |= u16::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                // The last group has two bits, and only the first may be empty.
                self.is_wrong |= (shift == 14 && byte > 0b11) || (shift > 0 && byte == 0);
                return number;
            }
        }
        self.wrong()
    }

    #[inline(never)]
    fn byte(&mut self) -> u8 {
        match self.payload.split_first() {
            Some((byte, rest)) => {
                self.payload = rest;
                *byte
            }
            None => self.wrong(),
        }
    }

    fn wrong<T: Default>(&mut self) -> T {
        self.is_wrong = true;
        T::default()
    }
}
