//! The bytes on the wire: sizes, golden file, round trips, rejection of damage.

mod damage;
mod messages;

use messages::{any_message, any_request, samples};
use proptest::prelude::*;
use protocol::frame::{Accumulator, FrameError, MAX_FRAME, decode, encode};
use protocol::units::{AccelRange, Axis, GyroRange};
use protocol::{
    Bridge, Command, Fault, Info, Message, Refusal, Reply, Request, ResetCause, SCHEMA, SpeedFrom, State, Telemetry,
    VERSION,
};
use serde_reflection::{Samples, Tracer, TracerConfig};
use sha2::{Digest, Sha256};

fn frame_of<T: serde::Serialize>(message: &T) -> Vec<u8> {
    encode(message, &mut [0; MAX_FRAME]).unwrap().to_vec()
}

/// A change of any byte on the wire shows here. It needs a new [`VERSION`]; then write the new file with
/// `BIFLAG_WRITE_GOLDEN=1 cargo test -p protocol`.
#[test]
fn golden_bytes_are_unchanged() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/wire/golden.txt");
    let lines: Vec<String> = samples()
        .into_iter()
        .map(|(name, frame)| {
            let hex: String = frame.iter().map(|byte| format!("{byte:02x}")).collect();
            format!("{name} {} {hex}\n", frame.len())
        })
        .collect();
    let schema: String = SCHEMA.iter().map(|byte| format!("{byte:02x}")).collect();
    let now = format!("protocol version {VERSION}, schema {schema}: message, bytes, frame\n{}", lines.concat());
    if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
        std::fs::write(path, &now).unwrap();
    }
    assert_eq!(std::fs::read_to_string(path).unwrap(), now);
}

/// The formats of all messages: each structure's fields, each enumeration's variants with their numbers, and the width of
/// each number.
fn schema() -> String {
    let mut tracer = Tracer::new(TracerConfig::default());
    let samples = Samples::new();
    tracer.trace_type::<Request>(&samples).unwrap();
    tracer.trace_type::<Message>(&samples).unwrap();
    tracer.trace_type::<Command>(&samples).unwrap();
    tracer.trace_type::<Reply>(&samples).unwrap();
    let registry = tracer.registry().unwrap();
    let structures = registry.iter().map(|(name, format)| format!("{name}: {format:?}\n"));
    let enumerations = [
        variants::<Refusal>("Refusal"),
        variants::<ResetCause>("ResetCause"),
        variants::<State>("State"),
        variants::<Fault>("Fault"),
        variants::<GyroRange>("GyroRange"),
        variants::<AccelRange>("AccelRange"),
        variants::<Axis>("Axis"),
        variants::<Bridge>("Bridge"),
        variants::<SpeedFrom>("SpeedFrom"),
    ];
    structures.chain(enumerations).collect()
}

/// The variants of an enumeration without data, each with its byte.
fn variants<T: serde::de::DeserializeOwned + std::fmt::Debug>(name: &str) -> String {
    let known = |byte: u8| postcard::from_bytes::<T>(&[byte]).ok().map(|variant| format!(" {byte} {variant:?}"));
    format!("{name}:{}\n", (0..=u8::MAX).filter_map(known).collect::<String>())
}

/// A change of the format of any message shows here, and in the handshake as another [`SCHEMA`]. Write the new file like
/// that of the golden bytes.
#[test]
fn the_handshake_carries_the_hash_of_the_schema() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/wire/schema.txt");
    let schema = schema();
    if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
        std::fs::write(path, &schema).unwrap();
    }
    assert!(std::fs::read_to_string(path).unwrap() == schema, "the formats are not those of {path}");
    let hash = Sha256::digest(schema.as_bytes());
    assert_eq!(hash[..4], SCHEMA, "SCHEMA is to be {:#04x?}", &hash[..4]);
}

#[test]
fn faults_are_listed_by_their_numbers() {
    for (number, fault) in Fault::ALL.into_iter().enumerate() {
        assert_eq!(postcard::to_slice(&fault, &mut [0; 2]).unwrap(), [number as u8]);
    }
    assert!(postcard::from_bytes::<Fault>(&[Fault::ALL.len() as u8]).is_err());
}

