//! Findings about the frame of the angles: a robot hangs upright at rest, tilts only so far, and turns against its motors.

use super::{Rule, Section};
use crate::attitude::{LARGEST_TILT_DEG, euler_deg, tilt_deg, wrapped};
use crate::text::either;
use crate::trial::data::Data;
use crate::trial::finding::FindingKind::Upright;
use crate::trial::righting::largest_tilt_deg;
use crate::trial::zero::Zeroed;
use crate::trial::zeroing::mean;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use protocol::units::CentiRpm;
use sim::body::attitude::{aligning, of_euler_zyx, of_vector};
use std::f64::consts::PI;

/// Smallest yaw whose sign is judged, degrees.
const LEAST_YAW_DEG: f64 = 5.0;

/// Largest yaw between two attitudes that shows the sense of the turn, degrees.
const HALF_TURN_DEG: f64 = 150.0;

const ANOTHER: &str = "give the angles in a frame whose z axis points up";
pub(super) const AXES: &str = "check the axes of the angles, and the robot's file";

pub(super) const SECTION: Section =
    Section { is_judged: |data| data.times.has_run() && data.speeds() != [CentiRpm(0); 2], rules: RULES };

static RULES: &[Rule] = &[
    Rule::law(Upright, ANOTHER, |data, zeroed| match data.records.import.is_some() && zeroed.rest.is_missing {
        true => Err("no rest before the run"),
        false => Ok(askew(data, zeroed)),
    }),
    Rule::warning(Upright, AXES, tilts_too_far),
];

/// Describes the tilt of an imported robot at rest, if it is too large for a mounting of its marks.
fn askew(data: &Data, zeroed: &Zeroed) -> Option<String> {
    let [_, pitch_deg, roll_deg] = zeroed.zero_deg;
    let deg = tilt_deg(pitch_deg, roll_deg);
    (data.records.import.is_some() && deg > LARGEST_TILT_DEG).then(|| {
        format!(
            "the robot is tilted by {deg:.1} degrees at rest, where it hangs upright{}",
            as_if(&frames(data, zeroed))
        )
    })
}

fn tilts_too_far(data: &Data, zeroed: &Zeroed) -> Option<String> {
    let is_askew = askew(data, zeroed).is_some();
    let angles = zeroed.angles().filter(|angles| angles.tilt_deg > LARGEST_TILT_DEG && !is_askew)?;
    let most_deg = largest_tilt_deg(&data.robot().ok()?)?;
    (angles.tilt_deg > most_deg).then(|| {
        format!(
            "the robot is tilted by {:.1} degrees in the run, where its weight and the thrust of its flagella allow \
             {most_deg:.1}, so that its yaw means nothing{}",
            angles.tilt_deg,
            as_if(&frames(data, zeroed))
        )
    })
}

/// Returns whether the frame of the angles is not the body's, so that the swing cannot be judged.
pub(super) fn is_wrong(data: &Data, zeroed: &Zeroed) -> bool {
    askew(data, zeroed).or_else(|| tilts_too_far(data, zeroed)).is_some()
}

pub(super) fn as_if(frames: &[impl AsRef<str>]) -> String {
    if frames.is_empty() { String::new() } else { format!(": as if {}", either(frames)) }
}

/// Largest ratio of the slower motor's speed to the faster one's in the opposite sense at which the faster one determines the
/// sign of the yaw. With `physical` the sign changes between 0.67 and 0.83.
const SLOWER: f64 = 0.5;

/// Returns the sign of the yaw that follows from the speeds of a trial: the faster motor turns the robot against its own sense,
/// unless the other motor turns the other way and is nearly as fast.
fn sense(data: &Data) -> Option<f64> {
    let [one, other] = data.speeds().map(CentiRpm::rpm);
    let (fast, slow) = if one.abs() > other.abs() { (one, other) } else { (other, one) };
    let are_constant = data.reverse().is_none() && data.records.steer.is_none();
    (are_constant && fast != 0.0 && fast * slow >= -SLOWER * fast * fast).then(|| -fast.signum())
}

