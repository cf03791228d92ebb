//! A slow disk does not hold up the link.

use biflag_log::{Body, Reader};
use tests::{Bench, Lateness, Run, logs, nano, stalling_library};

/// Longest time for which the program may leave a port unread, s: with an FT232, whose driver stops the device once the
/// terminal's 4 kB are full, frames are lost after 4096 bytes, of some 14,400 in a second.
const UNREAD_S: f64 = 0.28;

/// Records 5 s while a call takes 2 s, and returns the longest delay of a frame on its way to the log's thread, s.
fn worst_delay_s(call: &str) -> f64 {
    let bench = Bench::in_memory();
    let plan = bench.short_plan(5.0, [50.0, 10.0]);
    let nano = nano(["--speed", "1"]);
    let mut command = bench.command(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "s", "--json"]);
    command.env("LD_PRELOAD", stalling_library(bench.path()));
    command.env("STALL_CALL", call).env("STALL_MS", "2000").env("STALL_AFTER_MS", "1500");
    let trial = Run::of(command.spawn().unwrap()).expect_code(3).json()["trials"][0].clone();
    assert_eq!((&trial["samples"], &trial["lost"]), (&1000.into(), &0.into()), "{call}: {trial}");
    assert!(trial["notes"].to_string().contains("the disk was slow"), "{call}: {trial}");
    let messages = Reader::open(&logs(&bench.path().join("s"))[0]).unwrap().map(Result::unwrap);
    let delays_ns: Vec<i128> = messages
        .filter_map(|message| match message.body {
            Body::Telemetry(frame) => {
                Some(i128::from(message.publish_time_ns) - 1000 * i128::from(frame.board_time_us))
            }
            _ => None,
        })
        .collect();
    (delays_ns.iter().max().unwrap() - delays_ns.iter().min().unwrap()) as f64 * 1e-9
}

#[test]
fn slow_disk_does_not_hold_up_the_link() {
    let lateness = Lateness::measure();
    for call in ["write", "fdatasync"] {
        let (delay_s, late_s) = (worst_delay_s(call), lateness.allowed().as_secs_f64());
        println!("{call}: a frame took {delay_s:.3} s, of which {late_s:.3} s may be the computer's");
        assert!(delay_s < UNREAD_S + late_s, "{call}: {delay_s} s");
    }
}
