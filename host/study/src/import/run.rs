//! Finds the run in a table, with the motors' speeds and turns.

use super::{ImportError, State, States};
use protocol::units::CentiRpm;
use std::ops::Range;

/// Smallest speed of a turning motor, rpm, and as a share of the fastest speed.
const MOVING_RPM: f64 = 0.5;
const MOVING_SHARE: f64 = 0.05;

/// Averaging time of the speeds, s.
const SMOOTH_S: f64 = 0.3;

/// Fastest speed in a table, rpm: the board's limit.
const FASTEST_RPM: f64 = 90.0;

/// Deviation from the speed of the run, in rpm and as a share, above which a motor is slowing down.
const SLOWER_RPM: f64 = 0.5;
const SLOWER_SHARE: f64 = 0.05;

/// Longest time that motors take to stop, s.
const SLOWING_S: f64 = 5.0;

/// The run in a table, and the motion of the shafts.
pub(super) struct Run {
    /// Time in which the motors turn, by the clock of the table, s.
    pub run: Range<f64>,
    /// Speeds, as far as they are known.
    pub speeds: [CentiRpm; 2],
    /// Turns of both shafts at each state, from zero at the first one.
    pub turns: Vec<[f64; 2]>,
}

impl Run {
    /// Finds the run in the states of a table, unless it is given; then the speeds, unless they are given.
    pub(super) fn of(
        states: &States,
        speeds: Option<[CentiRpm; 2]>,
        run: Option<Range<f64>>,
        table: &str,
    ) -> Result<Self, ImportError> {
        let wrong = |reason: &str, help| ImportError::table(table, reason, help);
        let rows = &states.rows;
        let (first, before, last) = (rows[0].time_s, rows[rows.len() - 2].time_s, rows[rows.len() - 1].time_s);
        if let Some(run) = &run
            // A last row may be rounded, or lack the interval that it begins.
            && (run.start < first || run.end > last + (last - before) || run.end <= run.start)
        {
            let reason =
                format!("the table lasts from {first} to {last} s, the run from {} to {} s", run.start, run.end);
            return Err(wrong(&reason, "name a run within the table with --run"));
        }
        let run = run.map(|run| run.start..run.end.min(last));
        let is_measured = rows[0].turns.is_some() || rows[0].speed_rpm.is_some();
        let (run, turns) = if is_measured {
            let turns = measured_turns(rows);
            let run = match run {
                Some(run) => run,
                None => {
                    let still = || wrong("its motors never turn", "name the columns of their speeds, w1 and w2");
                    without_end(rows, &turns, moving(rows, &turns).ok_or_else(still)?)
                }
            };
            (run, turns)
        } else {
            let Some(speeds) = speeds else {
                let help = "name the speeds with --speeds, or the columns w1 and w2, or turns1 and turns2";
                return Err(wrong("the speeds of the motors are not known", help));
            };
            let run = run.unwrap_or(first..last);
            let turns =
                |state: &State| speeds.map(|w| w.rpm() / 60.0 * (state.time_s.clamp(run.start, run.end) - run.start));
            let turns = rows.iter().map(turns).collect();
            (run, turns)
        };
        let speeds = speeds.unwrap_or_else(|| mean_speeds(rows, &turns, &run));
        if let Some(k) = [0, 1].into_iter().find(|k| speeds[*k].rpm().abs() > FASTEST_RPM) {
            let reason = format!("motor {} turns faster than {FASTEST_RPM} rpm", k + 1);
            return Err(wrong(&reason, "check the units of w1 and w2, or of turns1 and turns2"));
        }
        Ok(Self { run, speeds, turns })
    }
}

