//! Each flagellum swings the base once a turn: the motion of a robot says how fast which motor turned, and in which sense.
//!
//! Of wx + i wy, the rates in the plane, a motor has a line at its own frequency, on the side of its sense. The line about z,
//! against the one in the plane, tells one motor from the other. [`SwingSpeeds`] are what the motion says alone. [`label`] asks
//! whether the speeds of a label explain it better than those of any usual mistake would.

mod blind;
mod causes;
mod lines;
mod motion;
mod score;
#[cfg(test)]
pub(crate) mod tests;

pub use blind::{NO_LINE, SwingSpeeds, speed_alone};
pub use causes::Cause;

use crate::attitude::{Columns, wrapped};
use causes::{FASTEST_RPM, SLOWEST_RPM};
use lines::{FASTEST_HZ, Fit, Fitter};
use motion::Motion;
pub use motion::PIECE_S;
pub use score::in_plane_dps;
use score::{beside_the_other, least_dps, off_deg, score};
use sim::functions::{exp, hypot, ln};
use std::ops::Range;

/// A cause is named where its score is better than the label's by this.
const MARGIN: f64 = 10.0;

/// The same of a cause about one motor where both are equally fast; and, where the flagella touch, of one about one motor, of one
/// that a sum or a difference of both speeds can look like, or of one that leaves much of the motion.
const MARGIN_WHERE_HARD: f64 = 25.0;

/// Share of the least swing below which pitch and roll, or the yaw, have none beside the other: radians have a sixth of it.
const ONE_SWING: f64 = 0.5;

/// Usual swing of a motor by that of the other one, below which nothing is said of it alone.
const HIDDEN: f64 = 0.075;

/// Share by which its mean may be off because it wanders, 95 %.
const WANDER: f64 = 0.005;

/// A label that may be off by a larger share is none of a board's encoders.
const WELL_KNOWN: f64 = 0.02;

/// Lines among which a shaking is looked for.
const SHAKING: usize = 5;

/// Causes that are fitted exactly.
const REFINED: usize = 6;

/// The largest share of a motion that its speeds may leave.
const MOST_LEFT: f64 = 0.35;

/// A label that leaves more is wrong, whatever the cause.
const LOST: f64 = 0.75;

/// The largest share that two speeds leave which are nearly one.
const NEAR_LEFT: f64 = 0.15;

/// Turns of a frame by two motors that are nearer than this agree, degrees.
const AGREED_DEG: f64 = 30.0;

/// Beats of both motors over which a swing has a mean.
const BEATS: f64 = 2.0;

/// A side whose power, over that of the other side, is less than the model's by this factor has lost a motor.
const SIDED: f64 = 8.0;

/// The least share of a side to which a motor turns.
const LEAST_SIDE: f64 = 0.25;

/// A swing that is larger or smaller than another by this factor has another scale.
const SCALED: f64 = 1.5;

/// Causes whose scores are nearer than this are named together.
const ALIKE: f64 = 8.0;

/// The score of a label beyond what motors do: another reading must look like two motors by itself.
const TOO_FAST: f64 = 0.0;

/// Beyond this noise of the angles, averaged over a tenth of a second, a motor alone is not judged.
const NOISY_DEG: f64 = 0.3;

/// A trial whose label is asked about.
#[derive(Clone, Debug)]
pub struct Labelled<'a> {
    /// Yaw, pitch and roll.
    pub angles_deg: &'a Columns<3>,
    /// From where the motion has settled to the end of the run, in the times of the angles.
    pub settled_s: Range<f64>,
    /// Speeds of motors 1 and 2 as labelled, rpm.
    pub rpm: [f64; 2],
    /// How far a right label may be off: its share, and rpm beside it.
    pub off: (f64, f64),
    /// Whether flagella that turn at these speeds touch.
    pub touches: bool,
    /// The speeds that the motion tells by itself, rpm.
    pub told_rpm: Option<[f64; 2]>,
    /// Whether pitch and roll were not measured.
    pub has_yaw_alone: bool,
}

