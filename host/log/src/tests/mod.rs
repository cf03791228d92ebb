//! Logs that are intact, cut off at every byte, and damaged at every byte.

mod effort;
mod rewritten;

use super::chunk::Entry;
use super::scan::{Piece, Scanner};
use super::time::seconds;
use super::*;
use protocol::units::{CentiRpm, Count, Duty, EncoderCounts, Quaternion, SensorCounts};
use protocol::{Calibration, Command, Fault, GENUINE_IMU_ID, Reply, Settings, State, Telemetry};
use std::io::Cursor;
use std::path::Path;
use std::time::{Duration, SystemTime};

/// A trial on a rig.
fn start() -> Start {
    Start {
        identity: Identity { format: FORMAT, ..Identity::default() },
        plan: PlanMeta { text: "[speeds]\npairs = [[50, 10]]\n".to_owned(), ..PlanMeta::default() },
        trial: TrialMeta { name: "001_w1+50_w2+10".to_owned(), ..TrialMeta::default() },
        board: Some(BoardMeta { firmware: "1.2.3".to_owned(), ..BoardMeta::default() }),
        ..Start::default()
    }
}

fn host(seconds: f64) -> SystemTime {
    SystemTime::UNIX_EPOCH + Duration::from_secs(1_700_000_000) + Duration::from_secs_f64(seconds)
}

fn frame(i: u16) -> Telemetry {
    let half = f64::from(i).to_radians() / 2.0;
    Telemetry {
        seq: Count(i),
        attitude: Quaternion::from_f64([half.cos(), 0.0, 0.0, half.sin()]),
        gyro: [SensorCounts(131), SensorCounts(-262), SensorCounts(i.cast_signed())],
        accel: [SensorCounts(0), SensorCounts(0), SensorCounts(16384)],
        target: [CentiRpm(5000), CentiRpm(1000)],
        speed: [CentiRpm(4990), CentiRpm(-1001)],
        duty: [Duty(100), Duty(-20)],
        encoder: [EncoderCounts(602), EncoderCounts(-5)],
        state: State::Running,
        fault: Fault::None,
        imu_fresh: true,
        ..Telemetry::default()
    }
}

fn summary_of_trial() -> Summary {
    Summary {
        end: End::Complete,
        link: LinkStats { samples: 12, lost: 2, ..LinkStats::default() },
        ..Summary::default()
    }
}

/// A log with every kind of message, in several chunks.
fn write(path: &Path, frames: u16) {
    let settings = Settings { gyro_bias: [31.0, 0.0, 0.0], ..Settings::DEFAULT };
    let mut converter = Converter::new(settings, GENUINE_IMU_ID);
    let mut writer = Writer::create(path, &start(), host(0.0)).unwrap();
    writer.event(EventKind::Phase, "preroll", host(0.0)).unwrap();
    let command = CommandRecord {
        seq: 7,
        command: Command::Stop,
        attempts: 2,
        reply: Some(Reply::Done),
        sent: host(0.01),
        ended: host(0.03),
    };
    writer.command(&command).unwrap();
    for i in 0..frames {
        let now = host(0.1 + f64::from(i) * 0.001);
        writer.raw(&[1, 2, 3, i as u8, 0], now).unwrap();
        let board_us = 5_000_000 + u64::from(i) * 5000;
        let time_us = writer.board_time(board_us, now);
        writer.message(&converter.telemetry(&frame(i), board_us, time_us as f64 * 1e-6), now).unwrap();
        // A metadata record closes the chunk before it.
        if i % 4 == 3 {
            writer.meta(&ClockMeta { pings: i.into(), ..ClockMeta::default() }).unwrap();
        }
    }
    writer.dropout(500, 2, host(0.2)).unwrap();
    let calibration = Calibration { still: true, bias: [0.0; 3], noise: 3, samples: 1000 };
    writer.calibration(&calibration, host(0.2)).unwrap();
    writer.finish(&summary_of_trial()).unwrap();
}

fn bytes_of_log(frames: u16) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    write(&path, frames);
    std::fs::read(path).unwrap()
}

/// A message as channel, number and content.
type Plain = (u16, u32, Vec<u8>);

