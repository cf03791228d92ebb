//! A trial that other instruments measured: its readings, and the errors that its import states.

use super::budget::{Budget, Evaluation, Term};
use super::causes::{Causes, OverTime};
use super::data::{Data, MOTORS};
use super::finding::{Finding, FindingKind};
use crate::attitude::{Columns, Motion, Reading, Track, rotation, student_95};
use biflag_log::ImportMeta;
use nalgebra::{DMatrix, UnitQuaternion};
use std::ops::Range;

/// Name of the term that an import states.
const INSTRUMENT: &str = "imported instrument";

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

/// Time before the run in which the robot must be still, and the shortest that tells, s.
const REST_S: f64 = 5.0;
const LEAST_REST_S: f64 = 2.0;

/// Motion before the run, relative to the limits of a still robot, from which on the zero is wrong by degrees.
const GRAVE: f64 = 4.0;

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
pub(super) fn other_speed(data: &Data, window: &Range<f64>) -> Option<Finding> {
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
            Finding::grave(FindingKind::Conduct, text, "import one run at constant speeds: name it with --run")
        })
    })
}

/// Returns findings about the table itself: too few rows, a motor that turned before the run, angles that jump or stand.
pub(super) fn doubts(data: &Data) -> Vec<Finding> {
    let grave = |text: String, cure: &str| Finding::grave(FindingKind::Conduct, text, cure);
    let mut found = Vec::new();
    let run = &data.times.run;
    let fastest_rpm = data.speeds().iter().fold(0.0, |fastest: f64, speed| fastest.max(speed.rpm().abs()));
    let step_s = data.motors.interval_s().unwrap_or_default();
    let rows_a_turn = 60.0 / (fastest_rpm * step_s);
    if rows_a_turn < LEAST_ROWS_A_TURN {
        let text = format!(
            "the table has {rows_a_turn:.1} rows for a turn of the faster flagellum: the robot swings with each turn, so that \
             means of so few may be off by degrees"
        );
        found.push(grave(text, "import a table with four rows or more for a turn"));
    }
    let before = (run.start - REST_S).max(data.times.preroll.start)..run.start - 2.0 * step_s;
    let turned = |k: &usize| {
        let rate = data.motors.track(4 + k).rate(before.clone()).unwrap_or_default();
        60.0 * rate.abs() > SAME_RPM
    };
    if let Some(k) = [0, 1].iter().find(|k| before.end > before.start && turned(k)) {
        let text =
            format!("motor {} turned before the run, so that the zero of the angles is not that of a rest", k + 1);
        found.push(grave(text, "let the run begin where the motors start"));
    }
    let attitude = |i: usize| rotation(data.readings[i].1.attitude);
    let mut stood_from = 0;
    for i in 1..data.readings.len() {
        let (passed_s, angle_deg) =
            (data.readings[i].0 - data.readings[i - 1].0, attitude(i - 1).angle_to(&attitude(i)).to_degrees());
        if angle_deg > JUMP_DEG && angle_deg / passed_s > JUMP_DPS {
            let text = format!(
                "the attitude jumps by {angle_deg:.0}° at {:.2} s, faster than the robot turns",
                data.readings[i].0
            );
            found.push(grave(text, "leave lost readings empty in the table, and check the units of the angles"));
            break;
        }
        if data.readings[i].1.attitude != data.readings[i - 1].1.attitude {
            stood_from = i;
        }
        let stood_s = data.readings[i].0 - data.readings[stood_from].0.max(run.start);
        if i - stood_from >= STOOD_ROWS && stood_s > STOOD_S && run.contains(&data.readings[i].0) {
            let text = format!(
                "the attitude does not change for more than {STOOD_S} s from {:.1} s on",
                data.readings[stood_from].0
            );
            found.push(grave(text, "leave lost readings empty in the table"));
            break;
        }
    }
    found
}

