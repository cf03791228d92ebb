//! Findings about the swing of the robot: each flagellum swings it once a turn, so its motion shows whether its speeds can be
//! true.

use super::import::if_askew_deg;
use super::{Rule, Section, frame};
use crate::attitude::{Columns, tilt_deg, wrapped};
use crate::swing::{
    Balance, Cause, Label, Labelled, PIECE_S, Scaled, Swing as Swings, SwingSpeeds, WANDER, label, leans_deg, scaled,
    turned_deg,
};
use crate::text::{decimal, either};
use crate::trial::angles::{Steady, settled_s};
use crate::trial::data::Data;
use crate::trial::finding::FindingKind::{Swing, Upright};
use crate::trial::righting::per_rpm;
use crate::trial::zero::Zeroed;
use protocol::units::CentiRpm;
use sim::body::closure::Closure;
use sim::functions::hypot;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::sample::Sample;
use sim::trial::{Options, Trial};
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::ops::Range;

/// Largest error of a trial's speeds, as a share plus rpm: from a board's encoders, of an import, and of motors without encoders.
const OFF: (f64, f64) = (0.012, 0.1);
const OFF_OF_IMPORT: (f64, f64) = (0.03, 0.3);
const OFF_OF_BLIND: (f64, f64) = (0.25, 2.0);

pub(super) const SECTION: Section = Section { is_judged: |data| !data.is_model(), rules: RULES };

static RULES: &[Rule] = &[
    Rule::warning(
        Swing,
        "see that both motors turn, or record speeds that differ more, or a longer run",
        without_speeds,
    ),
    Rule::note(Swing, "measure the lines of the motors again with `biflag doctor --motors`", off_the_line),
    Rule::note(Upright, frame::AXES, turns_with_its_motors),
    Rule::note(Swing, "check the speeds, and use angles that no filter has smoothed", told_otherwise),
    Rule::law(
        Swing,
        "check the speeds with their unit and signs, the counts per turn of encoders if there are any, the unit of the times, and the unit and frame of the angles",
        other_swing,
    ),
];

/// Mistakes in the frame of the angles, as parts of a sentence.
const FRAME_MIRRORED: &str = "the frame of the angles is mirrored or its z axis points down";
const YAW_CLOCKWISE: &str = "the yaw counts clockwise";
const HALF_TURN: &str = "the frame of the angles is turned by a half about the vertical";
const QUARTER_TURN: &str = "the frame of the angles is turned by a quarter about the vertical";
const OTHER_ORDER: &str = "the angles are turns in another order";
const OTHER_ROBOT: &str = "the robot is not that of its file";
const OTHER_ZERO: &str = "a mark has slipped, so that pitch and roll have another zero";
const OPPOSITE_TURN: &str = "the quaternion or the matrix turns the world's axes into the body's";

/// Returns the mistakes in the frame that look like this mistake of the speeds. `has_other_sense`: whether the sign of the yaw
/// contradicts the speeds.
fn alike(cause: Cause, has_other_sense: Option<bool>) -> &'static [&'static str] {
    match (cause, has_other_sense) {
        (Cause::Sign([true, true]) | Cause::Reversed, _) => &[FRAME_MIRRORED],
        (Cause::Swapped | Cause::Sign(_), Some(true)) => &[YAW_CLOCKWISE],
        (Cause::Swapped, Some(false)) => &[HALF_TURN],
        (Cause::Swapped, None) => &[HALF_TURN, YAW_CLOCKWISE],
        _ => &[],
    }
}

