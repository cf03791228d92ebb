//! Each flagellum swings the base once a turn, so the motion of a robot shows the speed and the sense of each motor.
//!
//! The rates in the plane, wx + i wy, have a spectral line at the frequency of each motor, positive or negative by its sense. The
//! phase of the line about z, relative to the one in the plane, distinguishes the motors. [`SwingSpeeds`] are estimated from the
//! motion alone. [`label`] tests whether the speeds of a label explain it better than the speeds of any usual mistake.

mod balance;
mod beside;
mod blind;
mod causes;
mod fit;
mod labelled;
mod lines;
mod motion;
mod score;
#[cfg(test)]
pub(crate) mod tests;

pub use balance::{Balance, PerRpm};
pub use beside::{Scaled, leans_deg, scaled, turned_deg};
pub use blind::{NO_LINE, SwingSpeeds, speed_alone};
pub use causes::Cause;
pub use labelled::Labelled;

use causes::{FASTEST_RPM, SLOWEST_RPM};
use fit::{Fit, size};
use lines::{FASTEST_HZ, Fitter};
pub use motion::PIECE_S;
use motion::{Motion, TOO_FEW};
pub use score::in_plane_dps;
use score::{least_dps, score};
use sim::functions::hypot;

/// A cause is named if its score exceeds the label's by more than this.
const MARGIN: f64 = 10.0;

/// The margin if both motors are equally fast; and, if the flagella touch, of a cause about one motor, one that a sum or difference
/// of both speeds can imitate, or one that leaves much of the motion unexplained.
const MARGIN_WHERE_HARD: f64 = 25.0;

/// Difference of both motors' turns below which a cause has to leave little of the motion unexplained: motors whose lines nearly
/// fall together may swing against each other, and leave other lines.
const CLOSE_TURNS: f64 = 3.0;

/// No cause about one motor alone is named if its labelled speed is lower, rpm: its line may be lost where the speed wanders.
const SLOWEST_ALONE_RPM: f64 = 12.0;

/// Share of the least swing below which pitch and roll, or the yaw alone, do not swing. Radians read as degrees have a sixth of
/// the least swing.
const ONE_SWING: f64 = 0.5;

/// Share of the noise of a motion that is certain: a variance from 600 readings is known to a quarter.
const CERTAIN: f64 = 0.75;

/// Relative 95 % uncertainty of the mean speed of a motor without encoder, because the speed wanders.
pub const WANDER: f64 = 0.005;

/// Number of strongest lines that are searched for a shaking.
const SHAKING: usize = 5;

/// Number of causes that are fitted exactly.
const REFINED: usize = 6;

/// Largest share of a motion that its speeds may leave unexplained.
const MOST_LEFT: f64 = 0.35;

/// A label that leaves a larger share unexplained is wrong, whatever the cause.
const LOST: f64 = 0.75;

/// Relative error of a label above which even a right one may leave most of the motion of flagella that touch.
const ROUGH: f64 = 0.1;

/// Largest share that a clear fit leaves unexplained. Nearly equal speeds need a clear fit.
const NEAR_LEFT: f64 = 0.15;

/// Causes whose scores differ by less than this are named together.
const ALIKE: f64 = 8.0;

/// Score of a label that is faster than any motor: another cause must then score above the margin by itself.
const TOO_FAST: f64 = 0.0;

/// Ratio of a motor's swing at the end of a motion to that in all of it, below which it has stopped or turns otherwise.
const STOPPED: f64 = 0.4;

/// Noise of the angles, averaged over a tenth of a second, above which causes about one motor are not judged, degrees.
const NOISY_DEG: f64 = 0.3;

/// The angles that lack a swing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Swing {
    /// In all angles, up to the end of the run.
    Whole,
    /// In pitch and roll alone.
    Tilt,
    /// In the yaw alone.
    Yaw,
}

