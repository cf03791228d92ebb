//! Findings about a trial that other instruments measured: about its table, its motors, its rest.

use super::{Rule, Section};
use crate::attitude::{Columns, LARGEST_TILT_DEG, Reading, Track, Unwrap, euler_deg, rotation, tilt_deg, wrapped};
use crate::text::count;
use crate::trial::angles::Angles;
use crate::trial::data::Data;
use crate::trial::finding::FindingKind::Conduct;
use crate::trial::import_rest::REST_S;
use crate::trial::zero::Zeroed;
use biflag_log::ImportMeta;
use nalgebra::Vector3;
use protocol::units::CentiRpm;
use sim::body::attitude::{of_euler_zyx, rotation_between};
use std::ops::Range;

/// Largest difference of equal speeds: rpm, plus a share.
const SAME_RPM: f64 = 0.3;
const SAME_SHARE: f64 = 0.03;

/// Smallest number of rows per turn of the faster flagellum.
const LEAST_ROWS_A_TURN: f64 = 4.0;

/// A change between two rows above both limits, degrees and °/s, and above the noise is not a motion. The fastest full turn takes
/// 3 s.
const JUMP_DEG: f64 = 5.0;
const JUMP_DPS: f64 = 300.0;

/// The first limit for flagella that mesh, degrees: they snap, and turn the robot by some 15 degrees between two rows, by 31 at
/// (-67.4, -64.9) rpm in a tank.
const SNAP_DEG: f64 = 45.0;

/// A change is not a motion either if it differs from the mean of the changes before and after it by more than this angle,
/// degrees, by more than this multiple of the first decile of all such differences about the axis with the most noise, which normal
/// noise hardly ever does, and by more than this multiple of the table's smallest change, which rounding does not.
const ODD_DEG: f64 = 2.5;
const ODD_NOISES: f64 = 48.0;
const ODD_STEPS: f64 = 3.5;

/// Number and duration, s, of rows with the same attitude in a run above which they are not a measurement.
const STOOD_ROWS: usize = 10;
const STOOD_S: f64 = 3.0;

/// Largest difference of an angle without a note if the uncertainty of the instrument is unknown, degrees.
const UNKNOWN_DEG: f64 = 1.0;

/// Smallest tilt at rest that is significant, as a multiple of its noise.
const NOISES: f64 = 3.0;

/// Rows of zeros are not a measurement if there are at least this many, and the next reading is further from zero than this
/// angle, degrees, and this many of the table's smallest steps.
const LEAST_ZEROS: usize = 3;
const ZERO_DEG: f64 = 0.5;
const ZERO_STEPS: f64 = 3.0;

/// Largest ratio of successive intervals between rows without a gap.
const GAP: f64 = 3.0;

const LEAVE_EMPTY: &str = "leave lost readings empty in the table";

pub(super) const SECTION: Section = Section { is_judged: |data| data.records.import.is_some(), rules: RULES };

static RULES: &[Rule] = &[
    Rule::warning(Conduct, "import one run at constant speeds: name it with --run", |data, zeroed| {
        other_speed(data, &zeroed.steady.as_ref()?.window)
    }),
    Rule::warning(Conduct, "import a table with four rows or more for a turn", |data, _| sparse(data)),
    Rule::warning(Conduct, "let the run begin where the motors start", |data, _| turned_before(data)),
    Rule::each(Conduct, None, |data| Vec::from_iter(lost(data))),
    Rule::warning(Conduct, LEAVE_EMPTY, |data, _| zeros(data)),
    Rule::warning(Conduct, LEAVE_EMPTY, |data, _| straight(data)),
    Rule::note(
        Conduct,
        "give the angles in a frame whose z axis is vertical, or state a larger --uncertainty",
        |_, zeroed| side_of_tilt(zeroed),
    ),
    Rule::note(Conduct, "", |data, _| {
        let rows = data.records.import.as_ref()?.left_out as usize;
        (rows > 0).then(|| format!("{} of the table without a value, left out", count(rows, "row")))
    }),
    Rule::note(Conduct, "", |data, _| {
        let constant = &data.records.import.as_ref()?.constant;
        let were = if constant.len() == 1 { "was" } else { "were" };
        (!constant.is_empty()).then(|| format!("{} {were} not measured: one value in all rows", constant.join(", ")))
    }),
    Rule::note(Conduct, "", |data, _| crate::plan::units::temperature(data.records.import.as_ref()?.temperature_c?)),
    Rule::warning(Conduct, "check that the table is of this trial, its unit and its instrument", |data, _| {
        other_yaw(data.records.import.as_ref()?)
    }),
    Rule::note(Conduct, "state it with --uncertainty", |data, _| {
        let import = data.records.import.as_ref()?;
        let is_stated = import.yaw_uncertainty_deg.is_some() && import.tilt_uncertainty_deg.is_some();
        (!is_stated).then(|| "the import states no uncertainty of its instrument".to_owned())
    }),
];

