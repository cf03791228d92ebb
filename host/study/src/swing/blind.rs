//! Estimates the speeds of the motors from the motion alone.

use super::causes::SLOWEST_RPM;
use super::fit::{Fit, size};
use super::lines::{FASTEST_HZ, Fitter};
use super::motion::{Motion, TOO_FEW};
use super::score::{agreement, beside_the_other, in_plane_dps, least_dps, score};
use super::{Labelled, MARGIN, MOST_LEFT, SHAKING};
use crate::attitude::Columns;
use crate::statistics::{Line, student_95};
use crate::text::decimal;
use serde::Serialize;
use sim::functions::hypot;
use std::f64::consts::TAU;
use std::fmt;
use std::ops::Range;

/// Length of the part that identifies the lines, s.
pub(super) const PART_S: f64 = 20.0;

/// Number of iterations that follow wandering speeds.
const FOLLOWED: usize = 2;

/// Factor by which the part grows towards the whole motion.
const GROWTH: f64 = 1.25;

/// Maximum number of steps of a fit.
const STEPS: usize = 4;

/// Reason for unknown speeds if nothing turns.
pub const NO_LINE: &str = "no line of a motor is seen";
const ONE_OR_NEAR: &str = "one motor turns, or both at nearly one speed";
pub(super) const TOUCH: &str = "the flagella touch, or the motion does not repeat";

/// Number of strongest lines that may be a motor's.
const LINES: usize = 8;

/// Number of readings that are fitted exactly.
const REFINED: usize = 6;

/// Highest frequency searched for a motor that turns alone, Hz: a motor without load at full duty.
const FASTEST_ALONE_HZ: f64 = 2.7;

/// Largest change of the frequencies in an exact fit, and the distance below which two readings are the same, in turns over the
/// whole time.
const REACH_TURNS: f64 = 0.8;
const SAME_TURNS: f64 = 0.5;

/// Least score of two motors, and its least lead over readings with other speeds or with the motors swapped.
const LEAST_SCORE: f64 = 10.0;
const LEAST_LEAD: f64 = 2.0;

/// Labelled speeds closer than this, in turns over the whole time, are those of two motors only if one line leaves at least this
/// share of the motion unexplained, and two lines leave this many times less.
const NEAR_TURNS: f64 = 3.0;
const LEAST_LEFT_OF_ONE: f64 = 0.08;
const BETTER_THAN_ONE: f64 = 4.0;

/// Largest share of a motion that opposite equal speeds may leave unexplained. They have one line, as has one motor with a bent
/// flagellum.
const MOST_LEFT_OPPOSITE: f64 = 0.015;

/// Largest difference of a speed from its mean in a part of the motion, relative to it: the phase of a line jumps where its motor
/// stops.
const UNSTEADY: f64 = 0.12;

/// The same for noise of the angles, which moves the phases: for each degree of it in a swing of 1 °/s.
const NOISY: f64 = 0.5;

/// Least swing in the plane of a motor, relative to the usual one; and the same at opposite equal speeds.
const LEAST_LINE: f64 = 0.2;
const LEAST_OPPOSITE: f64 = 0.33;

/// Largest swing in the plane at opposite equal speeds, relative to the usual one: beside a flagellum that stands, a fast one that
/// wraps bends far, and also swings the base as if the other turned.
const MOST_OPPOSITE: f64 = 1.9;

/// Ratio of a motor's usual swing to the other motor's, below which its sense is not estimated.
const HIDDEN: f64 = 0.06;

/// Ratios of the speeds of two flagella that touch at which one of them may be no motor's.
const DOUBTFUL: [[f64; 2]; 6] = [[4.0, 3.0], [3.0, 2.0], [5.0, 3.0], [5.0, 2.0], [3.0, 1.0], [4.0, 1.0]];

/// Largest opposite component of a motor's line, relative to the component that turns with the motor.
const FLATTEST: f64 = 0.75;

/// Lowest speed that is estimated, rpm: a little below the limit of a label, which a motor may just miss.
const LEAST_RPM: f64 = 0.95 * SLOWEST_RPM;

/// Least `agreement` of the phases about z with their motors, of at most 2.
const LEAST_AGREEMENT: f64 = 1.4;

/// Factor by which the scatter of the phases understates the error, because neighbouring windows share errors.
const INFLATION: f64 = 1.9;

