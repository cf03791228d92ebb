//! Shooting: periods of the ordinary solver, and steps between them in the slow coordinates.

use super::modes::{ASSUMED_S, Map, Modes};
use super::slow::{self, ANGLES, COORDINATES, Slow};
use super::{Problem, SolveError, TOLERANCE, Watch, period, run};
use crate::anderson::Anderson;
use crate::functions::exp;
use crate::params::SolverSettings;
use crate::step::state::State;
use crate::trial::Trial;
use crate::trial::means::Steady;
use crate::trial::profile::{ProfileError, SpeedProfile};
use crate::trial::sample::Sample;
use std::f64::consts::PI;

/// Least simulated time before the first step, s: the motion decays by itself.
const DECAY_S: f64 = 6.0;
/// Longest simulated time of a search, s, or ...
const PATIENCE_S: f64 = 54.0;
/// ... this share of the longest simulation if that is longer.
const PATIENCE: f64 = 0.8;
/// Share of the search after which all periods have the ordinary accuracy.
const COARSE: f64 = 0.8;
/// Bound of a step's error in coarse periods, relative to the ordinary one.
const COARSE_ERROR: f64 = 10.0;
/// Tolerance of a step's iteration in coarse periods, relative to the ordinary one, ...
const COARSE_TOLERANCE: f64 = 5.0;
/// ... and its upper limit: steps fail above it.
const LARGEST_TOLERANCE: f64 = 0.05;
/// Tolerance of a step's iteration in the last periods, relative to the ordinary one: the errors of all steps add up over the
/// time in which a slow mode decays.
const FINE_TOLERANCE: f64 = 0.5;
/// Approximate time between samples of the slow coordinates, s.
const SAMPLE_S: f64 = 0.5;
/// Samples left out at the start of a period: they still contain fast modes after a start from rest or a step.
const SKIPPED: usize = 2;
/// Number of periods that a step is computed from.
const COMBINED: usize = 5;
/// Longest plausible time constant, s: it bounds the steps.
pub const SLOWEST_S: f64 = 60.0;
/// Longest step, rad. If the estimated step is longer, the motion is still too far away for a linear law, and the step might
/// lead to another motion than the trial's.
const LONGEST: f64 = 5.0 * PI / 180.0;
/// Largest difference of the two estimates of a step, relative to the longer one, for a move by the whole step ...
const DIFFERENCE: f64 = 0.7;
/// ... and by half of it.
const LARGEST_DIFFERENCE: f64 = 0.85;
/// A step shorter than this, rad, ends the coarse periods, whose own error is of this size.
pub const CLOSE: f64 = 1.0 * PI / 180.0;
/// A step shorter than this, rad, ends the ordinary periods.
const VERY_CLOSE: f64 = 0.5 * PI / 180.0;

/// How a search ends.
pub enum Outcome {
    /// A repeating motion.
    Found(Box<Found>),
    /// None within the time of a search, or a step failed; the last trial of the search.
    Lost(Box<Trial>),
    /// No search: the motors have no common period.
    None,
}

/// A motion that repeats.
pub struct Found {
    /// Its last period.
    pub trial: Trial,
    /// The means over the period before.
    pub before: Steady,
    /// Remaining distance of the attitude from it, rad.
    pub distance: f64,
    /// Samples of the last period.
    pub samples: Vec<Sample>,
    /// The state before the first step, if the flagella have touched: a step may then have led to another motion than the
    /// trial's.
    pub unmoved: Option<State>,
    /// Settings of coarse periods.
    pub coarse: SolverSettings,
    /// Settings of periods that are as accurate as a trial.
    pub ordinary: SolverSettings,
}