/// Describes the difference of the yaw from the recording's, if it exceeds the uncertainty.
fn other_yaw(import: &ImportMeta) -> Option<String> {
    let rms_deg = import.clock_rms_deg?;
    // Zero and drift take up more than a half of an error of the scale, which most of a recording's uncertainty is.
    let of_trial_deg = 0.6 * import.trial_yaw_uncertainty_deg?;
    let u_deg = [import.yaw_uncertainty_deg.unwrap_or(UNKNOWN_DEG), of_trial_deg];
    (rms_deg * rms_deg > u_deg[0] * u_deg[0] + u_deg[1] * u_deg[1]).then(|| {
        format!(
            "its yaw differs from that of {} by {rms_deg:.2}° RMS, more than both uncertainties explain, also without zero, drift and clock",
            import.trial
        )
    })
}

/// Names a motor that did not turn at the trial's speed while the angles were averaged.
fn other_speed(data: &Data, window: &Range<f64>) -> Option<String> {
    let wanted = data.speeds().map(|speed| speed.rpm());
    [0, 1].into_iter().find_map(|k| {
        let rpm = 60.0 * data.motor_turns(k).rate(window.clone())?;
        let is_other = (rpm - wanted[k]).abs() > SAME_RPM + SAME_SHARE * wanted[k].abs();
        is_other.then(|| {
            format!(
                "motor {} turned at {rpm:.1} rpm while the angles were averaged, and the trial's speed is {} rpm",
                k + 1,
                wanted[k]
            )
        })
    })
}

/// Returns a note if the result depends on the cause of the tilt at rest: the mounting on the body, as is assumed, or an
/// instrument's frame that is not vertical, which does not turn with the body.
fn side_of_tilt(zeroed: &Zeroed) -> Option<String> {
    let [_, pitch_deg, roll_deg] = zeroed.zero_deg;
    let seen_deg = NOISES * noise_at_rest_deg(zeroed)..=LARGEST_TILT_DEG;
    let angles = zeroed.angles().filter(|_| seen_deg.contains(&tilt_deg(pitch_deg, roll_deg)))?;
    let body = [angles.yaw_deg, angles.pitch_deg, angles.roll_deg];
    let [yaw, pitch, roll] = if_askew_deg(zeroed, &angles);
    let others = [yaw, pitch, roll];
    let stated = [angles.yaw_uncertainty_deg, angles.pitch_uncertainty_deg, angles.roll_uncertainty_deg];
    let matters = |k: usize| (others[k] - body[k]).abs() > stated[k].unwrap_or(UNKNOWN_DEG);
    let text = format!(
        "the tilt at rest, pitch {pitch_deg:.1}° and roll {roll_deg:.1}°, is taken for that of the mounting on the body; if it \
         is the instrument's frame that is askew, yaw, pitch and roll are {yaw:.2}°, {pitch:.2}° and {roll:.2}°"
    );
    (0..3).any(matters).then_some(text)
}

/// Returns yaw, pitch and roll if the tilt at rest is that of the instrument's frame.
pub(super) fn if_askew_deg(zeroed: &Zeroed, angles: &Angles) -> [f64; 3] {
    let [_, pitch_deg, roll_deg] = zeroed.zero_deg;
    let of = |angles_deg: [f64; 3]| of_euler_zyx(angles_deg.map(f64::to_radians));
    let askew = of([0.0, pitch_deg, roll_deg]);
    let body = of([angles.yaw_deg, angles.pitch_deg, angles.roll_deg]);
    let [yaw, pitch, roll] = euler_deg(&(askew.inverse() * body * askew));
    // The yaw may have made full turns.
    [angles.yaw_deg + wrapped(yaw - angles.yaw_deg), pitch, roll]
}

/// Returns the standard error of the tilt at rest, degrees, from the scatter of its rows.
fn noise_at_rest_deg(zeroed: &Zeroed) -> f64 {
    let rest = 2.0 * zeroed.from_s - zeroed.run.start..zeroed.run.start;
    let [_, pitch, roll] = zeroed.angles_deg.tracks();
    let variance = |angle: Track| {
        let of = angle.time_s.iter().zip(angle.value).filter(|(time, _)| rest.contains(time)).map(|(_, deg)| *deg);
        let (count, sum) = of.clone().fold((0.0, 0.0), |(count, sum), deg| (count + 1.0, sum + deg));
        of.map(|deg| (deg - sum / count) * (deg - sum / count)).sum::<f64>() / (count * (count - 1.0)).max(1.0)
    };
    (variance(pitch) + variance(roll)).sqrt()
}