impl Labelled<'_> {
    fn fastest_rpm(&self) -> f64 {
        self.rpm[0].abs().max(self.rpm[1].abs())
    }

    /// Returns whether its speeds may be each other's, or opposite to each other's.
    fn may_be_alike(&self) -> bool {
        let apart_rpm = (self.rpm[0].abs() - self.rpm[1].abs()).abs();
        apart_rpm < 3.0 * (self.off.0 * self.fastest_rpm() + self.off.1)
    }

    /// Returns whether no motor can be told by its speed.
    pub fn is_vague(&self) -> bool {
        self.may_be_alike() && self.off.0 > WELL_KNOWN
    }

    /// Returns whether a cause is no more than a right label may be off.
    fn allows(&self, cause: Cause) -> bool {
        match cause {
            Cause::Factor { motors, factor } => {
                let fastest = (0..2).filter(|&k| motors[k]).map(|k| self.rpm[k].abs()).fold(0.0, f64::max);
                (factor - 1.0).abs() < self.off.0 + self.off.1 / fastest
            }
            Cause::Other(rpm) => (0..2).all(|k| self.is_near(rpm, k)),
            _ => false,
        }
    }

    /// Returns whether a motor's speed is no further from the label's than a right label may be off.
    fn is_near(&self, rpm: [f64; 2], k: usize) -> bool {
        (rpm[k] - self.rpm[k]).abs() <= self.off.0 * self.rpm[k].abs() + self.off.1
    }

    /// Returns whether speeds may be those of the label.
    fn is_of(&self, rpm: [f64; 2]) -> bool {
        (0..2).all(|k| self.is_near(rpm, k) && (rpm[k] == 0.0) == (self.rpm[k] == 0.0))
    }

    /// Returns whether speeds differ from the label's in those of one motor alone, whose swing is lost beside that of the other.
    fn hides(&self, rpm: [f64; 2]) -> bool {
        let is_same = |k: usize| self.is_near(rpm, k);
        (0..2).any(|k| {
            !is_same(k) && is_same(1 - k) && [self.rpm, rpm].into_iter().all(|rpm| beside_the_other(rpm, k) < HIDDEN)
        })
    }
}

/// A swing that is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Swing {
    /// In all angles, up to the end of the run.
    Whole,
    /// In pitch and roll alone.
    Tilt,
    /// In the yaw alone.
    Yaw,
}

