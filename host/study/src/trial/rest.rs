//! Judges the rest before a run: whether there was one, and whether the robot was still.

use super::back_at_zero::NotBack;
use super::data::Data;
use super::rest_fit::{blocks, end_of};
use crate::attitude::{Drift, Motion, Rest, Series};
use protocol::units::CentiRpm;
use sim::functions::{cos, hypot, sin};
use std::ops::Range;

/// The zero of the yaw is its mean over this duration at the end of the still phase, s. A shorter still phase does not
/// count.
pub(super) const START_S: f64 = 1.0;

/// Largest change of the tilt at the end of a still phase, degrees.
const STILL_DEG: f64 = 0.5;

/// The filter is settling if the rates that it cancels change by more than this share of the change that would explain
/// the tilt's. A motion of the robot does not change these rates.
const SETTLING: f64 = 0.1;

/// Time at the end of a still phase in which its rate is compared with the calibration, s.
const COMPARED_S: f64 = 5.0;

/// Largest rate at rest after a calibration, °/s: the bias drifts by hundredths in so short a time.
const CALIBRATED_DPS: f64 = 0.1;

/// Shortest time at rest that distinguishes a bias from noise, s: a mean rate over it has a noise of some hundredths of
/// a degree per second.
const LEAST_RATE_S: f64 = 0.2;

/// Largest rate at the start of the run, °/s, up to which the fit of the return to rest is trusted.
const RETURN_DPS: f64 = 0.2;

/// The facts about the rest before a run, which a table of findings judges.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct AtRest {
    /// Length of the still phase before the run, s.
    pub still_s: f64,
    /// Why the uncertainty of the yaw is unknown, or the yaw wrong.
    pub unknown: Option<Unknown>,
    /// Change of the tilt at the end of the still phase, degrees, if it is too large for a robot at rest; and whether
    /// the board's filter was settling.
    pub tilt_changed: Option<(f64, bool)>,
    /// Rate of the yaw at rest after a calibration, °/s, if it is not a drift.
    pub turned_dps: Option<f64>,
    /// Rate of the yaw at the start of the run, °/s, if the fit of the return to rest does not cover it.
    pub turning_dps: Option<f64>,
    /// Time without readings around the start of the run.
    pub lost: Option<Range<f64>>,
    /// An angle that does not come back after the run.
    pub not_back: Option<NotBack>,
    /// Motion of an imported robot in the rest before its run.
    pub motion: Option<Motion>,
    /// Whether an imported trial has no rest before its run.
    pub is_missing: bool,
}

/// Why the uncertainty of the yaw is unknown, or the yaw wrong.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Unknown {
    /// The gyroscope turns the yaw at this rate, °/s.
    Bias(f64),
    /// Neither a calibration nor a rest shows the bias.
    NoRest,
    /// There is no still phase.
    NoStill,
    /// The still phase is too short to show the drift. The bias is about this large, °/s.
    Short(Option<f64>),
    /// The bias about the body's x and y is unknown.
    Lateral,
}

impl AtRest {
    /// `has_still`: whether there is a still phase.
    pub fn new(data: &Data, series: &Series, rest: &Rest, has_still: bool, drift: Option<&Drift>) -> Self {
        // A sensor turned by hand needs no rest.
        let is_of_robot = data.speeds() != [CentiRpm(0); 2];
        let is_judged = is_of_robot && data.times.has_run();
        let turned_dps = turned_dps(series, rest).filter(|_| is_of_robot);
        let [dps, u] = drift.map_or([0.0; 2], |drift| drift.residual_dps);
        let is_turning = is_of_robot && turned_dps.is_none() && dps.abs() - 2.0 * u > RETURN_DPS;
        Self {
            still_s: rest.before.end - rest.before.start,
            unknown: if is_judged { unknown(data, series, rest, has_still, drift) } else { None },
            tilt_changed: if has_still { tilt_changed(series, rest) } else { None },
            turned_dps,
            turning_dps: is_turning.then_some(dps.abs()),
            ..Self::default()
        }
    }
}