/// Returns what is wrong if the table has too few rows per turn.
fn sparse(data: &Data) -> Option<String> {
    let fastest_rpm = data.speeds().iter().fold(0.0, |fastest: f64, speed| fastest.max(speed.rpm().abs()));
    let rows_a_turn = 60.0 / (fastest_rpm * data.motors.interval_s().unwrap_or_default());
    let text = format!(
        "the table has {rows_a_turn:.1} rows for a turn of the faster flagellum: the robot swings with each turn, so that \
         means of so few may be off by degrees"
    );
    (rows_a_turn < LEAST_ROWS_A_TURN).then_some(text)
}

/// Returns what is wrong if a motor turned in the rest before the run.
fn turned_before(data: &Data) -> Option<String> {
    let (run, step_s) = (&data.times.run, data.motors.interval_s().unwrap_or_default());
    // Where rows are missing, the turns between two rows may be those after the start.
    let last_s = data.motors.time_s.iter().copied().take_while(|time_s| *time_s <= run.start).last()?;
    let before = (run.start - REST_S).max(data.times.preroll.start)..last_s.min(run.start - 2.0 * step_s);
    let rate = |k: usize| data.motor_turns(k).rate(before.clone()).unwrap_or_default();
    let k = [0, 1].into_iter().find(|k| before.end > before.start && 60.0 * rate(*k).abs() > SAME_RPM)?;
    Some(format!("motor {} turned before the run, so that the zero of the angles is not that of a rest", k + 1))
}

/// Returns what is wrong if the attitude jumps, or is constant in the run: the readings were lost, or have another
/// unit. The remedy follows the colon.
fn lost(data: &Data) -> Option<String> {
    let (run, readings) = (&data.times.run, &data.readings);
    let is_apart = data.robot().is_ok_and(|robot| !robot.flagellum.mesh(data.speeds().map(CentiRpm::rpm)));
    let odd_deg = odd(readings);
    let decile = |axis: usize| {
        let rows = readings.iter().skip(2).zip(&odd_deg).filter(|(row, _)| run.contains(&row.0));
        let mut sorted: Vec<f64> = rows.map(|(_, deg)| deg[axis].abs()).collect();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 10).map_or(0.0, |noise| ODD_NOISES * noise)
    };
    let turned_deg = |pair: &[(f64, Reading)]| turned_deg(&pair[0].1, &pair[1].1);
    let steps = readings.windows(2).map(turned_deg).filter(|deg| *deg > 1e-6);
    let rounding_deg = ODD_STEPS * steps.fold(f64::INFINITY, f64::min);
    let noise_deg = [0, 1, 2].map(decile).into_iter().fold(rounding_deg, f64::max);
    let jump_deg = noise_deg.max(if is_apart { JUMP_DEG } else { SNAP_DEG });
    let most_deg = if is_apart { noise_deg.max(ODD_DEG) } else { f64::INFINITY };
    let mut stood_from = 0;
    for (i, pair) in (1_usize..).zip(readings.windows(2)) {
        let [(before_s, before), (now_s, now)] = [&pair[0], &pair[1]].map(|(time, reading)| (*time, reading.attitude));
        let angle_deg = turned_deg(pair);
        // The change beside a jump is odd by half of it.
        let [odd_deg, next_deg] = [i, i + 1].map(|i| odd_deg.get(i.wrapping_sub(2)).map_or(0.0, Vector3::norm));
        if odd_deg > most_deg.max(next_deg) || angle_deg > jump_deg && angle_deg / (now_s - before_s) > JUMP_DPS {
            let (by_deg, at_s) = (angle_deg.max(odd_deg), data.by_table_s(now_s));
            return Some(format!(
                "the attitude jumps by {by_deg:.0}° at {at_s:.2} s, faster than the robot turns: {LEAVE_EMPTY}, and check the \
                 units of the angles"
            ));
        }
        if now != before {
            stood_from = i;
        }
        let from_s = readings[stood_from].0;
        if i - stood_from >= STOOD_ROWS && now_s - from_s.max(run.start) > STOOD_S && run.contains(&now_s) {
            return Some(format!(
                "the attitude does not change for more than {STOOD_S} s from {:.1} s on: {LEAVE_EMPTY}",
                data.by_table_s(from_s)
            ));
        }
    }
    None
}