/// What a motion says of a label.
#[derive(Clone, Debug, PartialEq)]
pub enum Label {
    /// Nothing explains the motion clearly better.
    Right,
    /// One of these causes does.
    /// The best one comes first; nobody could tell the others from it.
    Wrong(Vec<Cause>),
    /// It swings far less than a robot does whose motors turn.
    HardlySwings(Swing),
    /// The motion does not tell.
    NotJudged(&'static str),
}

/// Reasons why two motors of a label may look alike.
struct Doubts {
    /// Length of the motion, s.
    length_s: f64,
    /// The lines of two motors of one sense fall together.
    are_near: bool,
    /// So do those of two motors of any senses.
    are_alike: bool,
    is_noisy: bool,
}

impl Doubts {
    fn of(trial: &Labelled, motion: &Motion) -> Self {
        let near = |rpm: [f64; 2]| is_near(rpm, motion.length_s);
        Self {
            length_s: motion.length_s,
            are_near: near(trial.rpm),
            are_alike: near(trial.rpm.map(f64::abs)),
            is_noisy: motion.angle_variance > NOISY_DEG * NOISY_DEG,
        }
    }
}

/// Returns whether the lines of two speeds fall together.
fn is_near(rpm: [f64; 2], length_s: f64) -> bool {
    (rpm[0] - rpm[1]).abs() / 60.0 * length_s < 1.0
}

/// Returns what a motion says of its label.
pub fn label(trial: &Labelled) -> Label {
    let Some(motion) = Motion::of(trial.angles_deg, trial.settled_s.clone()) else {
        return Label::NotJudged("the run is too short, or has too few readings");
    };
    if let Some(at_s) = motion.stops() {
        let at_s = trial.settled_s.end - motion.length_s + at_s;
        return Label::Wrong(vec![Cause::StopEarly { at_s }]);
    }
    let fitter = Fitter::new(&motion);
    let doubts = Doubts::of(trial, &motion);
    if let Some(missing) = missing_swing(trial, &fitter, &doubts) {
        return missing;
    }
    let found = fitter.strongest(SHAKING, FASTEST_HZ);
    let fitter = fitter.without_shaking(&found);
    let readings = Readings { fitter: &fitter, trial };
    let fastest_rpm = trial.fastest_rpm();
    let (score, is_lost) = match readings.at(trial.rpm, 3) {
        Some((score, fit)) => (score, fit.left.iter().all(|left| *left > LOST)),
        None if fastest_rpm > FASTEST_RPM => (TOO_FAST, false),
        None => return Label::NotJudged("the label's lines fall together"),
    };
    if doubts.is_noisy && (SLOWEST_RPM / 2.0..SLOWEST_RPM * 1.5).contains(&fastest_rpm) {
        return Label::NotJudged("noise hides the swing of slow motors");
    }
    let better = readings.better_than(score, &doubts);
    match better[..] {
        [] if fastest_rpm < SLOWEST_RPM => Label::NotJudged("both motors are slow"),
        [] if is_lost && !doubts.is_noisy && !trial.told_rpm.is_some_and(|rpm| trial.is_of(rpm)) => {
            Label::Wrong(vec![Cause::Unknown { line_rpm: 60.0 * found[0] }])
        }
        [] => Label::Right,
        _ => Label::Wrong(said(&better)),
    }
}

/// Returns what a motion says that lacks a swing, if it does: in all angles at the end of the run, or in some of them.
fn missing_swing(trial: &Labelled, fitter: &Fitter, doubts: &Doubts) -> Option<Label> {
    let least = least_dps(trial.fastest_rpm().min(FASTEST_RPM));
    let hardly_swings = |swing: [f64; 2], share: f64| [0, 1].map(|k| swing[k] < share * least[k]);
    let end_s = trial.settled_s.end;
    let at_the_end = Motion::of(trial.angles_deg, (end_s - blind::PART_S).max(trial.settled_s.start)..end_s);
    let at_the_end = at_the_end.map_or(fitter.swing_dps(), |motion| Fitter::new(&motion).swing_dps());
    match hardly_swings(at_the_end, 1.0) {
        [_, true] if trial.has_yaw_alone && !trial.may_be_alike() => return Some(Label::HardlySwings(Swing::Yaw)),
        _ if trial.has_yaw_alone => return Some(Label::NotJudged("not all angles are measured")),
        [true, true] => return Some(Label::HardlySwings(Swing::Whole)),
        _ => {}
    }
    // The swings of alike motors may cancel in the plane, or about z.
    match hardly_swings(fitter.swing_dps(), ONE_SWING) {
        _ if trial.may_be_alike() || doubts.are_alike || doubts.is_noisy => None,
        [true, _] => Some(Label::HardlySwings(Swing::Tilt)),
        [_, true] => Some(Label::HardlySwings(Swing::Yaw)),
        _ => None,
    }
}

/// A cause that explains a motion better than its label: by how much, and the speeds.
type Better = (f64, Cause, [f64; 2]);

/// Returns which causes are said, of some in the order of how much better they are.
fn said(better: &[Better]) -> Vec<Cause> {
    let best: Vec<&Better> = better.iter().filter(|other| other.0 > better[0].0 - ALIKE).collect();
    let is_other = |cause: Cause| matches!(cause, Cause::Other(_));
    // A usual mistake says more than its speeds.
    let is_usual = |rpm: [f64; 2]| {
        let is_same = |usual: [f64; 2]| (0..2).all(|k| (usual[k] - rpm[k]).abs() < 0.03 * rpm[k].abs() + 0.5);
        best.iter().any(|(_, cause, usual)| !is_other(*cause) && is_same(*usual))
    };
    best.iter().filter(|(_, cause, rpm)| !is_other(*cause) || !is_usual(*rpm)).map(|(_, cause, _)| *cause).collect()
}

impl SwingSpeeds {
    /// Returns the speeds of a trial whose label only nears them, if the motion tells them.
    pub(crate) fn near(trial: &Labelled) -> Option<Self> {
        blind::speeds(trial.angles_deg, trial.settled_s.clone(), Some(trial)).ok().map(Self::told)
    }