/// Returns the byte range of each chunk, and its messages.
fn chunks(log: &[u8]) -> Vec<(std::ops::Range<usize>, Vec<Plain>)> {
    let mut at = mcap::MAGIC.len();
    let mut chunks = Vec::new();
    while let Some((head, rest)) = log[at..].split_first_chunk::<9>() {
        let length = u64::from_le_bytes(head[1..].try_into().unwrap()) as usize;
        let end = at + 9 + length;
        if head[0] == mcap::records::op::CHUNK {
            chunks.push((at..end, chunk::unpack(&log[at..end], false).unwrap().filter_map(plain).collect()));
        }
        if head[0] == mcap::records::op::FOOTER || length > rest.len() {
            break;
        }
        at = end;
    }
    chunks
}

fn plain(entry: Entry) -> Option<Plain> {
    match entry {
        Entry::Message(header, data) => Some((header.channel_id, header.sequence, data)),
        _ => None,
    }
}

/// Returns whether the log has its first chunk, which declares the channels.
fn introduces(log: &[u8]) -> bool {
    let mut scanner = Scanner::new(Cursor::new(log)).unwrap();
    match scanner.next().unwrap() {
        Some(Piece::Chunk(mut chunk)) => matches!(chunk.next(), Some(Entry::Schema(..))),
        _ => false,
    }
}

fn read(log: &[u8]) -> (Vec<Plain>, Condition) {
    let mut scanner = Scanner::new(Cursor::new(log)).unwrap();
    let mut messages = Vec::new();
    while let Some(piece) = scanner.next().unwrap() {
        if let Piece::Chunk(chunk) = piece {
            messages.extend(chunk.filter_map(plain));
        }
    }
    (messages, scanner.condition.unwrap())
}

#[test]
fn all_messages_and_metadata_round_trip() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    write(&path, 8);
    let mut reader = Reader::open(&path).unwrap();
    let messages: Vec<Message> = reader.by_ref().map(Result::unwrap).collect();
    assert_eq!(reader.condition(), Some(Condition::Clean));
    assert!(reader.losses().is_empty());
    let counts: Vec<_> = reader.counts.iter().map(|(topic, count)| (topic.as_str(), *count)).collect();
    assert_eq!(counts, [("/command", 1), ("/dropout", 1), ("/event", 2), ("/raw", 8), ("/telemetry", 8)]);

    let telemetry: Vec<_> = messages
        .iter()
        .filter_map(|message| match &message.body {
            Body::Telemetry(telemetry) => Some((message, telemetry)),
            _ => None,
        })
        .collect();
    let (message, last) = telemetry[7];
    assert_eq!(message.sequence, 7);
    assert!((last.time_s - 0.035).abs() < 1e-12);
    assert_eq!(last.board_time_us, 5_035_000);
    assert!((last.yaw_deg - 7.0).abs() < 0.01);
    let rate = last.angular_velocity_dps.unwrap();
    assert!((rate.x - 100.0 / 131.0).abs() < 1e-12 && (rate.y + 2.0).abs() < 1e-12);
    assert!((last.acceleration_mps2.unwrap().z - 9.80665).abs() < 1e-9);
    assert_eq!(last.gyro_counts.unwrap().x, 131);
    let motor = last.motor1.unwrap();
    assert_eq!((motor.target_rpm, motor.speed_rpm, motor.duty, motor.encoder_counts), (50.0, 49.9, 100, 602));
    assert_eq!(last.state(), schema::biflag::State::Running);
    // The trial's clock is the board's: 5 ms per frame, although they arrived every millisecond.
    assert_eq!(message.log_time_ns - telemetry[0].0.log_time_ns, 35_000_000);
    assert_eq!(message.publish_time_ns - telemetry[0].0.publish_time_ns, 7_000_000);
    assert!(messages.windows(2).all(|pair| pair[0].log_time_ns <= pair[1].log_time_ns));

    let command = messages.iter().find_map(|message| match &message.body {
        Body::Command(command) => Some(command.clone()),
        _ => None,
    });
    let command = command.unwrap();
    assert_eq!((command.command.as_str(), command.reply.as_str(), command.attempts), ("Stop", "Done", 2));
    assert!((command.round_trip_s - 0.02).abs() < 1e-9);

    assert_eq!(reader.meta::<PlanMeta>().unwrap(), start().plan);
    assert_eq!(reader.meta::<TrialMeta>().unwrap(), start().trial);
    assert_eq!(reader.meta::<BoardMeta>(), start().board);
    assert_eq!(reader.meta::<ClockMeta>().unwrap().pings, 7);
    assert!(reader.meta::<CalibrationMeta>().unwrap().still);
    assert_eq!(reader.meta::<Identity>().unwrap().format, FORMAT);
    assert_eq!(reader.meta::<Summary>(), Some(summary_of_trial()));
    assert_eq!(summary(&path).unwrap(), Some(summary_of_trial()));
}