/// Returns the label of a trial for the test of its swing, or why the swing cannot be tested.
pub(crate) fn labelled<'a>(data: &Data, zeroed: &'a Zeroed) -> Result<Labelled<'a>, &'static str> {
    let rpm = data.speeds().map(CentiRpm::rpm);
    let robot = data.robot().map_err(|_| "the robot's file cannot be read")?;
    let steady = zeroed.steady.as_ref().ok_or("the run is too short for steady angles")?;
    let unmeasured = data.records.import.as_ref().map_or(&[][..], |import| &import.constant);
    let has_yaw_alone = data.reverse().is_none() && unmeasured == ["pitch", "roll"];
    let settled_s = if has_yaw_alone { settled_s(&zeroed.seen_run()) } else { steady.swing_s.clone()? };
    let touches = robot.flagellum.mesh(rpm);
    let off = match data.is_recorded() {
        _ if data.is_blind() => OFF_OF_BLIND,
        true => OFF,
        false => OFF_OF_IMPORT,
    };
    // Without encoders, this runs while the speeds are measured.
    let told = if data.is_blind() { steady.measured.get() } else { Some(steady.measured(&zeroed.angles_deg)) };
    let told_rpm = told.and_then(SwingSpeeds::rpm);
    let angles_deg = &zeroed.angles_deg;
    Ok(Labelled { angles_deg, settled_s, rpm, off, touches, told_rpm, has_yaw_alone, balance: None })
}

/// Returns the speeds of motors without encoders, from the swing alone, or else from the swing near the commanded speeds.
pub(crate) fn speeds_without_encoders<'a>(data: &Data, zeroed: &Zeroed, steady: &'a Steady) -> &'a SwingSpeeds {
    steady.measured.get_or_init(|| {
        let alone = SwingSpeeds::of(&zeroed.angles_deg, steady.swing_s.clone());
        let near = alone.not_measured.and_then(|_| SwingSpeeds::near(&labelled(data, zeroed).ok()?));
        near.unwrap_or(alone).with_error(hypot(WANDER, steady.clock_95))
    })
}

/// Judges the speeds of a trial by its swing, or returns why they cannot be judged.
fn judged(data: &Data, zeroed: &Zeroed) -> Result<Label, &'static str> {
    if frame::is_wrong(data, zeroed) {
        return Err("the frame of the angles is not that of the body");
    }
    Ok(label(&Labelled { balance: balance(data, zeroed), ..labelled(data, zeroed)? }))
}

/// Returns the steady attitude of a trial, if it settled and has a zero.
fn balance(data: &Data, zeroed: &Zeroed) -> Option<Balance> {
    let angles = zeroed.angles().filter(|_| !zeroed.rest.is_missing)?;
    zeroed.steady.as_ref().filter(|steady| steady.settled)?;
    let per_rpm = per_rpm(&data.robot().ok()?)?;
    // The tilt at rest may be that of the mounting or of the instrument's frame.
    let [_, pitch_deg, roll_deg] = if_askew_deg(zeroed, &angles);
    let other_deg = if data.records.import.is_some() { tilt_deg(pitch_deg, roll_deg) } else { angles.tilt_deg };
    let tilt_deg = [angles.tilt_deg.min(other_deg), angles.tilt_deg.max(other_deg)];
    Some(Balance { yaw_deg: angles.yaw_deg, tilt_deg, per_rpm })
}

/// Returns the motion of an import's robot model with the import's speeds.
fn model<'a>(data: &Data, zeroed: &'a Zeroed, own: &Labelled<'a>) -> Option<Labelled<'a>> {
    // A flagellum that wraps beside one that stands bends as the latter stands, which an import does not know.
    let other_rpm = [0, 1].map(|k| if own.rpm[k] == 0.0 { own.rpm[1 - k] } else { own.rpm[k] });
    if !own.touches && data.robot().ok()?.flagellum.mesh(other_rpm) {
        return None;
    }
    let angles_deg = zeroed.steady.as_ref()?.modelled.get_or_init(|| modelled(data.robot().ok()?, own.rpm, 1.0));
    Some(Labelled { angles_deg: angles_deg.as_ref()?, settled_s: MODELLED_S, ..own.clone() })
}