    /// Returns the speeds as those of motors without encoders, which wander.
    pub(crate) fn that_wander(mut self) -> Self {
        let widened = |rpm: Option<f64>, u: Option<f64>| Some(hypot(u?, WANDER * rpm?));
        self.measured_w1_uncertainty_rpm = widened(self.measured_w1_rpm, self.measured_w1_uncertainty_rpm);
        self.measured_w2_uncertainty_rpm = widened(self.measured_w2_rpm, self.measured_w2_uncertainty_rpm);
        self
    }
}

/// Returns by which angle the body's x and y are turned about its z between two motions of one robot, degrees; `None` where the
/// motors disagree, or their lines overlap.
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

/// Returns the causes why the swing of a label's nearly equal speeds turns to other sides than that of its robot's model; `None` if
/// it does not, or if the motion does not tell. Motors whose speeds may be each other's have only their senses to be told by.
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
        [one, other] if !doubts.are_near && turned[1 - weak] > LEAST_SIDE * (turned[0] + turned[1]) => {
            Some(vec![of_one(one), of_one(other)])
        }
        _ => None,
    }
}

/// Returns which angle swings how many times as much beside the others as that of another motion of one robot: yaw, pitch or roll
/// (0 to 2); `None` if none does, or if noise or a beat of both motors hides it.
pub fn scaled(one: &Labelled, other: &Labelled) -> Option<(usize, f64)> {
    let swing = |trial: &Labelled| {
        let motion = Motion::of(trial.angles_deg, trial.settled_s.clone())?;
        let has_mean = !is_near(trial.rpm.map(f64::abs), motion.length_s / BEATS);
        Fitter::new(&motion).axes_dps().filter(|_| has_mean)
    };
    let (one, other) = (swing(one)?, swing(other)?);
    let [roll, pitch, yaw] = [0, 1, 2].map(|k| ln(other[k] / one[k]));
    let of = |k: usize, own: f64, [a, b]: [f64; 2]| {
        let by = own - (a + b) / 2.0;
        (by.abs() > ln(SCALED) && (a - b).abs() < by.abs() / 2.0).then(|| (k, exp(by)))
    };
    of(0, yaw, [pitch, roll]).or_else(|| of(1, pitch, [yaw, roll])).or_else(|| of(2, roll, [yaw, pitch]))
}

/// Returns a cause with the factor as measured.
fn with_factor(cause: Cause, rpm: [f64; 2], fit: &Fit) -> Cause {
    let Cause::Factor { motors, .. } = cause else { return cause };
    // The faster motor tells it more exactly.
    let told = (0..2).filter(|&k| motors[k] && rpm[k] != 0.0);
    let fastest = told.max_by(|&a, &b| rpm[a].abs().total_cmp(&rpm[b].abs()));
    fastest.map_or(cause, |k| Cause::Factor { motors, factor: fit.hz[k] * 60.0 / rpm[k] })
}

struct Readings<'a> {
    fitter: &'a Fitter<'a>,
    trial: &'a Labelled<'a>,
}

