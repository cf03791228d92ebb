//! On the board, a structure in memory is its bytes on the wire: the processor is little-endian and leaves no gaps. So
//! the board copies whole structures, while the computer takes field after field; this saves a sixth of the image. The
//! tests of the emulated board compare the two.

use crate::{FaultRecord, Request, Settings};

impl Request {
    /// Reads a request from a frame's payload, if it is one.
    pub fn read(payload: &[u8]) -> Option<Self> {
        #[cfg(target_arch = "avr")]
        return board::read_request(payload);
        #[cfg(not(target_arch = "avr"))]
        return crate::frame::read(payload).ok();
    }
}

impl Settings {
    /// Reads settings from their bytes, if these are settings.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        #[cfg(target_arch = "avr")]
        return zerocopy::TryFromBytes::try_read_from_bytes(bytes).ok();
        #[cfg(not(target_arch = "avr"))]
        return crate::frame::read(bytes).ok();
    }
}

impl FaultRecord {
    /// Reads a record from its bytes, if these are a record.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        #[cfg(target_arch = "avr")]
        return zerocopy::TryFromBytes::try_read_from_bytes(bytes).ok();
        #[cfg(not(target_arch = "avr"))]
        return crate::frame::read(bytes).ok();
    }
}

#[cfg(target_arch = "avr")]
mod board {
    use crate::{Calibration, Command, FaultRecord, Info, Request, SetPoint, Settings, Telemetry};
    use serde::ser::SerializeTuple;
    use serde::{Serialize, Serializer};
    use zerocopy::{IntoBytes, TryFromBytes};

    macro_rules! serialize_as_in_memory {
        ($($name:ident),*) => {$(
            impl Serialize for $name {
                fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                    serialize(self.as_bytes(), serializer)
                }
            }
        )*};
    }

    serialize_as_in_memory!(Calibration, FaultRecord, Info, SetPoint, Settings, Telemetry);

    #[inline(never)]
    fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(bytes.len())?;
        // Four bytes at once take half the time: postcard copies a number of four bytes unchanged.
        let (fours, rest) = bytes.as_chunks();
        for four in fours {
            tuple.serialize_element(&f32::from_le_bytes(*four))?;
        }
        for byte in rest {
            tuple.serialize_element(byte)?;
        }
        tuple.end()
    }

    #[inline(never)]
    pub fn read_request(payload: &[u8]) -> Option<Request> {
        // Commands differ in length on the wire; in memory all of them take the space of the longest.
        let mut bytes = [0; size_of::<Request>()];
        bytes.get_mut(..payload.len())?.copy_from_slice(payload);
        let request = Request::try_ref_from_bytes(&bytes).ok()?;
        (payload.len() == 2 + usize::from(fields(&request.command))).then_some(*request)
    }

    /// Returns the number of bytes of a command's fields.
    fn fields(command: &Command) -> u8 {
        match command {
            Command::Hello
            | Command::Stop
            | Command::ReadCalibration
            | Command::ReadSettings
            | Command::SaveSettings
            | Command::Ping
            | Command::ClearFault
            | Command::Align => 0,
            Command::SetSpeeds(speeds) => size(speeds),
            Command::Stream { rate_hz } => size(rate_hz),
            Command::CalibrateGyro { duration_ms } => size(duration_ms),
            Command::WriteSettings(settings) => size(settings),
            Command::SetPoint { index, point } => size(index) + size(point),
            Command::StartSchedule { count, at } => size(count) + size(at),
            Command::Drive { duty, duration_ms } => size(duty) + size(duration_ms),
            Command::ReadFault { index } => size(index),
            Command::TurnTo { position, speed } => size(position) + size(speed),
            Command::ReadNote { index } => size(index),
            Command::WriteNote { index, byte } => size(index) + size(byte),
        }
    }

    fn size<T>(_: &T) -> u8 {
        size_of::<T>() as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Command;

    #[test]
    fn what_is_whole_is_read_and_nothing_else() {
        let mut buffer = [0; 128];
        let request = Request { seq: 200, command: Command::CalibrateGyro { duration_ms: 1234 } };
        let bytes = postcard::to_slice(&request, &mut buffer).unwrap();
        assert_eq!((Request::read(bytes), Request::read(&bytes[1..])), (Some(request), None));
        let settings = Settings { board_id: 1234, attitude_kp: 0.7, ..Settings::DEFAULT };
        let bytes = postcard::to_slice(&settings, &mut buffer).unwrap();
        assert_eq!((Settings::read(bytes), Settings::read(&bytes[1..])), (Some(settings), None));
        let record = FaultRecord { boot: 513, ..FaultRecord::default() };
        let bytes = postcard::to_slice(&record, &mut buffer).unwrap();
        assert_eq!((FaultRecord::read(bytes), FaultRecord::read(&bytes[1..])), (Some(record), None));
    }
}