/// Pull of the residual motion on a line's phase, as a multiple of the ratio of their sizes, 95 %.
const PULL: f64 = 1.5;

/// Least uncertainty times the length of the motion, rpm s: from the error of the phase at both ends.
const FLOOR_RPM_S: f64 = 2.0;

/// Largest uncertainty of a motor's speed, rpm. A line with a larger one does not hold its phase, so it is not a motor's.
const MOST_RPM: f64 = 0.4;

/// Speeds of both motors, measured by the swing of the robot.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct SwingSpeeds {
    /// Speed of motor 1; `None` if it is unknown.
    pub measured_w1_rpm: Option<f64>,
    /// Its 95 % uncertainty.
    pub measured_w1_uncertainty_rpm: Option<f64>,
    /// Speed of motor 2.
    pub measured_w2_rpm: Option<f64>,
    /// Its 95 % uncertainty.
    pub measured_w2_uncertainty_rpm: Option<f64>,
    /// Why the speeds are unknown; `None` if they are known.
    pub not_measured: Option<&'static str>,
    /// Both speeds over the time in which they were measured, rpm; empty if they are unknown.
    #[serde(skip)]
    pub over_time: Columns<2>,
}

impl SwingSpeeds {
    /// Returns unknown speeds with a reason.
    pub fn unknown(why: &'static str) -> Self {
        Self { not_measured: Some(why), ..Self::default() }
    }

    /// Returns the speeds, if both are known.
    pub fn rpm(&self) -> Option<[f64; 2]> {
        self.measured_w1_rpm.zip(self.measured_w2_rpm).map(<[f64; 2]>::from)
    }

    /// Measures the speeds in a part of a run. If there is no such part, they are unknown, for the given reason.
    pub fn of(angles_deg: &Columns<3>, part_s: Result<Range<f64>, &'static str>) -> Self {
        part_s.and_then(|part_s| speeds(angles_deg, part_s, None)).unwrap_or_else(Self::unknown)
    }
}

impl fmt::Display for SwingSpeeds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = |rpm: Option<f64>, u: Option<f64>| Some(format!("{} ± {}", decimal(rpm?, 2), decimal(u?, 2)));
        let one = of(self.measured_w1_rpm, self.measured_w1_uncertainty_rpm);
        match one.zip(of(self.measured_w2_rpm, self.measured_w2_uncertainty_rpm)) {
            Some((one, two)) => write!(f, "{one} and {two} rpm"),
            None => write!(f, "cannot be told: {}", self.not_measured.unwrap_or_default()),
        }
    }
}

/// Returns the speed (rpm) of a motor that turns alone, with its 95 % uncertainty. Its sign is the likelier one: a flagellum that
/// touches the standing one makes the base swing to and fro.
///
/// # Errors
/// The reason why it is unknown.
pub fn speed_alone(angles_deg: &Columns<3>, part_s: Range<f64>) -> Result<(f64, f64), &'static str> {
    let motion = Motion::of(angles_deg, part_s).ok_or(TOO_FEW)?;
    let fitter = Fitter::new(&motion);
    let found = fitter.strongest(SHAKING, FASTEST_ALONE_HZ);
    let fitter = fitter.without_shaking(&found);
    let seen = fitter.strongest(1, FASTEST_ALONE_HZ).first().copied().ok_or(NO_LINE)?;
    let reach = [1.0 / motion.length_s, 0.0];
    let (fitter, mut fit) = followed(fitter, [seen, 0.0], reach).ok_or(TOUCH)?;
    let line = *fit.motor(0).ok_or(NO_LINE)?;
    if size(line.opposite) > size(line.turns) {
        fit = fit.read([-1.0, 1.0], false);
    }
    let rpm = fit.hz[0] * fitter.rates()[0] * 60.0;
    if size(line.turns).max(size(line.opposite)) < LEAST_LINE * in_plane_dps(rpm.abs()) {
        return Err(NO_LINE);
    }
    if fit.left[0] > MOST_LEFT {
        return Err("the motion is no swing of one motor");
    }
    Ok((rpm, uncertainty_rpm(&fitter, &fit, motion.length_s)[0]))
}

/// A reading of a motion: its score and its fit.
struct Reading {
    score: f64,
    fit: Fit,
}