#[test]
fn log_cut_anywhere_keeps_every_chunk_before_the_cut() {
    let log = bytes_of_log(8);
    let chunks = chunks(&log);
    let all: Vec<Plain> = chunks.iter().flat_map(|(_, messages)| messages.clone()).collect();
    assert!(chunks.len() >= 4 && all.len() >= 20);
    // `make hostile` cuts a recorded log at every byte.
    for cut in (0..log.len()).step_by(7) {
        let (messages, condition) = read(&log[..cut]);
        let whole: usize =
            chunks.iter().filter(|(range, _)| range.end <= cut).map(|(_, messages)| messages.len()).sum();
        assert!(messages.len() >= whole, "cut at {cut}");
        assert_eq!(messages, all[..messages.len()], "cut at {cut}");
        assert!(condition != Condition::Clean && (condition == Condition::CutOff || cut < 8), "cut at {cut}");
    }
    assert_eq!(read(&log), (all, Condition::Clean));
}

#[test]
fn one_wrong_byte_loses_at_most_its_chunk() {
    let log = bytes_of_log(8);
    let chunks = chunks(&log);
    let mut broken = log.clone();
    // Every byte would take over a minute; `make hostile` changes every byte of a recorded log.
    for at in (0..log.len()).step_by(31) {
        for flip in [0xFF, 0x01] {
            broken[at] = log[at] ^ flip;
            let (messages, condition) = read(&broken);
            assert_ne!(condition, Condition::Clean, "byte {at}");
            let mut rest = messages.as_slice();
            for (range, expected) in &chunks {
                // A wrong byte in a chunk's head may leave its messages intact.
                if let Some(after) = rest.strip_prefix(expected.as_slice()) {
                    rest = after;
                } else {
                    assert!(
                        range.contains(&at),
                        "byte {at} ({} to {}) cost the chunk at {range:?}",
                        log[at],
                        broken[at]
                    );
                }
            }
            assert!(introduces(&broken) || chunks[0].0.contains(&at), "byte {at} cost the first chunk");
            assert!(rest.is_empty(), "byte {at} gave messages that were never written");
        }
        broken[at] = log[at];
    }
}

#[test]
fn partial_chunk_is_unpacked_as_far_as_possible() {
    // zstd compresses in blocks of 128 KiB; the raw bytes here are incompressible, so some blocks end before the cut.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = Writer::create(&path, &start(), host(0.0)).unwrap();
    let mut state = 1u32;
    let noise: Vec<u8> = std::iter::repeat_with(|| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    })
    .take(1000)
    .collect();
    for i in 0..500u16 {
        let bytes: Vec<u8> =
            noise.iter().map(|byte| byte.wrapping_mul(i as u8 | 1).wrapping_add((i >> 7) as u8)).collect();
        writer.raw(&bytes, host(0.0)).unwrap();
    }
    writer.finish(&Summary::default()).unwrap();
    let log = std::fs::read(&path).unwrap();
    let (range, messages) = chunks(&log).into_iter().max_by_key(|(range, _)| range.len()).unwrap();
    let (kept, condition) = read(&log[..range.end - 1000]);
    assert_eq!(condition, Condition::CutOff);
    assert!(kept.len() > messages.len() / 4, "{} of {}", kept.len(), messages.len());
    assert!(kept.iter().zip(&messages).all(|(kept, written)| kept == written));
}

#[test]
fn recovery_writes_an_intact_log_and_lists_the_losses() {
    let folder = tempfile::tempdir().unwrap();
    let [from, to, again] = ["a.mcap", "b.mcap", "c.mcap"].map(|name| folder.path().join(name));
    let log = bytes_of_log(16);
    let chunks = chunks(&log);
    let (lost, _) = &chunks[2];
    let mut broken = log[..log.len() - 100].to_vec();
    broken[lost.start + 60] ^= 0x55;
    std::fs::write(&from, &broken).unwrap();

    let recovery = recover(&from, &to).unwrap();
    assert_eq!(recovery.condition, Condition::Damaged);
    assert_eq!(recovery.losses[0].offset, lost.start as u64);
    assert_eq!(recovery.losses[0].what, "a chunk");
    assert_eq!(recovery.strays, 0);
    let expected: u64 = chunks.iter().filter(|(range, _)| range != lost).map(|(_, m)| m.len() as u64).sum();
    assert_eq!(recovery.messages, expected);
    let mut reader = Reader::open(&to).unwrap();
    assert_eq!(reader.by_ref().map(Result::unwrap).count() as u64, expected);
    assert_eq!(reader.condition(), Some(Condition::Clean));
    assert_eq!(reader.meta::<Summary>(), Some(summary_of_trial()));
    assert!(reader.meta::<RecoveryMeta>().unwrap().lost.contains("a chunk"));

    assert!(matches!(recover(&from, &to), Err(LogError::Exists { .. })));
    let clean = recover(&to, &again).unwrap();
    assert_eq!((clean.condition, clean.messages), (Condition::Clean, expected));
}

