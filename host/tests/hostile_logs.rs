//! Property tests of damaged logs: cut, overwritten, spliced, concatenated. The rest can be read, all commands agree on
//! the damage, and the recovered log is intact.

use biflag_log::{
    Body, Condition, End, EventKind, LinkStats, LogError, Origin, Reader, Summary, check, last_meta, recover, summary,
};
use host::export::{Format, export_log};
use host::plan::{Plan, board};
use host::run::{self, Recorder};
use host::session::Session;
use host::trial::{Judged, Want};
use proptest::prelude::*;
use protocol::units::{Count, Micros};
use protocol::{GENUINE_IMU_ID, Info, Settings, Telemetry};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;
use std::time::{Duration, SystemTime};

/// Damage to a log. Places and lengths are fractions of the log's length.
#[derive(Clone, Debug)]
enum Damage {
    Cut(f64),
    Flip(f64, u8),
    Fill(f64, f64, u8),
    Remove(f64, f64),
    Repeat(f64, f64),
    Insert(f64, Vec<u8>),
    /// Appends another log, starting at a place in it.
    Continue(f64, f64),
}

fn damage() -> impl Strategy<Value = Damage> {
    let short = || 0.0..0.1f64;
    prop_oneof![
        (0.0..1.0).prop_map(Damage::Cut),
        (0.0..1.0, 1u8..).prop_map(|(at, bits)| Damage::Flip(at, bits)),
        (0.0..1.0, short(), any::<u8>()).prop_map(|(at, length, byte)| Damage::Fill(at, length, byte)),
        (0.0..1.0, short()).prop_map(|(at, length)| Damage::Remove(at, length)),
        (0.0..1.0, short()).prop_map(|(at, length)| Damage::Repeat(at, length)),
        (0.0..1.0, prop::collection::vec(any::<u8>(), 1..200)).prop_map(|(at, bytes)| Damage::Insert(at, bytes)),
        (0.0..1.0, 0.0..1.0).prop_map(|(at, from)| Damage::Continue(at, from)),
    ]
}

impl Damage {
    fn apply(&self, log: &mut Vec<u8>) {
        let length = log.len();
        let place = |part: f64| (part * length as f64) as usize;
        let range = |at: f64, part: f64| place(at)..(place(at) + place(part)).min(length);
        match self {
            Self::Cut(at) => log.truncate(place(*at)),
            Self::Flip(at, bits) => {
                if let Some(byte) = log.get_mut(place(*at)) {
                    *byte ^= bits;
                }
            }
            Self::Fill(at, part, byte) => log[range(*at, *part)].fill(*byte),
            Self::Remove(at, part) => drop(log.drain(range(*at, *part))),
            Self::Repeat(at, part) => {
                let piece = log[range(*at, *part)].to_vec();
                log.splice(place(*at)..place(*at), piece);
            }
            Self::Insert(at, bytes) => drop(log.splice(place(*at)..place(*at), bytes.iter().copied())),
            Self::Continue(at, from) => {
                log.truncate(place(*at));
                log.extend(&LOG[(*from * LOG.len() as f64) as usize..]);
            }
        }
    }
}

const FRAMES: u16 = 120;

/// Returns a log with many chunks.
static LOG: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let plan = Plan::parse("[speeds]\npairs = [[50, 10]]\n", "plan.toml").unwrap();
    let host = |i: u16| SystemTime::UNIX_EPOCH + Duration::from_millis(1_700_000_000_000 + u64::from(i));
    let board = board::to_log(&Info { imu_id: GENUINE_IMU_ID, ..Info::default() }, &Settings::DEFAULT);
    let start = run::start(&plan, &plan.trials[0], 1, Origin::Rig, Some(board), host(0));
    let mut writer = Recorder::create(&path, &start, Settings::DEFAULT, host(0)).unwrap();
    writer.event(EventKind::Phase, "run", host(0)).unwrap();
    for i in 0..FRAMES {
        let frame = Telemetry { seq: Count(i), time: Micros(u32::from(i) * 5000), ..Telemetry::default() };
        writer.log.raw(&i.to_le_bytes(), host(i)).unwrap();
        writer.frame(&frame, u64::from(i) * 5000, host(i)).unwrap();
        if i % 10 == 9 {
            // A metadata record closes the chunk before it.
            writer.log.meta(&biflag_log::ClockMeta { pings: i.into(), ..Default::default() }).unwrap();
        }
    }
    let link = LinkStats { samples: FRAMES.into(), ..LinkStats::default() };
    writer.finish(&mut Summary { end: End::Complete, link, ..Summary::default() }).unwrap();
    std::fs::read(path).unwrap()
});

/// Returns the number of messages in a log, the sequence numbers of its frames, and its condition.
fn read(path: &Path) -> Result<(u64, Vec<u32>, Condition), LogError> {
    let mut reader = Reader::open(path)?;
    let (mut messages, mut frames) = (0, Vec::new());
    for message in reader.by_ref() {
        messages += 1;
        if let Body::Telemetry(frame) = message?.body {
            frames.push(frame.seq);
        }
    }
    Ok((messages, frames, reader.condition().expect("the log was read to its end")))
}

