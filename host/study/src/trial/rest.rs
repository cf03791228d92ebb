//! Findings about the rest before a run: whether there was one, and whether the robot was still.

use super::blocks::{blocks, end_of};
use super::data::Data;
use super::finding::{Finding, FindingKind};
use crate::attitude::{Drift, Rest, Series};
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

/// Returns the findings. `has_still`: whether there is a still phase.
pub(super) fn findings(
    data: &Data,
    series: &Series,
    rest: &Rest,
    has_still: bool,
    drift: Option<&Drift>,
) -> Vec<Finding> {
    // A sensor turned by hand needs no rest.
    let is_of_robot = data.speeds() != [CentiRpm(0); 2];
    let unknown = if data.times.has_run() { unknown(data, series, rest, has_still, drift) } else { None };
    let moved = if has_still { tilt_changed(series, rest) } else { None };
    let turned = yaw_turned(series, rest, drift);
    unknown.filter(|_| is_of_robot).into_iter().chain(moved).chain(turned.filter(|_| is_of_robot)).collect()
}

/// Returns the finding that readings are missing where the run starts.
pub(super) fn start_is_missing(data: &Data, gap: &Range<f64>) -> Finding {
    let (Range { start, end }, [what, verb]) = (gap, data.lacking());
    let text = format!(
        "{what} {verb} missing from {start:.2} s to {end:.2} s, where the run starts: yaw, pitch and roll are relative to the \
         rest before {start:.2} s"
    );
    Finding::slight(FindingKind::Rest, text, "")
}

/// Judges unknown uncertainties. The finding is grave if the unknown error turns the yaw.
fn unknown(data: &Data, series: &Series, rest: &Rest, has_still: bool, drift: Option<&Drift>) -> Option<Finding> {
    let slight = |text: String, cure: &str| Some(Finding::slight(FindingKind::Rest, text, cure));
    let long_preroll = "give the plan a pre-roll of 20 s";
    let long_rest = "give the plan a calibration of 5 s, or a pre-roll of 20 s";
    let still_s = rest.before.end - rest.before.start;
    let dps = bias_in_yaw(series, rest, &data.times.run, drift.is_some());
    let is_known = drift.is_some_and(|drift| drift.variance(data.times.run.end).is_some());
    // After a calibration, a rate at rest is a motion: see `yaw_turned`.
    if let Some(dps) = dps.filter(|dps| rest.calibrate_s == 0.0 && !is_known && *dps > CALIBRATED_DPS) {
        let text = format!(
            "the gyroscope turns the yaw by {dps:.2} °/s of its own: it was not calibrated, and the still phase of {still_s:.1} s \
             before the run is too short to remove its bias"
        );
        return Some(Finding::grave(FindingKind::Rest, text, long_rest));
    }
    // The board may have kept the bias of another day, or never had one: nothing in such a log shows it.
    if rest.calibrate_s == 0.0 && still_s < LEAST_RATE_S {
        let text = "there is neither a calibration nor a still phase before the run: the gyroscope's bias is in the yaw, and \
                    nothing shows how large it is";
        return Some(Finding::grave(FindingKind::Rest, text, long_rest));
    }
    if !has_still {
        let text = "there is no still phase before the run: the zero is the attitude at its start, and the uncertainty of the \
                    yaw is unknown";
        return slight(text.to_owned(), long_preroll);
    }
    if drift.is_none() {
        let rate = dps.map_or_else(String::new, |dps| format!(" of about {dps:.2} °/s"));
        let text = format!(
            "the still phase of {still_s:.1} s before the run is too short to show drift and noise: the drift{rate} is not \
             removed, and the uncertainties are unknown"
        );
        return slight(text, long_preroll);
    }
    if !is_known {
        let text = "the gyroscope was not calibrated, and the still phases are too short to show its bias about the body's x \
                    and y: the uncertainty of the yaw is unknown";
        return slight(text.to_owned(), "give the plan a calibration of 5 s");
    }
    None
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
    let [x, y] = match series.held_back_dps(still.clone()).filter(|_| !series.learns_bias()) {
        Some([x, y]) => [x + tilts[0].slope(still.clone())?, y + tilts[1].slope(still.clone())?],
        None => [0.0; 2],
    };
    let seen = run.start..run.end.min(series.yaw().span().end);
    let [roll, pitch] = tilts.map(|tilt| tilt.mean(seen.clone()).unwrap_or_default().to_radians());
    Some((cos(pitch) * (y * sin(roll) + z * cos(roll)) - x * sin(pitch)).abs())
}

