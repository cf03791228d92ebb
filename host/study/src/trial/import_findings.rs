//! What a trial that other instruments measured says against itself: its table, its motors, its rest.

use super::data::Data;
use super::finding::{Finding, FindingKind};
use super::zero::Zeroed;
use crate::attitude::{Motion, Track, rotation};
use crate::text::count;
use std::ops::Range;

/// Largest difference of two speeds that are the same, rpm, and as a share.
const SAME_RPM: f64 = 0.3;
const SAME_SHARE: f64 = 0.03;

/// Least number of rows for a turn of the faster flagellum.
const LEAST_ROWS_A_TURN: f64 = 4.0;

/// A change of the attitude between two rows that is no motion, degrees and °/s. The fastest full turn takes 3 s.
const JUMP_DEG: f64 = 5.0;
const JUMP_DPS: f64 = 300.0;

/// Rows, and the time, with one attitude in a run, that are no measurement.
const STOOD_ROWS: usize = 10;
const STOOD_S: f64 = 3.0;

/// Rows of zeros in a run, and how far from zero the attitude beside them is, that are no measurement.
const LEAST_ZEROS: usize = 3;
const ZERO_DEG: f64 = 0.5;

/// Time before the run in which the robot must be still, and the shortest that tells, s.
const REST_S: f64 = 5.0;
const LEAST_REST_S: f64 = 2.0;

/// Motion before the run, relative to the limits of a still robot, from which on the zero is wrong by degrees.
const GRAVE: f64 = 4.0;

/// Returns the findings about an imported trial but for that of its rest, see [`moved`]; none about another one.
pub(super) fn all(data: &Data, zeroed: &Zeroed) -> Vec<Finding> {
    let Some(import) = &data.records.import else { return Vec::new() };
    let mut found: Vec<Finding> = (zeroed.steady.as_ref())
        .and_then(|steady| other_speed(data, &steady.window))
        .into_iter()
        .chain(sparse(data))
        .chain(turned_before(data))
        .chain(lost(data))
        .chain(zeros(data))
        .collect();
    let mut slight = |text: String, cure: &str| found.push(Finding::slight(FindingKind::Conduct, text, cure));
    if import.left_out > 0 {
        let rows = count(import.left_out as usize, "row");
        slight(format!("{rows} of the table without a value, left out"), "");
    }
    if !import.constant.is_empty() {
        let (names, were) = (import.constant.join(", "), if import.constant.len() == 1 { "was" } else { "were" });
        slight(format!("{names} {were} not measured: a constant was given"), "");
    }
    if import.yaw_uncertainty_deg.is_none() || import.tilt_uncertainty_deg.is_none() {
        slight("the import states no uncertainty of its instrument".to_owned(), "state it with --uncertainty");
    }
    found
}

/// Returns a finding if yaw, pitch or roll still changed in the rest before the run, beyond what their scatter explains.
pub(super) fn moved(angles: [Track; 3], rest: &Range<f64>) -> Option<Finding> {
    let last = rest.start.max(rest.end - REST_S)..rest.end;
    if last.end - last.start < LEAST_REST_S {
        return None;
    }
    let [yaw_dps, pitch_dps, roll_dps] = angles.map(|angle| certain_rate(angle, &last));
    let motion = Motion { yaw_dps, tilt_dps: pitch_dps.hypot(roll_dps) };
    let text = format!(
        "the robot was not still before the run: its yaw turned at {:.2} °/s or more, its tilt at {:.2} °/s or more",
        motion.yaw_dps, motion.tilt_dps
    );
    let cure = "let the robot rest longer before the run";
    match motion.relative() {
        still if still <= 1.0 => None,
        some if some <= GRAVE => Some(Finding::slight(FindingKind::Rest, text, cure)),
        _ => Some(Finding::grave(FindingKind::Rest, text, cure)),
    }
}

/// Returns the least rate of change that the readings show: their slope less twice its standard error.
fn certain_rate(angle: Track, over: &Range<f64>) -> f64 {
    let (Some(slope), Some(mean)) = (angle.slope(over.clone()), angle.mean(over.clone())) else { return 0.0 };
    let inside = angle.time_s.iter().zip(angle.value).filter(|(time, _)| over.contains(time));
    let middle = 0.5 * (over.start + over.end);
    let (count, residuals, along) = inside.fold((0.0, 0.0, 0.0), |(count, residuals, along), (time, value)| {
        let from_middle = time - middle;
        (count + 1.0, residuals + (value - mean - slope * from_middle).powi(2), along + from_middle.powi(2))
    });
    let variance = if count > 2.0 && along > 0.0 { residuals / (count - 2.0) / along } else { return 0.0 };
    (slope.abs() - 2.0 * variance.sqrt()).max(0.0)
}

/// Returns a finding if a motor turned at another speed while the angles were averaged than the trial's.
fn other_speed(data: &Data, window: &Range<f64>) -> Option<Finding> {
    let wanted = data.speeds().map(|speed| speed.rpm());
    [0, 1].into_iter().find_map(|k| {
        let rpm = 60.0 * data.motors.track(4 + k).rate(window.clone())?;
        let is_other = (rpm - wanted[k]).abs() > SAME_RPM + SAME_SHARE * wanted[k].abs();
        is_other.then(|| {
            let text = format!(
                "motor {} turned at {rpm:.1} rpm while the angles were averaged, and the trial's speed is {} rpm",
                k + 1,
                wanted[k]
            );
            grave(text, "import one run at constant speeds: name it with --run")
        })
    })
}

