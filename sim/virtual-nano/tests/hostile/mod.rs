//! The real program in a hostile world: each test makes something fail, and prints what the board did as a row of a table.
//!
//! `cargo test --release -p virtual-nano --test all hostile -- --nocapture --test-threads 1` prints the tables.

mod chip;
mod encoders;
mod motors;
mod positions;
mod power_cut;
mod pwm_spikes;
mod sensor;

use crate::common::{Host, MS};
use protocol::Fault;
use std::fmt::Display;
use virtual_nano::BoardOptions;

/// Prints a row: what fails, what is measured, what is wanted.
fn row(what: impl Display, measured: impl Display, wanted: impl Display) {
    println!("| {what} | {measured} | {wanted} |");
}

/// A board that is ready and turns its flagella at these speeds (rpm) with a fault that has its beginning now.
fn turning(rpm: [f64; 2]) -> Host {
    let mut host = Host::ready(BoardOptions::default());
    host.set_speeds(rpm);
    host.run_linked_ms(1500);
    assert_eq!(host.fault(), Fault::None, "before anything fails");
    host
}

/// Runs until both PWM pins are low, `limit_s` at most. Returns the time that it took, s.
fn off_after(host: &mut Host, limit_s: f64) -> Option<f64> {
    let begin = host.board.seconds();
    while host.board.seconds() - begin < limit_s {
        if host.board.rig().bridge.pwm == [0, 0] {
            return Some(host.board.seconds() - begin);
        }
        host.run_linked_ms(1);
    }
    None
}

/// Runs until the board says so in its telemetry, `limit_s` at most. Returns the time that it took, s.
fn until(host: &mut Host, limit_s: f64, said: impl Fn(&Host) -> bool) -> Option<f64> {
    let begin = host.board.seconds();
    while host.board.seconds() - begin < limit_s {
        if said(host) {
            return Some(host.board.seconds() - begin);
        }
        host.run_linked_ms(1);
    }
    None
}

/// Checks that the motors are off in time and the telemetry names the fault, and prints the row.
#[track_caller]
fn stops(host: &mut Host, what: &str, within_s: f64, faults: &[Fault]) {
    let off_s = off_after(host, 2.0 * within_s + 1.0);
    host.run_linked_ms(20);
    let fault = host.fault();
    let wanted = format!("{faults:?} within {within_s} s");
    match off_s {
        Some(off_s) => row(what, format!("{fault:?} after {off_s:.3} s"), &wanted),
        None => row(what, format!("{fault:?}, motors on"), &wanted),
    }
    assert!(off_s.is_some_and(|off_s| off_s <= within_s), "{what}: off after {off_s:?} s, wanted {wanted}");
    assert!(faults.contains(&fault), "{what}: {fault:?}, wanted {wanted}");
}

/// Means of the true and of the measured speed of a motor over a time, and the largest error of each from `rpm`.
struct Speeds {
    mean: f64,
    worst: f64,
    worst_measured: f64,
    /// Milliseconds in which the measured speed is off by more than 1 rpm.
    wrong_ms: u64,
}

fn watch(host: &mut Host, motor: usize, rpm: f64, ms: u64) -> Speeds {
    let (mut sum, mut worst, mut worst_measured): (f64, f64, f64) = (0.0, 0.0, 0.0);
    let mut wrong_ms = 0;
    for step in 0..ms {
        if step % 50 == 0 {
            host.send(protocol::Command::Ping);
        }
        host.run_until(host.board.cycle() + MS);
        let speed = host.board.rig().motors[motor].speed_rpm;
        sum += speed;
        worst = worst.max((speed - rpm).abs());
        let error = (host.last().speed[motor].rpm() - rpm).abs();
        worst_measured = worst_measured.max(error);
        wrong_ms += u64::from(error > 1.0);
    }
    Speeds { mean: sum / ms as f64, worst, worst_measured, wrong_ms }
}