/// Returns a finding if the tilt changed at the end of the still phase: the robot moved, or the filter was settling.
fn tilt_changed(series: &Series, rest: &Rest) -> Option<Finding> {
    let over = end_of(&rest.before);
    let range = |values: Vec<f64>| {
        let low = values.iter().copied().reduce(f64::min)?;
        values.into_iter().reduce(f64::max).map(|high| high - low)
    };
    let [pitch, roll] = [series.pitch(), series.roll()].map(|tilt| range(blocks(tilt, &over)));
    let changed_deg = pitch?.max(roll?);
    if changed_deg <= STILL_DEG {
        return None;
    }
    let (text, cure) = if filter_settles(series, &over, changed_deg / rest.filter_s) {
        (
            format!(
                "the board's filter had not settled before the run: the tilt that it states changed by {changed_deg:.1} degrees"
            ),
            "give the plan a calibration of 5 s, or a pre-roll of 20 s",
        )
    } else {
        (
            format!("the robot was not still before the run: its tilt changed by {changed_deg:.1} degrees"),
            "let it hang for longer before the trial",
        )
    };
    Some(Finding::grave(FindingKind::Rest, text, cure))
}

/// Returns whether the board's filter was settling in a still phase. `rate_dps`: the change of its correction that
/// would explain the observed change of the tilt.
fn filter_settles(series: &Series, still: &Range<f64>, rate_dps: f64) -> bool {
    let middle = 0.5 * (still.start + still.end);
    let halves = [still.start..middle, middle..still.end].map(|half| series.held_back_dps(half));
    let [Some(one), Some(other)] = halves else { return false };
    hypot(one[0] - other[0], one[1] - other[1]) > SETTLING * rate_dps
}

/// Returns a finding if the robot moved during the calibration, or still turned when the run began.
fn yaw_turned(series: &Series, rest: &Rest, drift: Option<&Drift>) -> Option<Finding> {
    let cure = "let the robot come to rest before the trial: see rest_at_most in the plan";
    let grave = |text: String| Some(Finding::grave(FindingKind::Rest, text, cure));
    let still = &rest.before;
    if rest.calibrate_s > 0.0 && still.end - still.start >= START_S {
        let end = (still.end - COMPARED_S).max(still.start)..still.end;
        let dps = series.yaw().rate(end).unwrap_or_default().abs();
        if dps > CALIBRATED_DPS {
            return grave(format!(
                "the robot was not still during the calibration or after it: the yaw turned at {dps:.2} °/s at rest"
            ));
        }
    }
    let [dps, u] = drift.map_or([0.0; 2], |drift| drift.residual_dps);
    if dps.abs() - 2.0 * u > RETURN_DPS {
        return grave(format!("the yaw still turned at {:.2} °/s when the run began", dps.abs()));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Collector, Records, Want, Zeroed};
    use biflag_log::schema::biflag::event::Kind;
    use biflag_log::schema::biflag::{Quaternion, Telemetry, Vector};
    use biflag_log::{End, FORMAT, Summary, TrialMeta};
    use nalgebra::{UnitQuaternion, Vector3};

    const TICK_S: f64 = 0.005;

    /// Returns the findings about a trial made by [`zeroed`]. `pitch_deg`: pitch of the robot over time.
    fn found(preroll_s: f64, bias_dps: [f64; 3], pitch_deg: impl Fn(f64) -> f64) -> Vec<Finding> {
        let truth = |t: f64| UnitQuaternion::from_euler_angles(0.0, pitch_deg(t).to_radians(), 0.0);
        zeroed(preroll_s, bias_dps, 0.0..0.0, truth).rest
    }

    /// Returns a trial without a calibration, with a run of 10 s after a still phase. The gyroscope has biases; the filter
    /// begins without them. The frames of the time `lost` are missing.
    fn zeroed(
        preroll_s: f64,
        bias_dps: [f64; 3],
        lost: Range<f64>,
        truth: impl Fn(f64) -> UnitQuaternion<f64>,
    ) -> Zeroed {
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
        Zeroed::new(&collector.finish("log".as_ref(), records))
    }

    /// A robot that turns at 20 °/s from the start of its run. Between a reading at rest and one in the turn the yaw is
    /// unknown, and the zero must not include it.
    #[test]
    fn readings_lost_where_the_run_starts_do_not_move_the_zero() {
        let truth = |t: f64| UnitQuaternion::from_euler_angles(0.0, 0.0, 20f64.to_radians() * (t - 20.0).max(0.0));
        let whole = zeroed(20.0, [0.0; 3], 0.0..0.0, truth);
        assert_eq!(whole.rest, []);
        for (from_s, to_s) in [(19.97, 20.1), (19.8, 20.9), (19.8, 24.3), (14.3, 21.0)] {
            let lossy = zeroed(20.0, [0.0; 3], from_s..to_s, truth);
            let [yaw, expected] = [&lossy, &whole].map(|trial| trial.at(28.0)[0]);
            assert!((yaw - expected).abs() < 0.01, "{from_s} to {to_s} s lost: {yaw}, of {expected}");
            let said =
                format!("telemetry is missing from {:.2} s to {to_s:.2} s, where the run starts", from_s - TICK_S);
            let named = |one: &Finding| one.text.starts_with(&said);
            assert!(lossy.rest.iter().any(named), "{said}: {:?}", lossy.rest);
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
