//! What is promised of real time: the emulated board waits for nobody, and the computer's own clock judges. `make test` runs
//! these tests alone, after all others. Their folders are in memory, so that no disk delays them, and what they measure may be
//! late by as much as the computer was meanwhile.

mod disk;
mod interruption;
mod spoilt_line;
mod steer;

use tests::{Bench, nano};

/// Telemetry is complete.
#[test]
fn telemetry_is_complete() {
    let bench = Bench::in_memory();
    let plan = bench.short_plan(4.0, [-90.0, 90.0]);
    let nano = nano(["--speed", "1"]);
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", nano.port(), "--json"]).expect_code(3);
    let trial = &run.json()["trials"][0];
    assert_eq!((&trial["samples"], &trial["lost"]), (&800.into(), &0.into()), "{trial}");
}