fn other_swing(data: &Data, zeroed: &Zeroed) -> Result<Option<String>, &'static str> {
    let rpm = data.speeds().map(CentiRpm::rpm);
    if rpm == [0.0; 2] {
        return Ok(None);
    }
    let at = format!("{} and {} rpm", rpm[0], rpm[1]);
    match judged(data, zeroed)? {
        Label::Wrong(causes) => {
            let has_other_sense = frame::has_other_sense(data, zeroed);
            let frames: BTreeSet<&str> =
                causes.iter().flat_map(|cause| alike(*cause, has_other_sense)).copied().collect();
            let all: Vec<String> =
                causes.iter().map(|cause| said(cause, data)).chain(frames.into_iter().map(str::to_owned)).collect();
            Ok(Some(format!("the robot does not swing as at {at}, but as if {}", either(&all))))
        }
        Label::HardlySwings(swing) => {
            let (which, why) = match swing {
                Swings::Whole => (
                    "the robot hardly swings up to the end of the run",
                    "the motors stood, or the angles are radians or were smoothed",
                ),
                Swings::Tilt => ("pitch and roll hardly swing", "they are radians"),
                Swings::Yaw => ("the yaw hardly swings", "it is in radians, or the motors stood"),
            };
            Ok(Some(format!("{which}, and would at {at}, once a turn of each flagellum: {why}")))
        }
        Label::Right if data.records.import.is_none() => Ok(None),
        Label::Right => unlike_its_model(data, zeroed),
        Label::NotJudged(why) => Err(why),
    }
}

/// The model of a robot swings steadily between these times, s.
const MODELLED_S: Range<f64> = 10.0..30.0;

/// Edges per turn of the model's flagella: more do not change the directions.
const EDGES: f64 = 15.0;

/// Largest turn of a swing relative to its model's of an import in the right frame, and least turn of a wrong one, degrees.
const TURNED_DEG: (f64, f64) = (30.0, 45.0);

/// Least tilt whose direction is judged, relative to the tilt at rest, which may be that of the instrument's frame.
const LEANS: f64 = 3.0;

/// Largest differences of a turn from that of a model of another stiffness or that of a cause, and from a quarter or a half turn,
/// degrees.
const NEAR_DEG: (f64, f64) = (35.0, 55.0);

/// Describes an error of an import's angles that the directions or the sizes of its swing show, compared with its robot's model.
fn unlike_its_model(data: &Data, zeroed: &Zeroed) -> Result<Option<String>, &'static str> {
    let own = labelled(data, zeroed)?;
    let model = model(data, zeroed, &own).ok_or(NO_TURN)?;
    let turned_deg = turn(data, &model, &own, turned_deg);
    // Flagella that touch change the mean tilt and the size of the swing, but hardly its directions.
    let rest_deg = tilt_deg(zeroed.zero_deg[1], zeroed.zero_deg[2]);
    let is_leaning = balance(data, zeroed).is_some_and(|balance| balance.tilt_deg[0] > LEANS * rest_deg);
    let leans_deg = if is_leaning && !own.touches { turn(data, &model, &own, leans_deg) } else { None };
    let kind = |(angle, factor): (Scaled, f64)| (angle, factor > 1.0);
    // Stiffness changes the swing of the yaw, and of all angles.
    let is_told = |found: &(Scaled, f64)| {
        let is_same = |other: &Labelled| scaled(other, &own).map(kind) == Some(kind(*found));
        [Scaled::Pitch, Scaled::Roll].contains(&found.0) || is_of_any_stiffness(data, &model, is_same)
    };
    let scaled = scaled(&model, &own).filter(|found| !own.touches && is_told(found));
    // A turn of the frame turns both; the inverse at a small yaw reverses the lean alone.
    let is_upright = turned_deg.or(leans_deg).is_some_and(|deg| deg.abs() < TURNED_DEG.0);
    let turned =
        [("swings in directions that are", turned_deg, 0.0), ("leans in a direction that is", leans_deg, 180.0)];
    let is_turned = |(_, deg, _): &(&str, Option<f64>, f64)| deg.is_some_and(|deg| deg.abs() > TURNED_DEG.1);
    if let Some((how, Some(deg), off_deg)) = turned.into_iter().find(is_turned) {
        let yaw_deg = zeroed.zero_deg[0] + zeroed.angles().map_or(0.0, |angles| angles.yaw_deg);
        let is_near = |angle_deg: f64| wrapped(deg - angle_deg).abs() < NEAR_DEG.0;
        let is_turn = |angle_deg: f64| !is_upright && wrapped(deg - angle_deg).abs() < NEAR_DEG.1;
        let swapped = Cause::Swapped.to_string();
        let frames = [
            (QUARTER_TURN, is_turn(90.0) || is_turn(-90.0)),
            (HALF_TURN, is_turn(180.0)),
            (&swapped, is_turn(180.0)),
            (YAW_CLOCKWISE, turned_deg.is_some() && is_turn(180.0)),
            (OTHER_ORDER, !is_upright && is_near(-yaw_deg)),
            (OPPOSITE_TURN, is_near(yaw_deg + off_deg)),
            (OTHER_ZERO, is_upright),
            (OTHER_ROBOT, true),
        ];
        let causes: Vec<&str> = frames.into_iter().filter(|(_, is_likely)| *is_likely).map(|(name, _)| name).collect();
        let causes = frame::as_if(&causes);
        return Ok(Some(format!("the robot {how} turned by {deg:.0} degrees from its model's{causes}")));
    }
    // A turn of the frame changes the shares of pitch and roll, but not the yaw's, and none becomes small alone.
    let is_scale = |(angle, factor): &(Scaled, f64)| {
        *angle == Scaled::All || *angle == Scaled::Yaw && turned_deg.is_none() || *factor < 0.5 || is_upright
    };
    let Some((angle, factor)) = scaled.filter(is_scale) else { return turned_deg.map(|_| None).ok_or(NO_TURN) };
    let name = ["yaw", "pitch", "roll", "attitude"][angle as usize];
    let (beside, it) = match angle {
        Scaled::All => ("", "all angles had another scale or were smoothed"),
        _ => (" beside the other angles", "it had another scale"),
    };
    Ok(Some(format!(
        "the {name} swings {factor:.1} times as much{beside} as that of the robot's model: as if {it}, or as if {OTHER_ROBOT}"
    )))
}