/// Applies all operations to a log; their results must be consistent.
fn abuse(folder: &Path, content: &[u8]) {
    let [path, clean, again, csv] = ["a.mcap", "b.mcap", "c.mcap", "a.csv"].map(|name| folder.join(name));
    let afresh = |paths: &[&PathBuf]| paths.iter().for_each(|path| drop(std::fs::remove_file(path)));
    afresh(&[&clean, &again, &csv]);
    std::fs::write(&path, content).unwrap();
    let ended = summary(&path).unwrap();
    last_meta::<biflag_log::RecoveryMeta>(&path).unwrap();
    let Ok((messages, frames, condition)) = read(&path) else {
        assert!(check(&path).is_err() && Judged::read(&path, Want::default()).is_err());
        assert!(recover(&path, &clean).is_err() && !clean.exists(), "no file is created from a file that is not a log");
        assert!(export_log(&path, &csv, Format::Csv, false).is_err() && !csv.exists());
        return;
    };
    let losses = check(&path).unwrap();
    assert_eq!(losses.is_empty(), condition == Condition::Clean);
    assert!(condition != Condition::Clean || ended.is_some());
    let data = Judged::read(&path, Want { forces: true, frames: true, shapes: 10, hash: true }).unwrap().data;
    assert_eq!((data.condition, &data.losses, data.link.samples), (condition, &losses, frames.len() as u64));
    assert!(frames.iter().all(|seq| *seq < u32::from(FRAMES)), "a frame that was never written");

    let exported = export_log(&path, &csv, Format::Csv, false).unwrap();
    assert_eq!((exported.rows <= frames.len(), exported.damaged.is_empty()), (true, condition == Condition::Clean));
    let recovery = recover(&path, &clean).unwrap();
    assert_eq!((recovery.messages + recovery.strays, recovery.condition), (messages, condition));
    let (kept, kept_frames, kept_condition) = read(&clean).unwrap();
    assert_eq!((kept, kept_condition), (recovery.messages, Condition::Clean));
    assert_eq!(kept_frames, frames);
    assert_eq!(last_meta::<biflag_log::RecoveryMeta>(&clean).unwrap().is_some(), condition != Condition::Clean);
    let twice = recover(&clean, &again).unwrap();
    assert_eq!((twice.messages, twice.condition), (kept, Condition::Clean));
}

#[test]
fn intact_log_has_no_losses() {
    let folder = tempfile::tempdir().unwrap();
    abuse(folder.path(), &LOG);
    assert_eq!(read(&folder.path().join("a.mcap")).unwrap().1, (0..u32::from(FRAMES)).collect::<Vec<_>>());
}

/// A forged summary whose counters overflow every sum is damage for every command, in a log and in a session.
#[test]
fn forged_counters_are_damage_for_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let plan = Plan::parse("[trial]\nrun = 12\n[speeds]\npairs = [[50, 10], [0, 45]]\n", "plan.toml").unwrap();
    let session = Session::create(&folder.path().join("session"), &plan).unwrap();
    let most = u64::MAX;
    let link = LinkStats { samples: most, lost: most, repeated: most, crc_errors: most, resyncs: most, retries: most };
    let host = SystemTime::UNIX_EPOCH + Duration::from_secs(1_700_000_000);
    let mut log = PathBuf::new();
    for trial in &plan.trials {
        let (attempt, path) = session.next_attempt(trial).unwrap();
        let board = board::to_log(&Info { imu_id: GENUINE_IMU_ID, ..Info::default() }, &Settings::DEFAULT);
        let start = run::start(&plan, trial, attempt, Origin::Rig, Some(board), host);
        let mut writer = Recorder::create(&path, &start, Settings::DEFAULT, host).unwrap();
        writer.event(EventKind::Phase, "run", host).unwrap();
        for i in 0..12 * 200u32 {
            let telemetry = Telemetry { seq: Count(i as u16), time: Micros(i * 5000), ..Telemetry::default() };
            writer.frame(&telemetry, u64::from(i) * 5000, host).unwrap();
        }
        // Two frames lost, and as many as the summary says.
        writer.dropout(7, 2, host).unwrap();
        writer.finish(&mut Summary { end: End::Complete, link, ..Summary::default() }).unwrap();
        log = path;
    }
    let [log, session] = [&log, session.folder()].map(|path| path.to_str().unwrap());
    for arguments in [
        &["info", log][..],
        &["info", session],
        &["report", log],
        &["report", session],
        &["export", log],
        &["export", session],
        &["doctor", session],
        &["compare", session],
        &["simulate", "--from", log],
        &["recover", log],
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_biflag")).current_dir(&folder).args(arguments).output().unwrap();
        let [stdout, stderr] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
        println!("{arguments:?}: {:?}\n{stdout}{stderr}", output.status.code());
        assert!(matches!(output.status.code(), Some(1..=3)), "{arguments:?} does not see the damage");
        assert!(!stderr.contains("panicked"), "{arguments:?}");
    }
    let info = Command::new(env!("CARGO_BIN_EXE_biflag")).args(["info", log, "--json"]).output().unwrap();
    let info: serde_json::Value = serde_json::from_slice(&info.stdout).unwrap();
    assert_eq!((&info["samples"], &info["lost"], &info["clean"]), (&2400.into(), &2.into(), &false.into()));
    assert!(info["losses"][0].as_str().unwrap().starts_with("a metadata record"), "{info}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn commands_agree_on_damaged_logs(damages in prop::collection::vec(damage(), 1..5)) {
        let folder = tempfile::tempdir().unwrap();
        let mut log = LOG.clone();
        damages.iter().for_each(|damage| damage.apply(&mut log));
        abuse(folder.path(), &log);
    }
}