fn grave(text: String, cure: &str) -> Finding {
    Finding::grave(FindingKind::Conduct, text, cure)
}

/// Returns a finding if the table has too few rows for a turn.
fn sparse(data: &Data) -> Option<Finding> {
    let fastest_rpm = data.speeds().iter().fold(0.0, |fastest: f64, speed| fastest.max(speed.rpm().abs()));
    let rows_a_turn = 60.0 / (fastest_rpm * data.motors.interval_s().unwrap_or_default());
    let text = format!(
        "the table has {rows_a_turn:.1} rows for a turn of the faster flagellum: the robot swings with each turn, so that \
         means of so few may be off by degrees"
    );
    (rows_a_turn < LEAST_ROWS_A_TURN).then(|| grave(text, "import a table with four rows or more for a turn"))
}

/// Returns a finding if a motor turned in the rest before the run.
fn turned_before(data: &Data) -> Option<Finding> {
    let (run, step_s) = (&data.times.run, data.motors.interval_s().unwrap_or_default());
    let before = (run.start - REST_S).max(data.times.preroll.start)..run.start - 2.0 * step_s;
    let rate = |k: usize| data.motors.track(4 + k).rate(before.clone()).unwrap_or_default();
    let k = [0, 1].into_iter().find(|k| before.end > before.start && 60.0 * rate(*k).abs() > SAME_RPM)?;
    let text = format!("motor {} turned before the run, so that the zero of the angles is not that of a rest", k + 1);
    Some(grave(text, "let the run begin where the motors start"))
}

/// Returns a finding if the attitude jumps, or stands still in the run: readings that were lost, or in another unit.
fn lost(data: &Data) -> Option<Finding> {
    let (run, readings) = (&data.times.run, &data.readings);
    let mut stood_from = 0;
    for (i, pair) in (1..).zip(readings.windows(2)) {
        let [(before_s, before), (now_s, now)] = [&pair[0], &pair[1]].map(|(time, reading)| (*time, reading.attitude));
        let angle_deg = rotation(before).angle_to(&rotation(now)).to_degrees();
        if angle_deg > JUMP_DEG && angle_deg / (now_s - before_s) > JUMP_DPS {
            let text = format!("the attitude jumps by {angle_deg:.0}° at {now_s:.2} s, faster than the robot turns");
            return Some(grave(text, "leave lost readings empty in the table, and check the units of the angles"));
        }
        if now != before {
            stood_from = i;
        }
        let from_s = readings[stood_from].0;
        if i - stood_from >= STOOD_ROWS && now_s - from_s.max(run.start) > STOOD_S && run.contains(&now_s) {
            let text = format!("the attitude does not change for more than {STOOD_S} s from {from_s:.1} s on");
            return Some(grave(text, "leave lost readings empty in the table"));
        }
    }
    None
}

/// Returns a finding if rows of the run hold zeros beside an attitude that is another: what many instruments write when they
/// lose the robot.
fn zeros(data: &Data) -> Option<Finding> {
    let run = data.readings.iter().filter(|(time_s, _)| data.times.run.contains(time_s));
    let (zeros, others): (Vec<_>, Vec<_>) = run.partition(|(_, reading)| reading.attitude == [1.0, 0.0, 0.0, 0.0]);
    let upright = rotation([1.0, 0.0, 0.0, 0.0]);
    // The next reading that is none tells where the robot was.
    let is_lost = |time_s: f64| {
        let next = others.iter().find(|(later_s, _)| *later_s > time_s).or(others.last());
        next.is_some_and(|(_, reading)| rotation(reading.attitude).angle_to(&upright).to_degrees() > ZERO_DEG)
    };
    let lost = zeros.iter().filter(|(time_s, _)| is_lost(*time_s)).count();
    let text =
        format!("{} of the run with yaw, pitch and roll of exactly zero, unlike those beside them", count(lost, "row"));
    (lost >= LEAST_ZEROS).then(|| grave(text, "leave lost readings empty in the table"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::Columns;

    /// Returns angles over 6 s at 10 Hz of which the first moves at a rate, with a scatter of 0.1 degrees that alternates.
    fn angles(rate_dps: f64) -> Columns<3> {
        let mut angles = Columns::default();
        for i in 0..60 {
            let time_s = 0.1 * f64::from(i);
            angles.push(time_s, [rate_dps * time_s + if i % 2 == 0 { 0.1 } else { -0.1 }, 1.0, 2.0]);
        }
        angles
    }

    #[test]
    fn a_robot_that_still_turns_is_found_and_scatter_is_not() {
        let moved = |rate_dps: f64| moved(angles(rate_dps).tracks(), &(0.0..6.0)).map(|finding| finding.grave);
        assert_eq!([0.0, 0.04, 0.12, 0.4].map(moved), [None, None, Some(false), Some(true)]);
    }
}