fn unknown(data: &Data, series: &Series, rest: &Rest, has_still: bool, drift: Option<&Drift>) -> Option<Unknown> {
    let still_s = rest.before.end - rest.before.start;
    let dps = bias_in_yaw(series, rest, &data.times.run, drift.is_some());
    let is_known = drift.is_some_and(|drift| drift.variance(data.times.run.end).is_some());
    match dps {
        // After a calibration, a rate at rest is a motion: see `turned_dps`.
        Some(dps) if rest.calibrate_s == 0.0 && !is_known && dps > CALIBRATED_DPS => Some(Unknown::Bias(dps)),
        // The board may have kept the bias of another day, or never had one: nothing in such a log shows it.
        _ if rest.calibrate_s == 0.0 && still_s < LEAST_RATE_S => Some(Unknown::NoRest),
        _ if !has_still => Some(Unknown::NoStill),
        dps if drift.is_none() => Some(Unknown::Short(dps)),
        _ => (!is_known).then_some(Unknown::Lateral),
    }
}

/// Returns the rate at which the remaining bias turns the yaw in the run, °/s, from the rates at rest; `None` without a
/// rest. The rates distinguish a board that has kept an earlier calibration from one that was never calibrated.
/// `knows_z`: whether the drift at rest is removed; the biases about x and y then still turn the yaw of a leaning
/// robot.
fn bias_in_yaw(series: &Series, rest: &Rest, run: &Range<f64>, knows_z: bool) -> Option<f64> {
    let still = &rest.before;
    if still.end - still.start < LEAST_RATE_S {
        return None;
    }
    let z = if knows_z { 0.0 } else { series.yaw().rate(still.clone())? };
    let tilts = [series.roll(), series.pitch()];
    // While its filter settles, the board's attitude turns with the bias.
    let [x, y] = match series.held_back_dps(still.clone()).filter(|_| !series.learns_bias) {
        Some([x, y]) => [x + tilts[0].slope(still.clone())?, y + tilts[1].slope(still.clone())?],
        None => [0.0; 2],
    };
    let seen = run.start..run.end.min(series.yaw().span().end);
    let [roll, pitch] = tilts.map(|tilt| tilt.mean(seen.clone()).unwrap_or_default().to_radians());
    Some((cos(pitch) * (y * sin(roll) + z * cos(roll)) - x * sin(pitch)).abs())
}

/// Returns the change of the tilt at the end of the still phase, degrees, if it is too large, and whether the board's filter was
/// settling; otherwise the robot moved.
fn tilt_changed(series: &Series, rest: &Rest) -> Option<(f64, bool)> {
    let over = end_of(&rest.before);
    let range = |values: Vec<f64>| {
        let low = values.iter().copied().reduce(f64::min)?;
        values.into_iter().reduce(f64::max).map(|high| high - low)
    };
    let [pitch, roll] = [series.pitch(), series.roll()].map(|tilt| range(blocks(tilt, &over)));
    let changed_deg = pitch?.max(roll?);
    let settles = || filter_settles(series, &over, changed_deg / rest.filter_s);
    (changed_deg > STILL_DEG).then(|| (changed_deg, settles()))
}

/// Returns whether the board's filter was settling in a still phase. `rate_dps`: the change of its correction that
/// would explain the observed change of the tilt.
fn filter_settles(series: &Series, still: &Range<f64>, rate_dps: f64) -> bool {
    let middle = 0.5 * (still.start + still.end);
    let halves = [still.start..middle, middle..still.end].map(|half| series.held_back_dps(half));
    let [Some(one), Some(other)] = halves else { return false };
    hypot(one[0] - other[0], one[1] - other[1]) > SETTLING * rate_dps
}