/// Returns readings, and speeds and turns, of states with yaw, pitch, roll and turns of both shafts. The speeds are those of
/// the turns.
pub(super) fn readings(
    states: &Columns<5>,
    temperature_c: f64,
    run: &Range<f64>,
    target_rpm: [f64; 2],
) -> (Vec<(f64, Reading)>, Columns<MOTORS>) {
    let times = &states.time_s;
    let mut motors = Columns::default();
    let reading = |i: usize| {
        let [yaw, pitch, roll, ..] = states.row(i).map(f64::to_radians);
        let q = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        (times[i], Reading { attitude: [q.w, q.i, q.j, q.k], lateral_dps: None, temperature_c })
    };
    for (i, time) in times.iter().enumerate() {
        let [.., one, two] = states.row(i);
        let (before, after) = (i.saturating_sub(1), (i + 1).min(times.len() - 1));
        let passed_s = times[after] - times[before];
        let rpm = |k: usize| match passed_s > 0.0 {
            true => 60.0 * (states.values[3 + k][after] - states.values[3 + k][before]) / passed_s,
            false => 0.0,
        };
        let target = target_rpm.map(|target| if run.contains(time) { target } else { 0.0 });
        motors.push(*time, [target[0], rpm(0), target[1], rpm(1), one, two]);
    }
    ((0..times.len()).map(reading).collect(), motors)
}

/// What an import states about the errors of its angles: one error of each angle, the same over the whole trial.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stated {
    /// Standard uncertainty of yaw, pitch and roll, degrees; `None` for an angle that was not measured.
    u_deg: [Option<f64>; 3],
}

impl Stated {
    /// Returns what an import states; `None` if it states nothing.
    pub fn of(import: Option<&ImportMeta>) -> Option<Self> {
        let import = import?;
        let [yaw, tilt] = [import.yaw_uncertainty_deg?, import.tilt_uncertainty_deg?];
        let is_measured = |name: &str| !import.constant.iter().any(|constant| constant == name);
        let u_deg = |name, uncertainty: f64| is_measured(name).then_some(uncertainty / student_95(f64::INFINITY));
        Some(Self { u_deg: [u_deg("yaw", yaw), u_deg("pitch", tilt), u_deg("roll", tilt)] })
    }

    fn term(&self, angle: usize) -> Option<Term> {
        let of_trial = Term::of_trial(INSTRUMENT, self.u_deg[angle]?, f64::INFINITY);
        Some(Term { evaluation: Evaluation::B, ..of_trial })
    }

    /// Returns the causes of uncertainty of the yaw; `None` if it was not measured.
    pub fn yaw(&self) -> Option<Budget> {
        Some(Budget::new([self.term(0)?]))
    }

    /// Returns the causes of uncertainty of pitch, roll and tilt; `None` if pitch or roll was not measured.
    pub fn tilts(&self) -> Option<[Budget; 3]> {
        let (pitch, roll) = (self.term(1)?, self.term(2)?);
        Some([pitch.clone(), roll, pitch].map(|term| Budget::new([term])))
    }

    /// Returns the causes of uncertainty of yaw, pitch and roll; `None` for an angle that was not measured.
    pub fn causes(&self) -> [Option<Causes>; 3] {
        [0, 1, 2].map(|angle| Some(Causes { own: vec![self.term(angle)?], effects_deg: Vec::new() }))
    }

    /// Returns the uncertainty at a number of times; `None` if an angle was not measured. Whether the error is the same at
    /// all of them or another at each is not stated, so that both are allowed for.
    pub fn over_time(&self, times: usize) -> Option<[OverTime; 3]> {
        let of = |u_deg: f64| {
            let own = DMatrix::from_element(times, times, u_deg.powi(2))
                + DMatrix::from_diagonal_element(times, times, u_deg.powi(2));
            OverTime { own, ..OverTime::exact(times) }
        };
        let [yaw, pitch, roll] = self.u_deg;
        Some([of(yaw?), of(pitch?), of(roll?)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