/// The verdict on a label by its motion.
#[derive(Clone, Debug, PartialEq)]
pub enum Label {
    /// No cause explains the motion clearly better.
    Right,
    /// One of these causes explains it better. The best one comes first; the others cannot be distinguished from it.
    Wrong(Vec<Cause>),
    /// The robot swings far less than one whose motors turn.
    HardlySwings(Swing),
    /// The motion cannot be judged, for this reason.
    NotJudged(&'static str),
}

/// Reasons why the two motors of a label may be indistinguishable.
struct Doubts {
    /// Length of the motion, s.
    length_s: f64,
    /// The lines of both motors fall together, or would if both had the same sense, or ...
    are_alike: bool,
    /// ... nearly so.
    are_close: bool,
    is_noisy: bool,
}

impl Doubts {
    fn of(trial: &Labelled, motion: &Motion) -> Self {
        let sizes = trial.rpm.map(f64::abs);
        Self {
            length_s: motion.length_s,
            are_alike: is_near(sizes, motion.length_s),
            are_close: is_near(sizes, motion.length_s / CLOSE_TURNS),
            is_noisy: motion.angle_variance > NOISY_DEG * NOISY_DEG,
        }
    }
}

/// Returns whether the lines of two speeds fall together.
fn is_near(rpm: [f64; 2], length_s: f64) -> bool {
    (rpm[0] - rpm[1]).abs() / 60.0 * length_s < 1.0
}

/// Judges a label by its motion.
pub fn label(trial: &Labelled) -> Label {
    let Some(motion) = Motion::of(trial.angles_deg, trial.settled_s.clone()) else {
        return Label::NotJudged(TOO_FEW);
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
    let (score, own) = match readings.at(trial.rpm, 3) {
        Some((score, fit)) => (score, Some(fit)),
        None if fastest_rpm > FASTEST_RPM => (TOO_FAST, None),
        None => return Label::NotJudged("the label's lines fall together"),
    };
    let is_lost = own.as_ref().is_some_and(|fit| fit.left.iter().all(|left| *left > LOST));
    if doubts.is_noisy && (SLOWEST_RPM / 2.0..SLOWEST_RPM * 1.5).contains(&fastest_rpm) {
        return Label::NotJudged("noise hides the swing of slow motors");
    }
    let better = readings.better_than(score, &doubts);
    let by_balance = readings.by_balance(score);
    let is_own = |rpm: f64| found.first().is_some_and(|f| is_near([60.0 * f, rpm.abs()], doubts.length_s));
    match better[..] {
        [] if fastest_rpm < SLOWEST_RPM => Label::NotJudged("both motors are slow"),
        _ if !by_balance.is_empty() => {
            let is_new = |cause: &Cause| !better.iter().any(|(_, other, _)| other == cause);
            Label::Wrong(said(&better).into_iter().chain(by_balance.into_iter().filter(is_new)).collect())
        }
        [] if let Some(causes) = own.and_then(|own| otherwise_at_the_end(trial, &own, &found, &doubts)) => {
            Label::Wrong(causes)
        }
        [] if !is_lost || doubts.is_noisy || trial.is_told() || trial.rpm.into_iter().all(is_own) => Label::Right,
        [] if trial.touches && trial.off.0 > ROUGH => Label::NotJudged(blind::TOUCH),
        [] => Label::Wrong(vec![Cause::Unknown { line_rpm: 60.0 * found[0] }]),
        _ => Label::Wrong(said(&better)),
    }
}

/// Returns the causes if a motor hardly swings the end of a motion, of which the steady angles are, though it swings the whole.
fn otherwise_at_the_end(trial: &Labelled, own: &Fit, found: &[f64], doubts: &Doubts) -> Option<Vec<Cause>> {
    let end_s = trial.settled_s.end;
    let end = Labelled { settled_s: end_s - blind::PART_S..end_s, told_rpm: None, ..trial.clone() };
    if trial.touches || doubts.is_noisy || trial.may_be_alike() || doubts.length_s < 1.5 * blind::PART_S {
        return None;
    }
    let motion = Motion::of(end.angles_deg, end.settled_s.clone())?;
    let (_, fit) = Readings { fitter: &Fitter::new(&motion).without_shaking(found), trial: &end }.at(end.rpm, 3)?;
    let has_stopped = |k: &usize| {
        let swing = |fit: &Fit| fit.motor(*k).map(|line| size(line.turns));
        let pair = swing(&fit).zip(swing(own)).filter(|_| trial.rpm[*k].abs() >= SLOWEST_RPM);
        pair.is_some_and(|(at_the_end, in_all)| at_the_end < STOPPED * in_all)
    };
    let motor = (0..2).find(has_stopped)?;
    Some(match label(&end) {
        Label::Wrong(causes) => causes,
        _ => vec![Cause::Stands(motor)],
    })
}

/// Returns the verdict if a motion lacks a swing, in all angles at the end of the run or in some of them.
fn missing_swing(trial: &Labelled, fitter: &Fitter, doubts: &Doubts) -> Option<Label> {
    let least = least_dps(trial.fastest_rpm().min(FASTEST_RPM));
    let hardly_swings = |swing: [f64; 2], share: f64| [0, 1].map(|k| swing[k] < share * least[k]);
    let end_s = trial.settled_s.end;
    let at_the_end = Motion::of(trial.angles_deg, (end_s - blind::PART_S).max(trial.settled_s.start)..end_s);
    let at_the_end =
        at_the_end.map_or(fitter.largest_swing_dps(1.0), |motion| Fitter::new(&motion).largest_swing_dps(1.0));
    match hardly_swings(at_the_end, 1.0) {
        [_, true] if trial.has_yaw_alone && !trial.may_be_alike() => return Some(Label::HardlySwings(Swing::Yaw)),
        _ if trial.has_yaw_alone => return Some(Label::NotJudged("not all angles are measured")),
        [true, true] => return Some(Label::HardlySwings(Swing::Whole)),
        _ => {}
    }
    // The swings of equally fast motors may cancel in the plane, or about z.
    match hardly_swings(fitter.largest_swing_dps(CERTAIN), ONE_SWING) {
        _ if trial.may_be_alike() || doubts.are_alike || doubts.is_noisy => None,
        [true, _] => Some(Label::HardlySwings(Swing::Tilt)),
        [_, true] => Some(Label::HardlySwings(Swing::Yaw)),
        _ => None,
    }
}

/// A cause that explains a motion better than its label: the lead of its score, the cause, and its speeds.
type Better = (f64, Cause, [f64; 2]);

/// Returns the causes to name, from causes sorted by their leads.
fn said(better: &[Better]) -> Vec<Cause> {
    let best: Vec<&Better> = better.iter().take_while(|other| other.0 > better[0].0 - ALIKE).collect();
    let is_other = |cause: Cause| matches!(cause, Cause::Other(_));
    // A usual mistake is more informative than its speeds.
    let is_usual = |rpm: [f64; 2]| {
        let is_same = |usual: [f64; 2]| (0..2).all(|k| (usual[k] - rpm[k]).abs() < 0.03 * rpm[k].abs() + 0.5);
        best.iter().any(|(_, cause, usual)| !is_other(*cause) && is_same(*usual))
    };
    best.iter().filter(|(_, cause, rpm)| !is_other(*cause) || !is_usual(*rpm)).map(|(_, cause, _)| *cause).collect()
}

impl SwingSpeeds {
    /// Returns the speeds of a trial near those of its label, if the motion shows them.
    pub(crate) fn near(trial: &Labelled) -> Option<Self> {
        blind::speeds(trial.angles_deg, trial.settled_s.clone(), Some(trial)).ok()
    }

    /// Returns the speeds with a further relative error of both, 95 %.
    pub(crate) fn with_error(mut self, share: f64) -> Self {
        let widened = |rpm: Option<f64>, u: Option<f64>| Some(hypot(u?, share * rpm?));
        self.measured_w1_uncertainty_rpm = widened(self.measured_w1_rpm, self.measured_w1_uncertainty_rpm);
        self.measured_w2_uncertainty_rpm = widened(self.measured_w2_rpm, self.measured_w2_uncertainty_rpm);
        self
    }
}

/// Returns a cause with the factor as measured.
fn with_factor(cause: Cause, rpm: [f64; 2], fit: &Fit) -> Cause {
    let Cause::Factor { motors, .. } = cause else { return cause };
    // The faster motor gives the more exact factor.
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
        let is_blurred =
            doubts.is_noisy || doubts.are_alike || is_vague || trial.may_be_alike() && doubts.length_s < 30.0;
        let is_slow = |rpm: [f64; 2]| (0..2).any(|k| !trial.is_near(rpm, k) && trial.rpm[k].abs() < SLOWEST_ALONE_RPM);
        // All causes are fitted roughly, the best ones exactly.
        let told = trial.told_rpm.map(|rpm| (Cause::Other(rpm), rpm));
        let causes = causes::causes(trial.rpm).into_iter().chain(told).filter(|&(cause, rpm)| {
            let is_alike = match cause {
                Cause::Swapped | Cause::Reversed => doubts.are_alike || is_vague,
                Cause::Other(_) => doubts.are_alike,
                Cause::Sign(_) => is_vague,
                _ => false,
            };
            // Flagella that touch make lines of sums and differences.
            let is_factor = matches!(cause, Cause::Factor { .. });
            let is_mixed = || trial.touches && is_factor && trial.mixes(rpm, doubts.length_s);
            !(is_alike || cause.is_of_one() && (is_blurred || is_slow(rpm) || is_mixed()) || trial.hides(rpm))
        });
        let mut rough: Vec<_> = causes.filter_map(|(cause, rpm)| Some((self.at(rpm, 0)?.0, cause, rpm))).collect();
        rough.sort_by(|a, b| b.0.total_cmp(&a.0));
        rough.truncate(REFINED);
        let exact = rough.into_iter().filter_map(|(_, cause, rpm)| self.exactly(cause, rpm, label, doubts));
        let mut exact: Vec<Better> = exact.collect();
        exact.sort_by(|a, b| b.0.total_cmp(&a.0));
        exact
    }

    /// Returns the senses, or the motor that stands, that explain a steady attitude which contradicts the label, and that the motion
    /// does not contradict.
    fn by_balance(&self, label: f64) -> Vec<Cause> {
        let trial = self.trial;
        let is_likely = |balance: &Balance| !trial.is_told() && balance.contradicts(trial.rpm);
        let Some(balance) = trial.balance.filter(is_likely) else { return Vec::new() };
        let is_likely = |(cause, rpm): &(Cause, [f64; 2])| {
            matches!(cause, Cause::Sign(_) | Cause::Stands(_))
                && !balance.contradicts(*rpm)
                && self.at(*rpm, 3).is_some_and(|(score, _)| score > label - MARGIN)
        };
        causes::causes(trial.rpm).into_iter().filter(is_likely).map(|(cause, _)| cause).collect()
    }

    /// Returns a cause if it explains the motion better than the label by its margin.
    fn exactly(&self, cause: Cause, rpm: [f64; 2], label: f64, doubts: &Doubts) -> Option<Better> {
        let (trial, is_of_one) = (self.trial, cause.is_of_one());
        let (score, fit) = self.at(rpm, 3)?;
        let is_clear = fit.left.iter().all(|left| *left < NEAR_LEFT);
        let is_explained = (is_clear || !doubts.are_close && fit.left.iter().all(|left| *left < MOST_LEFT))
            && !(is_of_one && fit.hides_one());
        let is_hard_where_they_touch = is_of_one || cause.is_mixed() || cause == Cause::Reversed || !is_clear;
        let is_hard = doubts.are_alike || trial.touches && is_hard_where_they_touch;
        let by = score - label - if is_hard { MARGIN_WHERE_HARD - MARGIN } else { 0.0 };
        let cause = with_factor(cause, trial.rpm, &fit);
        (is_explained && by > MARGIN && !trial.allows(cause)).then_some((by, cause, rpm))
    }

    /// Returns the best score of speeds near these, and its fit.
    fn at(&self, rpm: [f64; 2], steps: usize) -> Option<(f64, Fit)> {
        let length_s = self.fitter.motion.length_s;
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