impl Readings<'_> {
    /// Returns the causes that explain the motion better than the label by a margin, the best one first.
    fn better_than(&self, label: f64, doubts: &Doubts) -> Vec<Better> {
        let trial = self.trial;
        let is_vague = trial.is_vague();
        let is_blurred = doubts.is_noisy || is_vague || trial.may_be_alike() && doubts.length_s < 30.0;
        // All roughly, the best exactly.
        let told = trial.told_rpm.map(|rpm| (Cause::Other(rpm), rpm));
        let causes = causes::causes(trial.rpm).into_iter().chain(told).filter(|&(cause, rpm)| {
            let is_alike = match cause {
                Cause::Swapped | Cause::Reversed => doubts.are_alike || is_vague,
                Cause::Sign(_) => is_vague,
                _ => false,
            };
            !(is_alike || is_blurred && cause.is_of_one() || trial.hides(rpm))
        });
        let mut rough: Vec<_> = causes.filter_map(|(cause, rpm)| Some((self.at(rpm, 0)?.0, cause, rpm))).collect();
        rough.sort_by(|a, b| b.0.total_cmp(&a.0));
        rough.truncate(REFINED);
        let exact = rough.into_iter().filter_map(|(_, cause, rpm)| self.exactly(cause, rpm, label, doubts));
        let mut exact: Vec<Better> = exact.collect();
        exact.sort_by(|a, b| b.0.total_cmp(&a.0));
        exact
    }

    /// Returns a cause if it explains the motion better than the label by its margin.
    fn exactly(&self, cause: Cause, rpm: [f64; 2], label: f64, doubts: &Doubts) -> Option<Better> {
        let (trial, is_of_one) = (self.trial, cause.is_of_one());
        let (score, fit) = self.at(rpm, 3)?;
        // Two motors of one sense whose lines fall together may swing against each other, and leave other lines.
        let may_hide = doubts.are_near && (is_near(rpm, doubts.length_s) || is_of_one);
        if doubts.are_near && is_of_one && trial.touches {
            return None;
        }
        let is_clear = fit.left.iter().all(|left| *left < NEAR_LEFT);
        let is_explained =
            (is_clear || !may_hide && fit.left.iter().all(|left| *left < MOST_LEFT)) && !(is_of_one && fit.hides_one());
        let is_hard = is_of_one && doubts.are_alike || trial.touches && (is_of_one || cause.is_mixed() || !is_clear);
        let by = score - label - if is_hard { MARGIN_WHERE_HARD - MARGIN } else { 0.0 };
        let cause = with_factor(cause, trial.rpm, &fit);
        (is_explained && by > MARGIN && !trial.allows(cause)).then_some((by, cause, rpm))
    }

    /// Returns the best score of speeds near these, and its fit.
    fn at(&self, rpm: [f64; 2], steps: usize) -> Option<(f64, Fit)> {
        let length_s = self.fitter.length_s();
        let reach_hz = rpm.map(|w| (w.abs() * self.trial.off.0 + self.trial.off.1) / 60.0);
        let mut hz = rpm.map(|w| w / 60.0);
        let are_near = (hz[0].abs() - hz[1].abs()).abs() * length_s < 1.5;
        let strongest = if hz[0].abs() > hz[1].abs() { 0 } else { 1 };
        let moved = |k: usize| self.fitter.strongest_near(hz[k], reach_hz[k]);
        if are_near {
            let by = moved(strongest) / hz[strongest];
            hz = hz.map(|f| f * by);
        } else {
            hz = [0, 1].map(|k| if hz[k] == 0.0 { 0.0 } else { moved(k) });
        }
        let left_hz = [0, 1].map(|k| (reach_hz[k] - (hz[k] - rpm[k] / 60.0).abs()).max(0.0));
        let fit = self.fitter.refined(hz, left_hz, steps)?;
        Some((score(&fit), fit))
    }
}