/// Returns the angle between two attitudes, degrees.
fn turned_deg(one: &Reading, other: &Reading) -> f64 {
    rotation_between(&rotation(one.attitude), &rotation(other.attitude)).norm().to_degrees()
}

/// Describes an angle that is a straight line in a part of the run, to the table's rounding: it was interpolated or clipped.
fn straight(data: &Data) -> Option<String> {
    let [w1, w2] = data.speeds().map(|speed| speed.rpm().abs());
    // Equal motors may leave the robot upright.
    if w1 == w2 {
        return None;
    }
    let (mut angles, mut unwrap) = (Columns::<3>::default(), Unwrap::default());
    for (time_s, reading) in data.readings.iter().filter(|(time_s, _)| data.times.run.contains(time_s)) {
        angles.push(*time_s, unwrap.angles_deg(&rotation(reading.attitude)));
    }
    let time_s = &angles.time_s;
    angles.values.iter().zip(["yaw", "pitch", "roll"]).find_map(|(values, angle)| {
        let changes = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|change| *change > 1e-9);
        let step_deg = changes.fold(f64::INFINITY, f64::min);
        // The largest distance from the line through both ends of a part.
        let bend_deg = |from: usize| {
            let to = time_s.partition_point(|later_s| *later_s <= time_s[from] + STOOD_S);
            let rate = (values.get(to)? - values[from]) / (time_s[to] - time_s[from]);
            let off = |i: usize| (values[i] - values[from] - rate * (time_s[i] - time_s[from])).abs();
            (to - from >= STOOD_ROWS).then(|| (from..to).map(off).fold(0.0, f64::max))
        };
        let bends_deg: Vec<f64> = (0..values.len()).step_by(STOOD_ROWS).map_while(bend_deg).collect();
        let is_rounded = bends_deg.iter().all(|bend| *bend < 100.0 * step_deg);
        let straight = bends_deg.iter().position(|bend| *bend < 2.0 * step_deg).filter(|_| !is_rounded)?;
        let from_s = data.by_table_s(time_s[straight * STOOD_ROWS]);
        Some(format!("the {angle} is a straight line for more than {STOOD_S} s from {from_s:.1} s on, as if interpolated or clipped"))
    })
}

/// Returns the difference of each change between two rows, from the second change on, from the mean of the changes before and
/// after it, about the body's axes, degrees; 0 beside a gap.
fn odd(readings: &[(f64, Reading)]) -> Vec<Vector3<f64>> {
    let change = |pair: &[(f64, Reading)]| {
        let [one, other] = [0, 1].map(|k| rotation(pair[k].1.attitude));
        (pair[1].0 - pair[0].0, rotation_between(&one, &other))
    };
    let changes: Vec<(f64, Vector3<f64>)> = readings.windows(2).map(change).collect();
    let odd = |three: &[(f64, Vector3<f64>)]| {
        let [(before_s, before), (now_s, now), (after_s, after)] = [three[0], three[1], three[2]];
        let is_gap = now_s.max(before_s).max(after_s) > GAP * now_s.min(before_s).min(after_s);
        let expected = (before / before_s + after / after_s) * (0.5 * now_s);
        if is_gap { Vector3::zeros() } else { (now - expected).map(f64::to_degrees) }
    };
    changes.windows(3).map(odd).collect()
}

/// Returns what is wrong if rows of the run contain zeros between other attitudes: many instruments write zeros when they
/// lose the robot.
fn zeros(data: &Data) -> Option<String> {
    let run = data.readings.iter().filter(|(time_s, _)| data.times.run.contains(time_s));
    let (zeros, others): (Vec<&(f64, Reading)>, Vec<_>) =
        run.partition(|(_, reading)| reading.attitude == [1.0, 0.0, 0.0, 0.0]);
    let steps = others.windows(2).map(|pair| turned_deg(&pair[0].1, &pair[1].1)).filter(|deg| *deg > 1e-6);
    let least_deg = ZERO_DEG.max(ZERO_STEPS * steps.fold(f64::INFINITY, f64::min).min(1.0));
    // The next reading that is not zero shows where the robot was.
    let is_lost = |(time_s, zero): &(f64, Reading)| {
        let next = others.iter().find(|(later_s, _)| later_s > time_s).or(others.last());
        next.is_some_and(|(_, reading)| turned_deg(zero, reading) > least_deg)
    };
    let lost = zeros.iter().filter(|row| is_lost(row)).count();
    let text =
        format!("{} of the run with yaw, pitch and roll of exactly zero, unlike those beside them", count(lost, "row"));
    (lost >= LEAST_ZEROS).then_some(text)
}
