//! A recorded log, cut or changed at any byte: nothing panics, no change goes unnoticed, and little memory is needed.
//!
//! `EVERY_BYTE=1 cargo test --release -p tests --test every_byte -- --nocapture` tries every byte; the ordinary tests try
//! a sample.

use biflag_log::{Message, Reader, Table};
use host::trial::{Judged, Want};
use std::collections::BTreeMap;
use std::path::Path;
use tests::{Bench, logs, nano};

/// Content of a log, as far as it can be read.
#[derive(PartialEq, Debug)]
struct Content {
    messages: Vec<Message>,
    tables: BTreeMap<String, Table>,
    is_whole: bool,
}

/// Reads a log; `None` if nothing tells that it is one of biflag.
fn read(path: &Path) -> Option<Content> {
    let mut reader = Reader::open(path).ok()?;
    let messages = reader.by_ref().map(Result::unwrap).collect();
    let is_whole = reader.condition().unwrap().is_whole();
    assert_eq!(is_whole, reader.losses().is_empty());
    Some(Content { messages, tables: reader.tables.clone(), is_whole })
}

/// Asserts that what is read of a changed log was in the original, and that a missing part is noticed.
fn compare(what: &str, changed: Option<&Content>, original: &Content) {
    let Some(changed) = changed else { return };
    if changed.is_whole {
        assert_eq!(changed, original, "{what}: a silent change");
    }
    let mut rest = original.messages.iter();
    assert!(changed.messages.iter().all(|message| rest.any(|one| one == message)), "{what}: a message never recorded");
    let known = |(name, table): (&String, &Table)| {
        // A record may occur several times, of which the last one may be lost.
        original.tables.get(name) == Some(table) || name == "clock"
    };
    assert!(changed.tables.iter().all(known), "{what}: a record never written");
}

/// Largest memory that this program has had in use, bytes.
fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    peak.trim().trim_end_matches(" kB").parse::<u64>().unwrap() << 10
}

#[test]
fn log_cut_or_changed_at_any_byte_is_noticed() {
    let bench = Bench::new();
    let plan = bench.short_plan(0.3, [50.0, 10.0]);
    {
        let nano = nano(["--speed", "max"]);
        let run = bench.run(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "s"]);
        assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
    }
    let log = logs(&bench.path().join("s")).remove(0);
    let bytes = std::fs::read(&log).unwrap();
    let original = read(&log).unwrap();
    assert!(original.is_whole && original.messages.len() > 100);
    let every = std::env::var_os("EVERY_BYTE").is_some();
    let (step, workers) = if every { (1, 2) } else { (199, 2) };
    let before = peak_memory();
    let cases: Vec<usize> = std::thread::scope(|scope| {
        let work = |worker: usize| {
            let (bench, bytes, original) = (&bench, &bytes, &original);
            scope.spawn(move || {
                let path = bench.path().join(format!("{worker}.mcap"));
                let mut cases = 0;
                let mut check = |what: &str, content: &[u8]| {
                    std::fs::write(&path, content).unwrap();
                    compare(what, read(&path).as_ref(), original);
                    cases += 1;
                    // The trial's own figures need more time than the log.
                    if cases % 16 == 0 {
                        let _ = Judged::read(&path, Want { forces: true, frames: true, shapes: 10, hash: true });
                    }
                };
                let mut broken = bytes.clone();
                for at in (worker * step..bytes.len()).step_by(step * workers) {
                    check(&format!("cut at {at}"), &bytes[..at]);
                    for flip in [0x01, 0x80, 0xFF] {
                        broken[at] ^= flip;
                        check(&format!("byte {at} changed by {flip:#x}"), &broken);
                        broken[at] ^= flip;
                    }
                    // A length that is not there.
                    let end = (at + 8).min(bytes.len());
                    broken[at..end].fill(0x7F);
                    check(&format!("a length at {at}"), &broken);
                    broken[at..end].copy_from_slice(&bytes[at..end]);
                }
                cases
            })
        };
        let running: Vec<_> = (0..workers).map(work).collect();
        running.into_iter().map(|worker| worker.join().unwrap()).collect()
    });
    let peak = peak_memory();
    println!(
        "{} variants of a log of {} bytes: no panic, no silent change, at most {} MB of memory ({} MB before)",
        cases.iter().sum::<usize>(),
        bytes.len(),
        peak >> 20,
        before >> 20
    );
    assert!(peak < 200 << 20, "{peak} bytes of memory");
}
