//! Two motions of one robot: by how much one is turned, leans or swings beside the other.

use super::causes::SLOWEST_RPM;
use super::fit::{Complex, angle_deg, size};
use super::lines::Fitter;
use super::motion::Motion;
use super::{Doubts, Labelled, Readings, is_near};
use sim::functions::{exp, ln};

/// Least mean tilt whose direction is judged, degrees: phases of the flagella tilt a robot by two.
const LEAN_DEG: f64 = 3.0;

/// Number of beats of both motors that a mean swing needs.
const BEATS: f64 = 2.0;

/// A swing that is larger or smaller than another by this factor has another scale.
const SCALED: f64 = 1.5;

/// Returns the angle by which the body's x and y axes are turned about its z axis between two motions of one robot, degrees, mostly
/// that of the motor that swings it more; `None` if the lines of both motors fall together.
pub fn turned_deg(one: &Labelled, other: &Labelled) -> Option<f64> {
    let phases = |trial: &Labelled| {
        let motion = Motion::of(trial.angles_deg, trial.settled_s.clone())
            .filter(|motion| !Doubts::of(trial, motion).are_alike)?;
        let (_, fit) = Readings { fitter: &Fitter::new(&motion), trial }.at(trial.rpm, 3)?;
        let phase = |k: usize| fit.motor(k).map(|line| line.about_z * line.turns.conj());
        let is_told = |k: &usize| trial.rpm[*k].abs() >= SLOWEST_RPM;
        (0..2).filter(is_told).map(phase).collect::<Option<Vec<Complex>>>()
    };
    let (one, other) = (phases(one)?, phases(other)?);
    let turn: Complex = one.iter().zip(&other).map(|(one, other)| other * one.conj()).sum();
    (turn != Complex::default()).then(|| angle_deg(turn, Complex::from(1.0)))
}

/// Returns the angle by which the mean tilt is turned about the vertical between two motions of one robot, degrees; `None` if one
/// hardly tilts.
pub fn leans_deg(one: &Labelled, other: &Labelled) -> Option<f64> {
    let [one, other] = [one.lean_deg()?, other.lean_deg()?];
    (size(one).min(size(other)) > LEAN_DEG).then(|| angle_deg(other, one))
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