/// Returns the speeds of both motors, optionally only if they are `near` those of a label.
///
/// # Errors
/// The reason why they are unknown.
pub(super) fn speeds(
    angles_deg: &Columns<3>,
    settled_s: Range<f64>,
    near: Option<&Labelled>,
) -> Result<SwingSpeeds, &'static str> {
    let motion = Motion::of(angles_deg, settled_s.clone()).ok_or(TOO_FEW)?;
    if motion.stops().is_some() {
        return Err("the motors stop before the end of the run");
    }
    // A short part identifies the lines, because wandering speeds do not blur it. It then grows, so that no turn is lost.
    let lengths_s = std::iter::successors(Some(PART_S), |s| (*s < motion.length_s).then_some(s * GROWTH));
    let part = |s: f64| Motion::of(angles_deg, settled_s.start.max(settled_s.end - s)..settled_s.end);
    // Where readings are missing, a part may have another interval.
    let parts: Vec<Motion> = lengths_s.filter_map(part).filter(|part| part.interval_s == motion.interval_s).collect();
    // Noise, or speeds that are nearly one, may need a longer part, whose lines must go on to the end.
    let mut all = (0..parts.len()).map(|i| told(&parts[i], near).map(|told| (i, told)));
    let first = all.next().unwrap_or(Err(TOO_FEW));
    let goes_on = |(_, (fit, found)): &(usize, (Fit, Vec<f64>))| goes_on(&parts[0], fit, found);
    let (i, (of_part, found)) = first.or_else(|reason| all.flatten().next().filter(goes_on).ok_or(reason))?;
    let (part, longer) = (&parts[i], &parts[i + 1..]);
    let grown = |hz: [f64; 2]| {
        let reach = hz.map(|f| if f == 0.0 { 0.0 } else { 1.0 / part.length_s });
        let first = followed(Fitter::new(part).without_shaking(&found), hz, reach)?;
        longer.iter().try_fold(first, |(fitter, fit), part| followed(fitter.longer(part, &found), fit.hz, reach))
    };
    let (fitter, fit) = grown(of_part.hz).ok_or(TOUCH)?;
    let (rates, swing_dps) = (fitter.rates(), fitter.swing_dps());
    let pull = [0, 1].map(|k| pull_turns(&fit, k, swing_dps) * 60.0 / motion.length_s);
    let scatter = uncertainty_rpm(&fitter, &fit, motion.length_s);
    let uncertainty = [0, 1].map(|k| hypot(scatter[k], pull[k]));
    // Flagella that touch pull a line for long.
    let both_wrap = fit.hz.iter().all(|f| *f < 0.0);
    if fit.leaves_much() || if both_wrap { uncertainty } else { scatter }.iter().any(|rpm| *rpm > MOST_RPM) {
        return Err(TOUCH);
    }
    let [one, other] = [0, 1].map(|k| (fit.hz[k] * rates[k]).abs() * motion.length_s);
    if near.is_some() && one.min(other) > 0.0 && (one - other).abs() < NEAR_TURNS {
        // The line of a motor whose speed wanders looks like two, and the lines of two that are one pull each other.
        let (_, alone) = grown([fit.hz[0], 0.0]).ok_or(TOUCH)?;
        let [both, alone] = [&fit, &alone].map(|fit| fit.left[0] + fit.left[1]);
        if (one - other).abs() < SAME_TURNS || alone < LEAST_LEFT_OF_ONE || both > alone / BETTER_THAN_ONE {
            return Err(ONE_OR_NEAR);
        }
    }
    let [one, two] = [0, 1].map(|k| (fit.hz[k] * rates[k] * 60.0, uncertainty[k]));
    let over_time = fitter.speeds_rpm(&fit, settled_s.end);
    let is_unsteady = |k: usize| {
        let swing_dps = fit.motor(k).or(fit.motor(1 - k)).map_or(0.0, |line| size(line.turns));
        let most = UNSTEADY + NOISY * motion.angle_variance.sqrt() / swing_dps;
        over_time.values[k].iter().any(|rpm| (rpm / [one, two][k].0 - 1.0).abs() > most)
    };
    if (0..2).any(is_unsteady) {
        return Err("a motor stops, or changes its speed");
    }
    Ok(SwingSpeeds {
        measured_w1_rpm: Some(one.0),
        measured_w1_uncertainty_rpm: Some(one.1),
        measured_w2_rpm: Some(two.0),
        measured_w2_uncertainty_rpm: Some(two.1),
        not_measured: None,
        over_time,
    })
}