#[test]
fn messages_keep_their_channels_without_the_chunk_that_declares_them() {
    let folder = tempfile::tempdir().unwrap();
    let [from, to] = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
    let mut log = bytes_of_log(8);
    let (introduction, messages) = &chunks(&log)[0];
    assert!(messages.is_empty());
    log[introduction.start + 100] ^= 1;
    std::fs::write(&from, &log).unwrap();
    let mut reader = Reader::open(&from).unwrap();
    assert!(reader.by_ref().all(|message| !matches!(message.unwrap().body, Body::Other(_))));
    assert_eq!(reader.counts["/telemetry"], 8);
    assert_eq!(recover(&from, &to).unwrap().strays, 0);
}

#[test]
fn other_files_are_rejected_with_specific_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let error = |content: &[u8]| {
        std::fs::write(&path, content).unwrap();
        Reader::open(&path).map(drop).unwrap_err()
    };
    let log = bytes_of_log(4);
    assert!(matches!(error(b""), LogError::Empty { .. }));
    assert!(matches!(error(b"hello, this is a text and no log at all"), LogError::NotMcap { .. }));
    assert!(matches!(error(&log[..4]), LogError::NothingLeft { .. }));
    assert!(matches!(error(&log[..20]), LogError::NothingLeft { .. }));
    let mut foreign = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().profile("ros2").create(&mut foreign).unwrap();
    writer.add_channel(0, "/chatter", "cdr", &Default::default()).unwrap();
    writer.finish().unwrap();
    drop(writer);
    assert!(matches!(error(foreign.get_ref()), LogError::NotOurs { .. }));
    assert!(matches!(Reader::open(folder.path()), Err(LogError::NotAFile { .. })));
    assert!(matches!(Reader::open(&folder.path().join("none")), Err(LogError::Missing { .. })));

    let mut newer = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().profile(PROFILE).create(&mut newer).unwrap();
    let identity = Identity { format: FORMAT + 1, host_version: "9.0.0".to_owned(), ..Identity::default() };
    let metadata = table::to_table(&identity);
    writer.write_metadata(&mcap::records::Metadata { name: Identity::NAME.to_owned(), metadata }).unwrap();
    writer.finish().unwrap();
    drop(writer);
    assert!(matches!(error(newer.get_ref()), LogError::Version { found, .. } if found == FORMAT + 1));
}

#[test]
fn messages_reach_the_file_within_half_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = Writer::create(&path, &start(), host(0.0)).unwrap();
    writer.message(&Converter::new(Settings::DEFAULT, GENUINE_IMU_ID).telemetry(&frame(0), 0, 0.0), host(0.0)).unwrap();
    std::thread::sleep(Duration::from_millis(410));
    writer.tick().unwrap();
    writer.settle().unwrap();
    let mut reader = Reader::open(&path).unwrap();
    assert_eq!(reader.by_ref().map(Result::unwrap).count(), 1);
    assert_eq!(reader.condition(), Some(Condition::CutOff));
    assert!(summary(&path).unwrap().is_none());
    assert!(matches!(Writer::create(&path, &start(), host(0.0)), Err(LogError::Exists { .. })));
}

#[test]
#[cfg(target_os = "linux")]
fn full_disk_error_states_the_bytes_kept() {
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let error = Writer::on(full, Path::new("/full/a.mcap"), host(0.0))
        .and_then(|mut writer| {
            writer.meta(&Identity::default())?;
            writer.flush()?;
            writer.settle()
        })
        .unwrap_err();
    assert!(matches!(&error, LogError::Write { source, .. } if source.kind() == std::io::ErrorKind::StorageFull));
    assert_eq!(error.to_string(), "/full/a.mcap: cannot be written; 0 bytes were kept");
}

