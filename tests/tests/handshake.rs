//! The handshake with silent, noisy, outdated and disconnected boards, each of which gives a specific error.

use host::link::{Link, LinkError};
use miette::Diagnostic;
use protocol::frame::{Accumulator, MAX_FRAME, encode};
use protocol::{Info, Message, Refusal, Reply, Request, SCHEMA, Telemetry, VERSION};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::fs::File;
use std::io::{Read, Write};
use std::time::{Duration, Instant};

/// Opens a link to a pseudo-terminal whose other end is driven by `board`, and closed when it returns.
fn open(board: impl FnOnce(&mut File) + Send + 'static) -> Result<Link, LinkError> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let path = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
    let mut attributes = tcgetattr(&master).unwrap();
    attributes.make_raw();
    tcsetattr(&master, OptionalActions::Now, &attributes).unwrap();
    // The board's end can only be read once the port is open.
    let held = File::options().read(true).write(true).open(&path).unwrap();
    let mut master = File::from(master);
    // The thread is never joined: a board that blocks on a port closed by the host never wakes up.
    std::thread::spawn(move || board(&mut master));
    let link = Link::open(&path);
    drop(held);
    link
}

/// Replies to each request with the bytes returned by `answer`, until the port is closed.
fn answer_all(port: &mut File, mut answer: impl FnMut(Request) -> Vec<u8>) {
    let mut accumulator = Accumulator::new();
    let mut bytes = [0; 256];
    while let Ok(count @ 1..) = port.read(&mut bytes) {
        for byte in &bytes[..count] {
            if let Some(Ok(request)) = accumulator.push::<Request>(*byte)
                && port.write_all(&answer(request)).is_err()
            {
                return;
            }
        }
    }
}

fn frame(message: &Message) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    encode(message, &mut buffer).unwrap().to_vec()
}

fn reply(request: Request, reply: Reply) -> Vec<u8> {
    frame(&Message::Reply { to: request.seq, reply })
}

fn error(board: impl FnOnce(&mut File) + Send + 'static) -> LinkError {
    open(board).map(|link| *link.info()).expect_err("the handshake fails")
}

/// Returns endless pseudo-random bytes.
fn noise() -> impl Iterator<Item = u8> {
    let mut state = 1u32;
    std::iter::repeat_with(move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    })
}

#[test]
fn handshake_succeeds_after_noise() {
    let link = open(|port| {
        port.write_all(&noise().take(500).collect::<Vec<_>>()).unwrap();
        let info = Info { protocol: VERSION, schema: SCHEMA, board_id: 7, ..Info::default() };
        answer_all(port, |request| reply(request, Reply::Info(info)));
    });
    assert_eq!(link.unwrap().info().board_id, 7);
}

/// The board remembers the last request, and the handshake may have its number by chance.
#[test]
fn handshake_that_has_the_number_of_an_earlier_request_is_repeated() {
    for earlier in [Reply::Refused(Refusal::Running), Reply::Done] {
        let mut first = None;
        let link = open(move |port| {
            answer_all(port, |request| {
                let number = *first.get_or_insert(request.seq);
                let info = Info { protocol: VERSION, schema: SCHEMA, board_id: 7, ..Info::default() };
                reply(request, if request.seq == number { earlier } else { Reply::Info(info) })
            });
        });
        assert_eq!(link.unwrap().info().board_id, 7);
    }
}

#[test]
fn other_protocol_version_is_reported_at_once() {
    let begun = Instant::now();
    let error = error(|port| {
        answer_all(port, |request| reply(request, Reply::Info(Info { protocol: 99, ..Info::default() })));
    });
    assert!(matches!(error, LinkError::OtherVersion { theirs: 99, .. }), "{error}");
    assert!(begun.elapsed() < Link::HANDSHAKE);
}

/// What firmware of version 1 answered, byte by byte. Its `Info` had no schema.
const INFO_OF_VERSION_1: [u8; 25] = [
    0x01, 0x02, 0xc8, 0x15, 0x01, 0x01, 0x02, 0x03, 0xde, 0xad, 0xbe, 0xef, 0x01, 0xb4, 0x24, 0x68, 0x01, 0x02, 0x01,
    0x02, 0x2c, 0x01, 0x17, 0x87, 0x00,
];