/// Returns whether both motors swing a part at least half as much: a motor may have stopped before it.
fn goes_on(part: &Motion, fit: &Fit, found: &[f64]) -> bool {
    let swing = |fit: &Fit, k: usize| match fit.motor(k) {
        Some(line) => size(line.turns),
        // Motors of opposite senses may share a line.
        None => fit.motor(0).map_or(0.0, |line| size(line.opposite)),
    };
    let fitter = Fitter::new(part).without_shaking(found);
    let short = fitter.refined(fit.hz, [0.0; 2], 0).filter(|short| !short.leaves_much());
    short.is_some_and(|short| (0..2).all(|k| 2.0 * swing(&short, k) > swing(fit, k)))
}

/// Returns a fit near two frequencies, on times that follow wandering speeds.
fn followed(mut fitter: Fitter, hz: [f64; 2], reach: [f64; 2]) -> Option<(Fitter, Fit)> {
    let mut fit = fitter.refined(hz, reach, STEPS)?;
    for _ in 0..FOLLOWED {
        fitter = fitter.following(&fit);
        fit = fitter.refined(fit.hz, reach, STEPS)?;
    }
    Some((fitter, fit))
}

/// Returns the reading of a motion, and its strongest lines.
fn told(motion: &Motion, near: Option<&Labelled>) -> Result<(Fit, Vec<f64>), &'static str> {
    let fitter = Fitter::new(motion);
    let (swing, least) = (fitter.swing_dps(), least_dps(SLOWEST_RPM));
    if (0..2).all(|k| swing[k] < least[k]) {
        return Err("the robot hardly swings");
    }
    let strongest = fitter.strongest(SHAKING, FASTEST_HZ);
    let fitter = fitter.without_shaking(&strongest);
    let found = fitter.strongest(LINES, FASTEST_HZ);
    let pairs = (0..found.len()).flat_map(|i| (0..i).map(move |j| [i, j])).map(|pair| pair.map(|i| found[i]));
    let alone = found.iter().flat_map(|f| [[*f, 0.0], [*f, *f], [*f, -f]]);
    let is_likely = |reading: &Reading| near.is_none_or(|label| label.is_of(reading.fit.hz.map(|f| f * 60.0)));
    let rough = pairs.chain(alone).filter_map(|hz| fitter.refined(hz, [0.0; 2], 0));
    let likely = rough.map(|fit| readings(&fit).into_iter().filter(is_likely));
    let mut rough: Vec<Reading> = likely.filter_map(|all| all.max_by(|a, b| a.score.total_cmp(&b.score))).collect();
    rough.sort_by(|a, b| b.score.total_cmp(&a.score));
    rough.truncate(REFINED);
    let turn_hz = 1.0 / motion.length_s;
    let reach = |f: f64| if f == 0.0 { 0.0 } else { REACH_TURNS * turn_hz };
    let exact = rough.iter().filter_map(|Reading { fit, .. }| fitter.refined(fit.hz, fit.hz.map(reach), STEPS));
    let all = exact.flat_map(|fit| readings(&fit)).filter(|one| !has_too_weak(&one.fit));
    let (mut exact, others): (Vec<Reading>, Vec<Reading>) = all.partition(is_likely);
    exact.sort_by(|a, b| b.score.total_cmp(&a.score));
    let Some(Reading { score: first, fit }) = exact.first() else { return Err(NO_LINE) };
    if let Some(reason) = doubt(fit, *first, motion.length_s, near.is_some()) {
        return Err(reason);
    }
    if others.iter().any(|other| other.score > first + MARGIN) {
        return Err("the motion is rather that of other speeds");
    }
    let is_near = |f: f64| fit.hz.iter().any(|own| (own - f).abs() < SAME_TURNS * turn_hz);
    if exact.iter().any(|other| other.score > first - LEAST_LEAD && !other.fit.hz.into_iter().all(is_near)) {
        return Err("two readings of the motion are as likely");
    }
    Ok((fit.clone(), strongest))
}

/// Returns the readings of a fit: the senses and the motors that its lines may have.
fn readings(fit: &Fit) -> Vec<Reading> {
    let senses = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
    // If both motors share one line, its frequencies contain their senses.
    let is_one = fit.motor(1).is_none() && fit.hz[1] != 0.0;
    let all = senses.into_iter().flat_map(|senses| [false, true].map(|swapped| (senses, swapped)));
    let all = all.filter(|([a, b], swapped)| !is_one || a == b && !swapped);
    all.map(|(senses, swapped)| fit.read(senses, swapped)).map(|fit| Reading { score: score(&fit), fit }).collect()
}

