//! The board's own encoding of messages against the derived one of the crate `protocol`.

#[path = "../../protocol/tests/wire/messages.rs"]
mod messages;

use firmware::wire::{Writer, read_request};
use messages::{any_message, any_request, samples};
use proptest::prelude::*;
use protocol::frame::{MAX_FRAME, decode, encode};
use protocol::{Command, Message, Reply, Request};

fn derived<T: serde::Serialize>(message: &T) -> Vec<u8> {
    encode(message, &mut [0; MAX_FRAME]).unwrap().to_vec()
}

fn written(message: &Message) -> Vec<u8> {
    let mut writer = Writer::default();
    match message {
        Message::Reply { to, reply } => match reply {
            Reply::Info(info) => writer.info(*to, info),
            Reply::Done => writer.done(*to),
            Reply::Refused(refusal) => writer.refused(*to, *refusal),
            Reply::Settings(settings) => writer.settings(*to, settings),
            Reply::Calibration(calibration) => writer.calibration(*to, calibration),
            Reply::Pong(time) => writer.pong(*to, *time),
        },
        Message::Telemetry(telemetry) => writer.telemetry(telemetry),
    }
    writer.finish().to_vec()
}

#[test]
fn one_of_each_message_is_written_and_read_as_derived() {
    let mut requests = 0;
    for (name, mut frame) in samples() {
        let last = frame.len() - 1;
        if name.starts_with("Command") {
            let request = decode::<Request>(&mut frame[..last]).unwrap();
            assert_eq!(read_request(&postcard::to_vec(&request)), Some(request), "{name}");
            requests += 1;
        } else {
            let message = decode::<Message>(&mut frame.clone()[..last]).unwrap();
            assert_eq!(written(&message), frame, "{name}");
        }
    }
    assert_eq!(requests, 11);
}

/// postcard without its allocator.
mod postcard {
    pub fn to_vec<T: serde::Serialize>(value: &T) -> Vec<u8> {
        ::postcard::to_slice(value, &mut [0; 100]).unwrap().to_vec()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn messages_are_written_as_derived(message in any_message()) {
        prop_assert_eq!(written(&message), derived(&message));
    }

    #[test]
    fn requests_are_read_as_derived(request in any_request()) {
        prop_assert_eq!(read_request(&postcard::to_vec(&request)), Some(request));
        if let Command::WriteSettings(settings) = request.command {
            let mut writer = Writer::default();
            writer.write_settings(request.seq, &settings);
            prop_assert_eq!(writer.finish(), &derived(&request));
        }
    }

    /// The board and the derived code read the same requests. The board refuses some that the derived code accepts, but no
    /// sender writes those: postcard also reads a variant's number with more bytes than it needs.
    #[test]
    fn damaged_requests_are_refused_as_derived(request in any_request(), at in 0usize..60, byte: u8, cut in 0usize..60) {
        let mut payload = postcard::to_vec(&request);
        if let Some(place) = payload.get_mut(at) {
            *place = byte;
        }
        payload.truncate(cut.max(1));
        let derived = match ::postcard::take_from_bytes::<Request>(&payload) {
            Ok((request, [])) => Some(postcard::to_vec(&request)),
            _ => None,
        };
        let canonical = derived.filter(|bytes| *bytes == payload);
        prop_assert_eq!(read_request(&payload).map(|request| postcard::to_vec(&request)), canonical);
    }
}