/// Returns the rate of the yaw at the end of a calibrated rest, °/s, if the robot moved in it.
fn turned_dps(series: &Series, rest: &Rest) -> Option<f64> {
    let still = &rest.before;
    if rest.calibrate_s <= 0.0 || still.end - still.start < START_S {
        return None;
    }
    let end = (still.end - COMPARED_S).max(still.start)..still.end;
    series.yaw().rate(end).map(f64::abs).filter(|dps| *dps > CALIBRATED_DPS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Collector, Finding, FindingKind, Judged, Records, Want};
    use biflag_log::schema::biflag::event::Kind;
    use biflag_log::schema::biflag::{Quaternion, Telemetry, Vector};
    use biflag_log::{End, FORMAT, Summary, TrialMeta};
    use nalgebra::{UnitQuaternion, Vector3};

    const TICK_S: f64 = 0.005;

    /// Returns the findings about the rest of a trial made by [`judged`]. `pitch_deg`: pitch of the robot over time.
    fn found(preroll_s: f64, bias_dps: [f64; 3], pitch_deg: impl Fn(f64) -> f64) -> Vec<Finding> {
        let truth = |t: f64| UnitQuaternion::from_euler_angles(0.0, pitch_deg(t).to_radians(), 0.0);
        of_rest(&judged(preroll_s, bias_dps, 0.0..0.0, truth))
    }

    fn of_rest(trial: &Judged) -> Vec<Finding> {
        trial.findings.iter().filter(|finding| finding.kind == FindingKind::Rest).cloned().collect()
    }

    /// Returns a trial without a calibration, with a run of 10 s after a still phase. The gyroscope has biases; the filter
    /// begins without them. The frames of the time `lost` are missing.
    fn judged(
        preroll_s: f64,
        bias_dps: [f64; 3],
        lost: Range<f64>,
        truth: impl Fn(f64) -> UnitQuaternion<f64>,
    ) -> Judged {
        let mut collector = Collector::new(Want::default(), FORMAT);
        let mut estimate = truth(0.0);
        collector.event(0.0, Kind::Phase, "preroll");
        for i in 0..((preroll_s + 10.0) / TICK_S) as u32 {
            let t = f64::from(i) * TICK_S;
            if (t - preroll_s).abs() < 0.5 * TICK_S {
                collector.event(t, Kind::Phase, "run");
            }
            let bias = Vector3::from(bias_dps.map(f64::to_radians));
            let rates = (truth(t).inverse() * truth(t + TICK_S)).scaled_axis() / TICK_S + bias;
            let [x, y, z] = rates.map(f64::to_degrees).into();
            let frame = Telemetry {
                time_s: t,
                imu_fresh: true,
                attitude: Some(Quaternion { w: estimate.w, x: estimate.i, y: estimate.j, z: estimate.k }),
                angular_velocity_dps: Some(Vector { x, y, z }),
                ..Telemetry::default()
            };
            if !lost.contains(&t) {
                collector.telemetry(&frame);
            }
            let up = |attitude: UnitQuaternion<f64>| attitude.inverse() * Vector3::z();
            estimate *= UnitQuaternion::from_scaled_axis((rates + up(truth(t)).cross(&up(estimate))) * TICK_S);
        }
        let trial = TrialMeta { w1_rpm: 37.3, w2_rpm: -61.9, ..TrialMeta::default() };
        let summary = Summary { end: End::Complete, ..Summary::default() };
        let records = Records { trial: Some(trial), summary: Some(summary), ..Records::default() };
        Judged::of(collector.finish("log".as_ref(), records))
    }

    /// A robot that turns at 20 °/s from the start of its run. Between a reading at rest and one in the turn the yaw is
    /// unknown, and the zero must not include it.
    #[test]
    fn readings_lost_where_the_run_starts_do_not_move_the_zero() {
        let truth = |t: f64| UnitQuaternion::from_euler_angles(0.0, 0.0, 20f64.to_radians() * (t - 20.0).max(0.0));
        let whole = judged(20.0, [0.0; 3], 0.0..0.0, truth);
        assert_eq!(of_rest(&whole), []);
        for (from_s, to_s) in [(19.97, 20.1), (19.8, 20.9), (19.8, 24.3), (14.3, 21.0)] {
            let lossy = judged(20.0, [0.0; 3], from_s..to_s, truth);
            let [yaw, expected] = [&lossy, &whole].map(|trial| trial.angles.at(28.0)[0]);
            assert!((yaw - expected).abs() < 0.01, "{from_s} to {to_s} s lost: {yaw}, of {expected}");
            let said =
                format!("telemetry is missing from {:.2} s to {to_s:.2} s, where the run starts", from_s - TICK_S);
            let named = |one: &Finding| one.text.starts_with(&said);
            assert!(of_rest(&lossy).iter().any(named), "{said}: {:?}", of_rest(&lossy));
        }
    }

    #[test]
    fn settling_filter_is_told_from_a_robot_that_moves() {
        for preroll_s in [4.3, 6.5, 9.0] {
            let said = found(preroll_s, [-4.7, 0.0, 0.0], |_| 1.3)
                .iter()
                .map(ToString::to_string)
                .collect::<Vec<_>>()
                .join("; ");
            assert!(said.contains("filter had not settled") && !said.contains("robot was not still"), "{said}");
            let said = found(preroll_s, [0.0; 3], |t| 7.9 * (-t / 10.8).exp());
            let said = said.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
            assert!(said.contains("the robot was not still before the run"), "{said}");
        }
    }

    #[test]
    fn short_still_phase_is_named() {
        let [short] = found(4.3, [0.0; 3], |_| 1.3).try_into().unwrap();
        assert!(short.text.starts_with("the still phase of 4.3 s before the run is too short") && !short.grave);
        assert_eq!(found(25.0, [0.0; 3], |_| 1.3), []);
    }

    /// With or without a bias, and with no rest or one too short to show a rate.
    #[test]
    fn run_without_a_rest_or_a_calibration_is_grave() {
        for (preroll_s, z_dps) in [(0.0, 0.0), (0.0, -3.52), (0.13, 1.7), (0.19, 0.0)] {
            let [none] = found(preroll_s, [0.0, 0.0, z_dps], |_| 1.3).try_into().unwrap();
            assert!(none.text.starts_with("there is neither a calibration nor a still phase") && none.grave, "{none}");
        }
    }

    #[test]
    fn bias_that_stays_in_the_yaw_is_grave() {
        let bias = |dps: &str| format!("the gyroscope turns the yaw by {dps} °/s of its own");
        for preroll_s in [0.3, 2.9, 5.6] {
            let [short] = found(preroll_s, [0.0, 0.0, -3.52], |_| 1.3).try_into().unwrap();
            assert!(short.text.starts_with(&bias("3.52")) && short.grave, "{short}");
        }
        // The board has kept the bias of an earlier calibration.
        let [kept] = found(2.9, [0.0, 0.0, 0.06], |_| 1.3).try_into().unwrap();
        assert!(kept.text.contains("the drift of about 0.06 °/s is not removed") && !kept.grave, "{kept}");
        assert_eq!(found(25.0, [0.0, 0.0, -3.52], |_| 1.3), []);
    }

    /// A robot that leans by 8 degrees in its run turns due to a share of the bias about x.
    #[test]
    fn bias_about_x_turns_the_yaw_of_a_leaning_robot() {
        for preroll_s in [2.9, 6.7] {
            for (x_dps, grave) in [(4.0, true), (0.3, false)] {
                let leaning = found(preroll_s, [x_dps, 0.0, 0.0], |t| if t < preroll_s { 0.0 } else { 8.0 });
                // 4.0 °/s sin 8° are 0.56 °/s; while the filter settles, its path turns the yaw too.
                let said = |one: &Finding| one.grave && one.text.starts_with("the gyroscope turns the yaw by 0.");
                assert_eq!(leaning.iter().any(said), grave, "{preroll_s} s: {leaning:?}");
            }
        }
    }
}