/// The table in the crate's documentation names each message with its size; so does this.
#[test]
fn documented_sizes_hold() {
    let documentation = include_str!("../../src/lib.rs");
    for (name, frame) in samples() {
        let cell = format!("[`{name}`]");
        let row = documentation
            .lines()
            .find(|line| line.starts_with("//! |") && line.contains(&cell))
            .unwrap_or_else(|| panic!("{name} is not in the table"));
        let cells: Vec<&str> = row.trim_start_matches("//! ").split('|').map(str::trim).collect();
        let column = cells.iter().position(|text| text.contains(&cell)).unwrap();
        assert_eq!(cells[column + 1], frame.len().to_string(), "{name}");
    }
}

#[test]
fn a_handshake_of_another_version_is_told_from_noise() {
    let info = Info { protocol: VERSION + 1, ..Info::default() };
    let mut frame = frame_of(&(0u8, 77u8, 0u8, info, [1u8, 2, 3]));
    let end = frame.len() - 1;
    assert_eq!(decode::<Message>(&mut frame[..end]), Err(FrameError::UnknownMessage(Some(VERSION + 1))));
}

#[test]
fn every_message_fits_the_buffer_in_the_worst_case() {
    // Without zero bytes COBS spends one byte a frame more than in the best case; no message is longer than 254 bytes.
    assert!(samples().iter().all(|(_, frame)| frame.len() < MAX_FRAME));
}

proptest! {
    #[test]
    fn requests_survive_the_wire(request in any_request()) {
        let mut frame = frame_of(&request);
        let end = frame.len() - 1;
        prop_assert!(frame[..end].iter().all(|byte| *byte != 0));
        prop_assert_eq!(decode::<Request>(&mut frame[..end]), Ok(request));
    }

    #[test]
    fn messages_survive_the_wire(message in any_message()) {
        let mut frame = frame_of(&message);
        let end = frame.len() - 1;
        prop_assert_eq!(decode::<Message>(&mut frame[..end]), Ok(message));
    }

    #[test]
    fn no_bytes_make_the_decoder_panic(mut bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let _ = decode::<Message>(&mut bytes.clone());
        let _ = decode::<Request>(&mut bytes);
    }

    /// A burst of damage up to sixteen bits long never passes.
    #[test]
    fn a_burst_of_damage_is_found(message in any_message(), at in 0usize..76, mask in 1u16..) {
        let mut buffer = [0; MAX_FRAME];
        let payload = postcard::to_slice(&message, &mut buffer).unwrap().to_vec();
        let mut damaged = payload.clone();
        let at = at % (payload.len() - 1);
        damaged[at] ^= mask as u8;
        damaged[at + 1] ^= (mask >> 8) as u8;
        prop_assert_ne!(protocol::frame::crc16(&payload), protocol::frame::crc16(&damaged));
    }

    /// Whatever came before, at most one frame is lost until the receiver is in step again.
    #[test]
    fn the_receiver_is_in_step_after_one_frame(
        noise in proptest::collection::vec(any::<u8>(), 0..300),
        first in any_message(),
        second in any_message(),
    ) {
        let mut accumulator = Accumulator::new();
        let line = [noise, frame_of(&first), frame_of(&second)].concat();
        let last = line.iter().filter_map(|byte| accumulator.push::<Message>(*byte)).last();
        prop_assert_eq!(last, Some(Ok(second)));
    }
}

#[test]
fn the_handshake_never_changes() {
    let mut buffer = [0; MAX_FRAME];
    let hello = postcard::to_slice(&Request { seq: 5, command: Command::Hello }, &mut buffer).unwrap();
    assert_eq!(hello, [5, 0]);
    let info = Info { protocol: 42, ..Info::default() };
    let reply = postcard::to_slice(&Message::Reply { to: 5, reply: Reply::Info(info) }, &mut buffer).unwrap();
    assert_eq!(reply[..4], [0, 5, 0, 42]);
    assert_eq!(protocol::version_of(reply), Some(42));
    let telemetry = postcard::to_slice(&Message::Telemetry(Telemetry::default()), &mut buffer).unwrap();
    assert_eq!(protocol::version_of(telemetry), None);
}