/// Searches for a repeating motion.
///
/// Periods in which the flagella touch have coarse steps, at about half the cost, until the motion is close. Once it is very
/// close, all periods are more accurate than a trial.
///
/// # Errors
/// Impossible parameters or speeds, and [`SolveError::Interrupted`].
pub fn shoot(problem: &Problem, watch: Watch) -> Result<Outcome, SolveError> {
    let Problem { robot, rpm, longest_s, output, .. } = *problem;
    let speeds = rpm.map(|rpm| rpm * PI / 30.0);
    let Some(period) = period::common(speeds) else {
        // Impossible speeds and parameters are errors here, too.
        SpeedProfile::constant(rpm, 1.0)?;
        robot.validate()?;
        return Ok(Outcome::None);
    };
    let intervals = (period / SAMPLE_S).round() as usize;
    let interval = period / intervals as f64;
    let mut trial = Trial::with_solver(problem.solver()?, profile(problem, period, 0.0)?, output.unwrap_or_default())?;
    let [coarse, ordinary, fine] = accuracies(&robot.solver, speeds, interval);
    let mut modes = Modes::new(interval, period);
    let mut paths: Vec<Vec<Slow>> = Vec::new();
    let patience_s = PATIENCE_S.max(PATIENCE * longest_s);
    let (mut is_coarse, mut may_be_coarse, mut is_fine) = (true, true, false);
    let (mut last, mut unmoved, mut has_touched): (Option<Steady>, Option<State>, bool) = (None, None, false);
    loop {
        trial.set_accuracy(match (is_coarse, is_fine) {
            (true, _) => &coarse,
            (false, true) => &fine,
            (false, false) => &ordinary,
        });
        // Coarse periods are never the result.
        let mut output = (output.is_some() && !is_coarse).then(Vec::new);
        let Some(path) = path(&mut trial, intervals, interval, output.as_mut(), watch)? else {
            return Ok(Outcome::Lost(Box::new(trial)));
        };
        let simulated_s = trial.state().time;
        let (from, end) = (path[0], path[intervals]);
        if let Some(before) = paths.last() {
            modes.record(&before[SKIPPED..], &path[SKIPPED..]);
        }
        paths.push(path);
        let mut state = trial.state().clone();
        let summary = trial.window_summary();
        let touches = summary.largest_contact_n > 0.0;
        has_touched |= touches;
        let mut next_is_coarse = may_be_coarse && touches;
        let before = last.replace(summary.steady);
        if simulated_s >= DECAY_S.max(1.5 * period) {
            let [newton, step] = steps(&paths, modes.newton(intervals));
            let distance = attitude(&newton).max(attitude(&step));
            let is_stable = !modes.grow();
            // Also checked with the assumed decay: small differences do not determine the true one well.
            let assumed = attitude(&(end - from)) / (1.0 - exp(-period / ASSUMED_S));
            let is_found = distance < TOLERANCE && assumed < TOLERANCE && is_fine && !is_coarse && paths.len() > 1;
            if is_found
                && is_stable
                && let Some(before) = before
            {
                let (distance, samples) = (distance.max(assumed), output.unwrap_or_default());
                let unmoved = unmoved.filter(|_| has_touched);
                let found = Found { trial, before, distance, samples, unmoved, coarse, ordinary };
                return Ok(Outcome::Found(Box::new(found)));
            }
            if simulated_s + period > patience_s {
                return Ok(Outcome::Lost(Box::new(trial)));
            }
            let is_close = distance < CLOSE;
            is_fine |= distance < VERY_CLOSE;
            let longest = LONGEST.min((end - from).amax() / (1.0 - exp(-period / SLOWEST_S)));
            let difference = attitude(&(newton - step)) / distance;
            let share = trusted(distance, longest, difference, is_coarse && is_close).filter(|_| is_stable);
            if let Some(share) = share {
                unmoved.get_or_insert_with(|| state.clone());
                state = moved(&mut trial, &((from + step - end) * share));
            }
            if next_is_coarse && (is_close || simulated_s > COARSE * patience_s) {
                (next_is_coarse, may_be_coarse) = (false, false);
                // Coarse periods lead to a slightly different state.
                paths.clear();
            }
        }
        is_coarse = next_is_coarse;
        trial = trial.followed_by(profile(problem, period, simulated_s)?, state);
    }
}

/// Returns constant speeds over the period that begins at `time`.
fn profile(problem: &Problem, period: f64, time: f64) -> Result<SpeedProfile, ProfileError> {
    let angles = [0, 1].map(|k| problem.start_rad[k] + problem.rpm[k] * PI / 30.0 * time);
    Ok(SpeedProfile::from_points(&[(time, problem.rpm), (time + period, problem.rpm)])?.from_angles(angles))
}

/// Returns the share of a step to take; `None` for an implausible step. A period then passes without a step: the motion
/// decays by itself, or leaves an unstable state. `is_sure`: whether even an implausible step is taken, as at the end of the
/// coarse periods.
fn trusted(distance: f64, longest: f64, difference: f64, is_sure: bool) -> Option<f64> {
    let is_plausible = distance >= TOLERANCE && distance < longest && difference <= LARGEST_DIFFERENCE;
    (is_plausible || is_sure).then_some(if difference <= DIFFERENCE { 1.0 } else { 0.5 })
}