/// Returns the turns, or the integral of the speeds.
fn measured_turns(rows: &[State]) -> Vec<[f64; 2]> {
    let mut sum = [0.0; 2];
    let mut all = vec![sum];
    for pair in rows.windows(2) {
        for (k, sum) in sum.iter_mut().enumerate() {
            *sum += match (pair[0].turns, pair[1].turns, pair[0].speed_rpm, pair[1].speed_rpm) {
                (Some(before), Some(now), ..) => now[k] - before[k],
                (_, _, Some(before), Some(now)) => {
                    0.5 * (before[k] + now[k]) / 60.0 * (pair[1].time_s - pair[0].time_s)
                }
                _ => 0.0,
            };
        }
        all.push(sum);
    }
    all
}

/// Returns the speed of each motor averaged over a short time before a row, rpm, because single rows are noisy.
fn speeds_before(rows: &[State], turns: &[[f64; 2]], i: usize) -> [f64; 2] {
    let from = rows.partition_point(|state| state.time_s <= rows[i].time_s - SMOOTH_S).min(i - 1);
    let passed_s = rows[i].time_s - rows[from].time_s;
    [0, 1].map(|k| 60.0 * (turns[i][k] - turns[from][k]) / passed_s)
}

/// Returns the time from the last row at rest to the last row in which a motor turns.
fn moving(rows: &[State], turns: &[[f64; 2]]) -> Option<Range<f64>> {
    let fastest =
        |i: usize| speeds_before(rows, turns, i).into_iter().fold(0.0, |fastest: f64, rpm| fastest.max(rpm.abs()));
    let speeds: Vec<f64> = (1..rows.len()).map(fastest).collect();
    let least = MOVING_RPM.max(MOVING_SHARE * speeds.iter().copied().fold(0.0, f64::max));
    let is_moving = |i: &usize| speeds[*i] > least;
    let mut moving = (0..speeds.len()).filter(is_moving);
    let first = moving.next()?;
    let last = moving.next_back().unwrap_or(first);
    // The motors start within the averaging time of the first speed.
    let at_rest = |i: &usize| {
        let passed_s = rows[i + 1].time_s - rows[*i].time_s;
        [0, 1].into_iter().all(|k| (60.0 * (turns[i + 1][k] - turns[*i][k]) / passed_s).abs() <= least)
    };
    let start = (0..=first).rev().find(|i| at_rest(i)).map_or(first, |i| i + 1).min(first);
    Some(rows[start].time_s..rows[last + 1].time_s)
}

/// Returns the run without the time in which the motors slow down: until the last row at the speeds of its middle half.
/// A slower change counts as another speed, and stays in the run.
fn without_end(rows: &[State], turns: &[[f64; 2]], run: Range<f64>) -> Range<f64> {
    let middle = mean_speeds(rows, turns, &run).map(CentiRpm::rpm);
    let is_at_speed = |i: &usize| {
        let rpm = speeds_before(rows, turns, *i);
        [0, 1].into_iter().all(|k| (rpm[k] - middle[k]).abs() <= SLOWER_RPM + SLOWER_SHARE * middle[k].abs())
    };
    let within = |i: &usize| (run.start.max(run.end - SLOWING_S)..=run.end).contains(&rows[i - 1].time_s);
    let last = (1..rows.len()).rev().filter(within).find(is_at_speed);
    run.start..last.map_or(run.end, |last| rows[last].time_s)
}

/// Returns the mean speeds in the middle half of the run.
fn mean_speeds(rows: &[State], turns: &[[f64; 2]], run: &Range<f64>) -> [CentiRpm; 2] {
    let quarter_s = 0.25 * (run.end - run.start);
    let at = |time_s: f64| rows.partition_point(|state| state.time_s < time_s).min(rows.len() - 1);
    let (from, to) = (at(run.start + quarter_s), at(run.end - quarter_s));
    let passed_s = rows[to].time_s - rows[from].time_s;
    [0, 1].map(|k| {
        CentiRpm::from_rpm(if passed_s > 0.0 { 60.0 * (turns[to][k] - turns[from][k]) / passed_s } else { 0.0 })
    })
}