/// Why a turn of the frame is not judged.
const NO_TURN: &str = "the swing does not show whether the frame of the angles is turned about the vertical, or whether the yaw counts clockwise";

/// Stiffnesses of ordinary robots, relative to their file.
const STIFFER: [f64; 2] = [0.6, 1.67];

/// Returns whether the models of a softer and of a stiffer robot show the same as the `model` of its file.
fn is_of_any_stiffness(data: &Data, model: &Labelled, is_same: impl Fn(&Labelled) -> bool) -> bool {
    STIFFER.into_iter().all(|stiffer| {
        let angles_deg = data.robot().ok().and_then(|robot| modelled(robot, model.rpm, stiffer));
        angles_deg.is_some_and(|angles_deg| is_same(&Labelled { angles_deg: &angles_deg, ..model.clone() }))
    })
}

/// Returns the turn of an import's motion relative to that of its robot's model; `None` if the turn depends on how stiff the robot
/// is.
fn turn(data: &Data, model: &Labelled, own: &Labelled, of: fn(&Labelled, &Labelled) -> Option<f64>) -> Option<f64> {
    let deg = of(model, own)?;
    let is_turned = |deg: f64| deg.abs() > TURNED_DEG.1;
    let is_near = |other_deg: f64| is_turned(other_deg) && wrapped(other_deg - deg).abs() < NEAR_DEG.0;
    let is_same = |other: &Labelled| of(other, own).is_some_and(is_near);
    (deg.abs() < TURNED_DEG.0 || is_turned(deg) && is_of_any_stiffness(data, model, is_same)).then_some(deg)
}

/// Returns the motion of a robot's model whose flagella are so many times as stiff.
fn modelled(mut robot: Robot, rpm: [f64; 2], stiffer: f64) -> Option<Columns<3>> {
    let flagellum = &mut robot.flagellum;
    flagellum.young_pa *= stiffer;
    let turn_m = hypot(TAU * flagellum.helix_radius_m, flagellum.pitch_m);
    flagellum.edge_length_m = flagellum.edge_length_m.max(turn_m / EDGES);
    robot.tank = None;
    let profile = SpeedProfile::constant(rpm, MODELLED_S.end).ok()?;
    let mut angles_deg = Columns::default();
    for sample in Trial::new(&robot, Closure::Full, profile, Options::default()).ok()? {
        let Sample { time_s, yaw_rad, pitch_rad, roll_rad, .. } = sample.ok()?;
        angles_deg.push(time_s, [yaw_rad, pitch_rad, roll_rad].map(f64::to_degrees));
    }
    Some(angles_deg)
}

