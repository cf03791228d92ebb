//! A trial measured by other instruments: its readings, and the errors that its import states.

use super::budget::{Budget, Evaluation, Term};
use super::data::MOTORS;
use super::fields::TRUTH;
use super::import_rest;
use super::over_time::OverTime;
use crate::attitude::{Columns, Reading};
use crate::statistics::{Line, student_95};
use biflag_log::ImportMeta;
use nalgebra::DMatrix;
use sim::body::attitude::of_euler_zyx;
use sim::functions::powi;
use std::ops::Range;

/// Name of the term for the error that an import states.
const INSTRUMENT: &str = "imported instrument";

/// Converts states (yaw, pitch, roll and turns of both shafts) into readings, speeds and turns. The speeds follow from
/// the turns.
pub(super) fn readings(
    states: &Columns<{ TRUTH.len() }>,
    temperature_c: f64,
    run: &Range<f64>,
    target_rpm: [f64; 2],
) -> (Vec<(f64, Reading)>, Columns<MOTORS>) {
    let times = &states.time_s;
    let [.., turns1, turns2] = &states.values;
    let mut motors = Columns::default();
    let reading = |i: usize| {
        let [yaw, pitch, roll, ..] = states.row(i).map(f64::to_radians);
        let q = of_euler_zyx([yaw, pitch, roll]);
        (times[i], Reading { attitude: [q.w, q.i, q.j, q.k], rates_dps: None, temperature_c })
    };
    for (i, time) in times.iter().enumerate() {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(times.len() - 1));
        let passed_s = times[after] - times[before];
        let rpm = |turns: &[f64]| if passed_s > 0.0 { 60.0 * (turns[after] - turns[before]) / passed_s } else { 0.0 };
        let target = target_rpm.map(|target| if run.contains(time) { target } else { 0.0 });
        motors.push(*time, [target[0], rpm(turns1), target[1], rpm(turns2), turns1[i], turns2[i]]);
    }
    ((0..times.len()).map(reading).collect(), motors)
}

/// The errors that an import states for its angles: one per angle, constant over the whole trial; and those of its zero.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stated {
    /// Standard uncertainty of yaw, pitch and roll, degrees; `None` for an angle that was not measured.
    u_deg: [Option<f64>; 3],
    /// Standard uncertainty of each mean over the rest from the scatter of its readings about a line, degrees, and its degrees
    /// of freedom.
    zero: [(f64, f64); 3],
}

impl Stated {
    /// Returns the stated errors of an import; `None` if it states none. `rest`: where the angles are zero.
    pub fn of(import: Option<&ImportMeta>, angles_deg: &Columns<3>, rest: &Range<f64>) -> Option<Self> {
        let import = import?;
        let [yaw, tilt] = [import.yaw_uncertainty_deg?, import.tilt_uncertainty_deg?];
        let is_measured = |name: &str| !import.constant.iter().any(|constant| constant == name);
        let u_deg = |name, uncertainty: f64| is_measured(name).then_some(uncertainty / student_95(f64::INFINITY));
        let zero = angles_deg.tracks().map(|track| {
            let Line { squares, count, .. } = import_rest::line(track, rest);
            let freedom = (count - 2.0).max(1.0);
            // Not a number where all readings have one time.
            ((squares / freedom / count).max(0.0).sqrt(), freedom)
        });
        Some(Self { u_deg: [u_deg("yaw", yaw), u_deg("pitch", tilt), u_deg("roll", tilt)], zero })
    }

    /// Returns the cause of uncertainty of yaw, pitch or roll; `None` if it was not measured.
    pub fn budget(&self, angle: usize) -> Option<Budget> {
        let of_trial = Term::of_trial(INSTRUMENT, self.u_deg[angle]?, f64::INFINITY);
        let (u_deg, freedom) = self.zero[angle];
        let zero = Term::of_trial("noise of the zero", u_deg, freedom);
        Some(Budget::new([Term { evaluation: Evaluation::B, ..of_trial }, zero]))
    }

    /// Returns the uncertainty at a number of times; `None` for an angle that was not measured. The import does not state
    /// whether the error is common to all times or differs between them, so both are included.
    pub fn over_time(&self, times: usize) -> [Option<OverTime>; 3] {
        let of = |(u_deg, zero): (f64, (f64, f64))| {
            let own = DMatrix::from_element(times, times, powi(u_deg, 2) + powi(zero.0, 2))
                + DMatrix::from_diagonal_element(times, times, powi(u_deg, 2));
            OverTime { own, ..OverTime::exact(times) }
        };
        [0, 1, 2].map(|k| Some(of((self.u_deg[k]?, self.zero[k]))))
    }
}
