//! Two motions of one robot: by how much one is turned, leans or swings beside the other.

use super::causes::{Cause, SLOWEST_RPM};
use super::fit::{angle_deg, size};
use super::lines::Fitter;
use super::motion::Motion;
use super::score::off_deg;
use super::{Doubts, Labelled, NEAR_LEFT, Readings, is_near};
use crate::attitude::wrapped;
use sim::functions::{exp, ln};

/// Largest difference of two motors' estimates of the turn of a frame that agree, degrees.
const AGREED_DEG: f64 = 30.0;

/// Least mean tilt whose direction is judged, degrees: phases of the flagella tilt a robot by two.
pub const LEAN_DEG: f64 = 3.0;

/// Number of beats of both motors that a mean swing needs.
const BEATS: f64 = 2.0;

/// A side (forwards or backwards) lacks a motor if its power relative to the other side is less than the model's by this factor.
const SIDED: f64 = 8.0;

/// Least share of the power on a side to which a motor turns.
const LEAST_SIDE: f64 = 0.25;

/// A swing that is larger or smaller than another by this factor has another scale.
const SCALED: f64 = 1.5;

/// Returns the angle by which the body's x and y axes are turned about its z axis between two motions of one robot, degrees;
/// `None` if the motors disagree, or their lines overlap.
pub fn turned_deg(one: &Labelled, other: &Labelled) -> Option<f64> {
    let off = |trial: &Labelled| {
        let motion = Motion::of(trial.angles_deg, trial.settled_s.clone())?;
        let (_, fit) = Readings { fitter: &Fitter::new(&motion), trial }.at(trial.rpm, 3)?;
        let is_told = |k: usize| trial.rpm[k].abs() >= SLOWEST_RPM;
        let is_clear = fit.left.iter().all(|left| *left < NEAR_LEFT);
        let lines = [0, 1].map(|k| fit.motor(k).filter(|_| is_told(k) && is_clear).map(|line| off_deg(line, k)));
        (0..2).all(|k| lines[k].is_some() == is_told(k)).then_some(lines)
    };
    let (one, other) = (off(one)?, off(other)?);
    let turned = [0, 1].map(|k| Some(wrapped(other[k]? - one[k]?)));
    match turned {
        [Some(a), Some(b)] => (wrapped(b - a).abs() < AGREED_DEG).then(|| wrapped(a + wrapped(b - a) / 2.0)),
        [Some(a), None] | [None, Some(a)] => Some(a),
        [None, None] => None,
    }
}

/// Returns the angle by which the mean tilt is turned about the vertical between two motions of one robot, degrees; `None` if one
/// hardly tilts.
pub fn leans_deg(one: &Labelled, other: &Labelled) -> Option<f64> {
    let [one, other] = [one.lean_deg()?, other.lean_deg()?];
    (size(one).min(size(other)) > LEAN_DEG).then(|| angle_deg(other, one))
}

/// Returns the causes if the swing at nearly equal speeds lacks a side that the swing of the robot's model has; `None` if it
/// lacks none, or if the motion does not show it. Only their senses distinguish motors of nearly equal speeds.
pub fn other_sides(model: &Labelled, own: &Labelled) -> Option<Vec<Cause>> {
    let motion = Motion::of(own.angles_deg, own.settled_s.clone())?;
    let doubts = Doubts::of(own, &motion);
    if doubts.is_noisy || own.rpm.iter().any(|rpm| rpm.abs() < SLOWEST_RPM) {
        return None;
    }
    let sides = |motion: &Motion| {
        let reach_rpm = own.fastest_rpm() * own.off.0 + own.off.1;
        let slowest_rpm = own.rpm[0].abs().min(own.rpm[1].abs());
        Fitter::new(motion).sides((slowest_rpm - reach_rpm) / 60.0..(own.fastest_rpm() + reach_rpm) / 60.0)
    };
    let expected = sides(&Motion::of(model.angles_deg, model.settled_s.clone())?);
    let turned = sides(&motion);
    let falls_short = |side: usize| turned[side] * expected[1 - side] * SIDED < expected[side] * turned[1 - side];
    let weak = (0..2).find(|&side| falls_short(side))?;
    let of_one = |k: usize| Cause::Sign([k == 0, k == 1]);
    let motors: Vec<usize> = (0..2).filter(|&k| (own.rpm[k] > 0.0) == (weak == 0)).collect();
    match motors[..] {
        [k] => Some(vec![Cause::Stands(k), of_one(k)]),
        // Two motors of one sense whose lines fall together may swing against each other.
        [one, other]
            if !is_near(own.rpm, motion.length_s) && turned[1 - weak] > LEAST_SIDE * (turned[0] + turned[1]) =>
        {
            Some(vec![of_one(one), of_one(other)])
        }
        _ => None,
    }
}

/// The angles whose swing has another size than expected.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scaled {
    /// The yaw, relative to the tilts.
    Yaw,
    /// The pitch, relative to yaw and roll.
    Pitch,
    /// The roll, relative to yaw and pitch.
    Roll,
    /// All three.
    All,
}

/// Returns the angle whose swing, relative to the other angles, has another size in a second motion of one robot, and the ratio, or
/// else the ratio of the swing of all angles; `None` if noise or a beat of both motors hides it.
pub fn scaled(one: &Labelled, other: &Labelled) -> Option<(Scaled, f64)> {
    use Scaled::{All, Pitch, Roll, Yaw};
    let swing = |trial: &Labelled| {
        let motion = Motion::of(trial.angles_deg, trial.settled_s.clone())?;
        let has_mean = !is_near(trial.rpm.map(f64::abs), motion.length_s / BEATS);
        has_mean.then(|| Fitter::new(&motion).axes_dps())
    };
    let (one, other) = (swing(one)?, swing(other)?);
    let [roll, pitch, yaw] = [0, 1, 2].map(|k| (ln(other[k].0 / one[k].0), other[k].1));
    let of = |angle: Scaled, own: (f64, bool), [a, b]: [(f64, bool); 2]| {
        let by = own.0 - (a.0 + b.0) / 2.0;
        // An angle whose swing noise hides may only have less.
        let is_clear = a.1 && b.1 && (own.1 || by < 0.0);
        (is_clear && by.abs() > ln(SCALED) && (a.0 - b.0).abs() < by.abs() / 2.0).then(|| (angle, exp(by)))
    };
    let of_all = (yaw.0 + pitch.0 + roll.0) / 3.0;
    let all = ([yaw, pitch, roll].iter().all(|of| of.1) && of_all.abs() > ln(SCALED)).then(|| (All, exp(of_all)));
    let found = [of(Yaw, yaw, [pitch, roll]), of(Pitch, pitch, [yaw, roll]), of(Roll, roll, [yaw, pitch]), all];
    found.into_iter().flatten().next()
}