fn help(error: &LinkError) -> String {
    error.help().expect("an error says what to do").to_string()
}

#[test]
fn firmware_of_version_1_is_reported_with_both_versions_and_the_command_that_helps() {
    let begun = Instant::now();
    let error = error(|port| answer_all(port, |_| INFO_OF_VERSION_1.to_vec()));
    assert!(matches!(error, LinkError::OtherVersion { theirs: 1, .. }), "{error}");
    let versions = format!("speaks protocol version 1, this biflag version {VERSION}");
    assert!(error.to_string().ends_with(&versions), "{error}");
    assert!(help(&error).contains("`biflag flash --port /dev/pts/"), "{}", help(&error));
    assert!(begun.elapsed() < Link::HANDSHAKE);
}

#[test]
fn other_messages_under_the_same_version_are_reported() {
    let begun = Instant::now();
    let error = error(|port| {
        let info = Info { protocol: VERSION, schema: SCHEMA.map(|byte| !byte), ..Info::default() };
        answer_all(port, |request| reply(request, Reply::Info(info)));
    });
    assert!(matches!(error, LinkError::OtherSchema { .. }), "{error}");
    assert!(help(&error).contains("`biflag flash --port /dev/pts/"), "{}", help(&error));
    assert!(begun.elapsed() < Link::HANDSHAKE);
}

#[test]
fn wrong_reply_is_reported() {
    let done = error(|port| answer_all(port, |request| reply(request, Reply::Done)));
    assert!(matches!(done, LinkError::WrongAnswer { .. }), "{done}");
    let refused = error(|port| answer_all(port, |request| reply(request, Reply::Refused(Refusal::Faulted))));
    assert!(matches!(refused, LinkError::Refused { .. }), "{refused}");
}

#[test]
fn port_that_disappears_during_the_handshake_is_reported() {
    for after in [0, 1, 40] {
        let begun = Instant::now();
        let error = error(move |port| {
            let mut first = [0; 64];
            let _ = port.read(&mut first);
            let _ = port.write_all(&noise().take(after).collect::<Vec<_>>());
        });
        assert!(matches!(error, LinkError::Vanished { .. }), "{error}");
        assert!(begun.elapsed() < Link::HANDSHAKE);
    }
}

/// Each of these takes the full time limit of the handshake, so they run in parallel.
#[test]
fn boards_without_reply_give_specific_errors() {
    let silent = std::thread::spawn(|| error(|port| answer_all(port, |_| Vec::new())));
    let noise_source = std::thread::spawn(|| {
        error(|port| {
            let mut noise = noise();
            while port.write_all(&noise.by_ref().take(64).collect::<Vec<_>>()).is_ok() {
                std::thread::sleep(Duration::from_millis(5));
            }
        })
    });
    let zeros = std::thread::spawn(|| {
        error(|port| {
            while port.write_all(&[0; 64]).is_ok() {
                std::thread::sleep(Duration::from_millis(5));
            }
        })
    });
    let one_way = std::thread::spawn(|| {
        error(|port| {
            while port.write_all(&frame(&Message::Telemetry(Telemetry::default()))).is_ok() {
                std::thread::sleep(Duration::from_millis(5));
            }
        })
    });
    let wrong_number = std::thread::spawn(|| {
        error(|port| {
            let info = Reply::Info(Info { protocol: VERSION, schema: SCHEMA, ..Info::default() });
            // Far from the number of the next request, which a slow answer would fit.
            answer_all(port, |request| frame(&Message::Reply { to: request.seq.wrapping_add(100), reply: info }));
        })
    });
    assert!(matches!(silent.join().unwrap(), LinkError::Silent { .. }));
    assert!(matches!(noise_source.join().unwrap(), LinkError::OtherProgram { .. }));
    assert!(matches!(zeros.join().unwrap(), LinkError::OtherProgram { .. }));
    assert!(matches!(one_way.join().unwrap(), LinkError::RequestsIgnored { .. }));
    assert!(matches!(wrong_number.join().unwrap(), LinkError::OtherProgram { .. }));
}