/// Describes a cause, with times on the clock of the user's table.
fn said(cause: &Cause, data: &Data) -> String {
    match (cause, &data.records.import) {
        (Cause::StopEarly { at_s }, Some(import)) if import.trial.is_empty() => {
            let [from, before] = [data.times.run.start, *at_s].map(|time_s| data.by_table_s(time_s));
            let (from, to) = (decimal(from, 2), (before - PIECE_S).floor());
            format!("the motors stopped before {before:.0} s by the table's clock (try --run {from},{to})")
        }
        _ => cause.to_string(),
    }
}

fn without_speeds(data: &Data, zeroed: &Zeroed) -> Option<String> {
    let why = zeroed.steady.as_ref().filter(|_| data.is_blind())?.measured(&zeroed.angles_deg).not_measured?;
    let [w1, w2] = data.speeds().map(CentiRpm::rpm);
    let text = format!(
        "the motors have no encoders, and the swing does not tell whether they turned at {w1} and {w2} rpm, or at all: {why}"
    );
    (w1 != 0.0 || w2 != 0.0).then_some(text)
}

/// Largest difference of a speed from the commanded one without a note: a share, plus rpm.
const USUAL: (f64, f64) = (0.1, 1.0);

fn off_the_line(data: &Data, zeroed: &Zeroed) -> Option<String> {
    let measured = zeroed.steady.as_ref().filter(|_| data.is_blind())?.measured(&zeroed.angles_deg);
    let told = measured.rpm()?;
    let [w1, w2] = data.speeds().map(CentiRpm::rpm);
    let is_off = |(told, rpm): (f64, f64)| (told - rpm).abs() > USUAL.0 * rpm.abs() + USUAL.1;
    [(told[0], w1), (told[1], w2)].into_iter().any(is_off).then(|| {
        let [one, two] = told.map(|rpm| decimal(rpm, 1));
        format!("by the swing the motors turned at {one} and {two} rpm, where {w1} and {w2} were commanded")
    })
}

/// Least difference of such speeds from the label's, relative to its largest error.
const TOLD: f64 = 1.5;

/// Describes speeds that the swing tells by itself and that differ from the label's, though no cause explains it better.
fn told_otherwise(data: &Data, zeroed: &Zeroed) -> Option<String> {
    let own = labelled(data, zeroed).ok().filter(|_| !data.is_blind())?;
    let told = own.told_rpm.filter(|told| (0..2).any(|k| (told[k] - own.rpm[k]).abs() > TOLD * own.error_rpm(k)))?;
    (judged(data, zeroed) == Ok(Label::Right)).then(|| {
        let [[one, two], [w1, w2]] = [told, own.rpm].map(|rpm| rpm.map(|speed| decimal(speed, 1)));
        format!("by the swing alone the motors turned at {one} and {two} rpm, and not at {w1} and {w2}")
    })
}

fn turns_with_its_motors(data: &Data, zeroed: &Zeroed) -> Option<String> {
    if !frame::has_other_sense(data, zeroed)? || frame::is_wrong(data, zeroed) {
        return None;
    }
    let both = Cause::Sign([true; 2]).to_string();
    let causes = match judged(data, zeroed) {
        // The senses of the motors are right, so the yaw is wrong.
        Ok(Label::Right) => vec![YAW_CLOCKWISE, OPPOSITE_TURN],
        // The finding about the swing names these causes.
        Ok(Label::Wrong(_)) => return None,
        _ => vec![&both[..], FRAME_MIRRORED, YAW_CLOCKWISE],
    };
    let causes = either(&causes);
    Some(format!(
        "the robot turns in the sense of its motors, or of the faster one, and would turn against it: as if {causes}"
    ))
}

#[cfg(test)]
mod tests;