/// Returns whether the sign of the yaw contradicts the speeds; `None` if they do not determine it.
pub(super) fn has_other_sense(data: &Data, zeroed: &Zeroed) -> Option<bool> {
    let (sense, angles) = (sense(data)?, zeroed.angles()?);
    let least_deg = angles.yaw_uncertainty_deg.unwrap_or_default().max(LEAST_YAW_DEG);
    (angles.yaw_deg.abs() > least_deg).then_some(angles.yaw_deg * sense < 0.0)
}

/// Describes other frames in which the angles of an import may be: in each of them the robot hangs upright and its tilt is
/// possible.
fn frames(data: &Data, zeroed: &Zeroed) -> Vec<String> {
    let (Some(import), Some(steady)) = (&data.records.import, &zeroed.steady) else { return Vec::new() };
    let most_deg = data.robot().ok().and_then(|robot| largest_tilt_deg(&robot)).unwrap_or(90.0);
    let over = [zeroed.from_s..zeroed.run.start, steady.window.clone()].map(|over| mean(&data.readings, &over));
    let [Some(rest), Some(run)] = over else { return Vec::new() };
    let is_possible = |of: &dyn Fn(Turn) -> Turn| {
        let [from_deg, pitch_deg, roll_deg] = euler_deg(&of(rest));
        let askew = of_euler_zyx([0.0, pitch_deg.to_radians(), roll_deg.to_radians()]);
        let end = euler_deg(&(of(run) * askew.inverse()));
        let yaw_deg = wrapped(end[0] - from_deg);
        let has_sense =
            sense(data).is_none_or(|sense| yaw_deg * sense > -LEAST_YAW_DEG || yaw_deg.abs() > HALF_TURN_DEG);
        let is_tilted = tilt_deg(end[1], end[2]) > most_deg;
        has_sense && !is_tilted && tilt_deg(pitch_deg, roll_deg) <= LARGEST_TILT_DEG
    };
    let of = |w, x, y, z| UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let orders: [(&str, &dyn Fn(Turn) -> Turn); 2] = [
        ("the quaternion has its scalar last", &|q| of(q.k, q.w, q.i, q.j)),
        ("the quaternion has its scalar first", &|q| of(q.i, q.j, q.k, q.w)),
    ];
    let is_quaternion = import.columns.contains("qw=");
    let orders = orders.into_iter().filter(|(_, of)| is_quaternion && is_possible(*of));
    let mut found: Vec<String> = orders.map(|(name, _)| name.to_owned()).collect();
    for (axis, points, up) in UPWARDS {
        let turn = aligning(Vector3::from(up), Vector3::z()).unwrap_or_else(|| of_vector(Vector3::x() * PI));
        let ways: [(&str, &dyn Fn(Turn) -> Turn); 3] = [
            ("of both frames", &|q| turn * q * turn.inverse()),
            ("of the instrument's frame", &|q| turn * q),
            ("of the body's frame", &|q| q * turn.inverse()),
        ];
        let ways = ways.into_iter().filter(|(_, of)| is_possible(*of));
        found.extend(ways.map(|(whose, _)| format!("the {axis} axis {whose} points {points}")));
    }
    found
}

type Turn = UnitQuaternion<f64>;

/// Axes that may be vertical in place of a z axis that points up: the axis, where it points, and up in its frame.
const UPWARDS: [(&str, &str, [f64; 3]); 5] = [
    ("z", "down", [0.0, 0.0, -1.0]),
    ("y", "up", [0.0, 1.0, 0.0]),
    ("y", "down", [0.0, -1.0, 0.0]),
    ("x", "up", [1.0, 0.0, 0.0]),
    ("x", "down", [-1.0, 0.0, 0.0]),
];

#[cfg(test)]
pub(super) mod tests;