/// Returns the settings of coarse periods, of ordinary periods, and of periods that may be the result.
fn accuracies(solver: &SolverSettings, speeds: [f64; 2], interval: f64) -> [SolverSettings; 3] {
    let ordinary = with_even_steps(solver, speeds, interval);
    let fine = SolverSettings { tolerance: ordinary.tolerance * FINE_TOLERANCE, ..ordinary.clone() };
    [with_coarse_steps(&ordinary), ordinary, fine]
}

/// Runs a trial to its end. Returns its slow coordinates at the start and at the ends of `count` intervals of `interval`
/// seconds; `None` if a step fails.
fn path(
    trial: &mut Trial,
    count: usize,
    interval: f64,
    mut samples: Option<&mut Vec<Sample>>,
    watch: Watch,
) -> Result<Option<Vec<Slow>>, SolveError> {
    let start = trial.state().time;
    let mut path = vec![slow::coordinates(trial.solver(), trial.state())];
    for sample in 1..=count {
        // The last one ends with the profile: rounding must not leave a sliver of time.
        let until = if sample < count { start + interval * sample as f64 } else { f64::INFINITY };
        if run(trial, until, samples.as_deref_mut(), watch)?.is_err() {
            return Ok(None);
        }
        path.push(slow::coordinates(trial.solver(), trial.state()));
    }
    Ok(Some(path))
}

/// Returns the step from the start of the last period to the repeating motion, estimated from that period alone and from the
/// last [`COMBINED`] periods; not finite where a direction does not decay. `newton`: the map from the change over a period to
/// the step.
fn steps(paths: &[Vec<Slow>], newton: Option<Map>) -> [Slow; 2] {
    let Some(newton) = newton else { return [Slow::repeat(f64::NAN); 2] };
    let ends = |path: &Vec<Slow>| (path[0], path[path.len() - 1]);
    let mut anderson = Anderson::default();
    for (from, to) in paths.iter().rev().take(COMBINED).rev().map(ends) {
        let target = from + newton * (to - from);
        anderson.record(from.as_slice(), target.as_slice().to_vec(), &[1.0; COORDINATES]);
    }
    let (from, to) = ends(&paths[paths.len() - 1]);
    let alone = newton * (to - from);
    [alone, anderson.combine().map_or(alone, |target| Slow::from_column_slice(&target) - from)]
}

/// Returns the largest of the attitude's angles, rad.
fn attitude(step: &Slow) -> f64 {
    step.fixed_rows::<ANGLES>(0).amax()
}

/// Returns the state of a trial, moved in its slow coordinates. If other bends would make the flagella overlap more, only the
/// attitude is moved: the bends of flagella that lean on each other follow the attitude.
fn moved(trial: &mut Trial, change: &Slow) -> State {
    let touching = 2.0 * trial.solver().model().robot.flagellum.rod_radius_m;
    let state = trial.state().clone();
    let least = trial.least_distance(&state).min(touching);
    let moved = slow::moved(&state, change, &trial.profile);
    if trial.least_distance(&moved) >= least {
        return moved;
    }
    let mut turn = Slow::zeros();
    turn.fixed_rows_mut::<ANGLES>(0).copy_from(&change.fixed_rows::<ANGLES>(0));
    slow::moved(&state, &turn, &trial.profile)
}

/// Returns settings with a step that divides this time (s) evenly, so that no shorter step is needed at its end.
fn with_even_steps(settings: &SolverSettings, speeds: [f64; 2], time: f64) -> SolverSettings {
    let fastest = speeds[0].abs().max(speeds[1].abs()).max((speeds[0] - speeds[1]).abs());
    let longest = settings.longest_step_s.min(settings.step_rad / fastest.max(1e-9));
    SolverSettings { longest_step_s: time / (time / longest - 1e-9).ceil(), ..settings.clone() }
}

/// Returns settings that are less accurate in contact. The length of free steps stays, and so do the solver's inverses.
fn with_coarse_steps(settings: &SolverSettings) -> SolverSettings {
    let tolerance = (settings.tolerance * COARSE_TOLERANCE).min(LARGEST_TOLERANCE).max(settings.tolerance);
    SolverSettings { step_error: settings.step_error * COARSE_ERROR, tolerance, ..settings.clone() }
}