#[test]
fn clock_of_another_millennium_keeps_the_times_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let time = SystemTime::UNIX_EPOCH + Duration::from_secs(253_402_300_000);
    let mut writer = Writer::create(&path, &start(), time).unwrap();
    for i in 0..3 {
        let time_us = writer.board_time(i * 5000, time);
        writer
            .message(
                &Converter::new(Settings::DEFAULT, GENUINE_IMU_ID).telemetry(
                    &frame(0),
                    i * 5000,
                    time_us as f64 * 1e-6,
                ),
                time,
            )
            .unwrap();
    }
    writer.finish(&Summary::default()).unwrap();
    let times: Vec<u64> = Reader::open(&path).unwrap().map(|message| message.unwrap().log_time_ns).collect();
    assert_eq!([times[1] - times[0], times[2] - times[1]], [5_000_000; 2]);
}

#[test]
fn file_that_changes_while_it_is_written_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let changed = |change: &dyn Fn(&Path)| {
        let path = folder.path().join("a.mcap");
        let mut writer = Writer::create(&path, &start(), host(0.0)).unwrap();
        writer.event(EventKind::Note, "one", host(0.0)).unwrap();
        change(&path);
        let finished = writer.finish(&Summary::default());
        let _ = std::fs::remove_file(&path);
        finished
    };
    changed(&|_| {}).unwrap();
    let open = |path: &Path| std::fs::File::options().write(true).open(path).unwrap();
    let cases: [&dyn Fn(&Path); 4] = [
        &|path| std::fs::remove_file(path).unwrap(),
        &|path| open(path).set_len(100).unwrap(),
        &|path| std::io::Write::write_all(&mut open(path), b"x").unwrap(),
        &|path| {
            std::fs::remove_file(path).unwrap();
            write(path, 4);
        },
    ];
    for case in cases {
        assert!(matches!(changed(case), Err(LogError::Changed { .. })));
    }
}

/// The time of an event is read back exactly as it was written.
#[test]
fn times_are_the_same_again() {
    for time_s in [15.0, 30.0, 60.0, 120.0, 86_400.0, 6.9, 0.035] {
        assert_eq!(seconds((time_s * 1e9) as u64), time_s);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let start = Start { identity: Identity { origin: Origin::Model, ..start().identity }, ..start() };
    let mut writer = Writer::create(&path, &start, SystemTime::UNIX_EPOCH).unwrap();
    let mut converter = Converter::new(Settings::DEFAULT, GENUINE_IMU_ID);
    writer.board_time(0, SystemTime::UNIX_EPOCH);
    writer.message(&converter.telemetry(&frame(0), 0, 0.0), SystemTime::UNIX_EPOCH).unwrap();
    for time_s in [30.0, 60.0, 120.0] {
        writer.at(time_s);
        assert_eq!(writer.time_s(), time_s);
        writer.event(EventKind::Phase, "end", SystemTime::UNIX_EPOCH).unwrap();
    }
    writer.finish(&Summary::default()).unwrap();
    let mut clock = TrialClock::default();
    let times: Vec<f64> = (Reader::open(&path).unwrap().map(Result::unwrap))
        .map(|message| {
            clock.see(&message);
            clock.time_s(&message)
        })
        .collect();
    assert_eq!(times, [0.0, 30.0, 60.0, 120.0]);
}

/// A forged summary with counters that would overflow every sum counts as damage.
#[test]
fn summary_with_impossible_counters_is_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let [path, copy] = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
    for most in [u64::MAX, u64::MAX / 2] {
        for key in 0..6 {
            let mut counters = [0; 6];
            counters[key] = most;
            let [samples, lost, repeated, crc_errors, resyncs, retries] = counters;
            let link = LinkStats { samples, lost, repeated, crc_errors, resyncs, retries };
            let _ = std::fs::remove_file(&path);
            let writer = Writer::create(&path, &start(), host(0.0)).unwrap();
            writer.finish(&Summary { end: End::Complete, link, ..Summary::default() }).unwrap();
            assert_eq!(summary(&path).unwrap(), None, "{link:?}");
            let losses = check(&path).unwrap();
            assert_eq!(losses.iter().map(|loss| loss.what).collect::<Vec<_>>(), ["a metadata record"], "{link:?}");
            let mut sum = link;
            sum += link;
            assert_eq!((sum.samples, sum.lost), (samples.saturating_mul(2), lost.saturating_mul(2)));
        }
    }
    recover(&path, &copy).unwrap();
    assert_eq!(check(&copy).unwrap(), []);
}