/// Returns whether a motor's line is weaker than any motor makes it.
fn has_too_weak(fit: &Fit) -> bool {
    let least = |k: usize| LEAST_LINE * in_plane_dps(fit.hz[k].abs() * 60.0);
    (0..2).any(|k| fit.motor(k).is_some_and(|line| size(line.turns) < least(k)))
}

/// Returns why the best reading of a motion is not accepted; `None` if it is.
fn doubt(fit: &Fit, score: f64, length_s: f64, is_labelled: bool) -> Option<&'static str> {
    let [one, other] = fit.hz.map(|f| f * length_s);
    if fit.leaves_much() || score < LEAST_SCORE {
        return Some(TOUCH);
    }
    if is_labelled {
        return None;
    }
    let is_told = match [fit.motor(0), fit.motor(1)] {
        [Some(a), Some(b)] if (one.abs() - other.abs()).abs() > 1.0 => {
            let rpm = fit.hz.map(|f| f * 60.0);
            let slow = usize::from(rpm[1].abs() < rpm[0].abs());
            // Where both touch, a sum or a difference of both speeds, or a half of one, may look like a motor.
            let is_mixed = |[a, b]: &[f64; 2]| (a * rpm[slow] - b * rpm[1 - slow]).abs() / 60.0 * length_s < 1.0;
            // A fast flagellum that wraps also swings the base as a slow motor does, in either sense.
            let is_hidden = rpm[1 - slow] < 0.0
                && (beside_the_other(rpm, slow) < HIDDEN || fit.hides_one() || DOUBTFUL.iter().any(is_mixed));
            if is_hidden || [a, b].iter().any(|line| size(line.opposite) > FLATTEST * size(line.turns)) {
                return Some("the swing of one motor hides that of the other");
            }
            agreement(fit) > LEAST_AGREEMENT
        }
        [Some(line), None] if (one + other).abs() < 1.0 => {
            let usual = LEAST_OPPOSITE..MOST_OPPOSITE;
            let is_usual = |swing| usual.contains(&(size(swing) / in_plane_dps(fit.hz[0].abs() * 60.0)));
            if fit.left.iter().any(|left| *left > MOST_LEFT_OPPOSITE)
                || ![line.turns, line.opposite].into_iter().all(is_usual)
            {
                return Some(ONE_OR_NEAR);
            }
            score - self::score(&fit.read([-1.0; 2], false)) > LEAST_LEAD
        }
        _ => return Some(ONE_OR_NEAR),
    };
    if !is_told {
        return Some("the swing does not tell which motor is which");
    }
    fit.hz.iter().any(|f| f.abs() * 60.0 < LEAST_RPM).then_some("a motor is slower than 10 rpm")
}

/// Returns the uncertainties of both speeds, from straight lines through the phases of windows.
fn uncertainty_rpm(fitter: &Fitter, fit: &Fit, length_s: f64) -> [f64; 2] {
    let windows = if length_s < 30.0 { 5 } else { 6 };
    let Some(ahead_s) = fitter.ahead(fit, windows) else { return [f64::INFINITY; 2] };
    let count = windows as f64;
    let at = |i: usize| (i as f64 - (count - 1.0) / 2.0) * length_s / count;
    [0, 1].map(|motor| {
        let line = Line::through((0..windows).map(|i| (at(i), ahead_s[i][motor])));
        let share = student_95(count - 2.0) * (line.squares / (count - 2.0) / line.spread).sqrt();
        hypot(INFLATION * share * fit.hz[motor].abs() * 60.0, FLOOR_RPM_S / length_s)
    })
}

/// Returns how far the residual motion may pull the phase of a motor's line, turns, 95 %.
fn pull_turns(fit: &Fit, motor: usize, swing_dps: [f64; 2]) -> f64 {
    let Some(line) = fit.motor(motor).or(fit.motor(1 - motor)).filter(|_| fit.hz[motor] != 0.0) else { return 0.0 };
    let in_plane = (line.turns.norm_sqr() + line.opposite.norm_sqr()) / (swing_dps[0] * swing_dps[0]);
    let share = in_plane + line.about_z.norm_sqr() / (2.0 * swing_dps[1] * swing_dps[1]);
    PULL * ((fit.left[0] + fit.left[1]) / share).sqrt() / TAU
}
