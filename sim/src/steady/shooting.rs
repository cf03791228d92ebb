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

/// Simulated time in which the motion decays by itself before the first step, s, at least.
const DECAY_S: f64 = 6.0;
/// Simulated time of a search, s, at least, ...
const PATIENCE_S: f64 = 54.0;
/// ... and as a share of the longest simulation.
const PATIENCE: f64 = 0.8;
/// Share of the search after which all periods have the ordinary accuracy.
const COARSE: f64 = 0.8;
/// Bound of a step's error in coarse periods, over the ordinary one.
const COARSE_ERROR: f64 = 10.0;
/// Tolerance of a step's iteration in coarse periods, over the ordinary one ...
const COARSE_TOLERANCE: f64 = 5.0;
/// ... and at most: with more, steps fail.
const LARGEST_TOLERANCE: f64 = 0.05;
/// Tolerance of a step's iteration in the last periods, over the ordinary one: what every step of a period misses by adds up
/// over the time in which a slow mode decays.
const FINE_TOLERANCE: f64 = 0.5;
/// Time between samples of the slow coordinates, s, about.
const SAMPLE_S: f64 = 0.5;
/// Samples that are left out after a start from rest or a move: fast modes are still in them.
const SKIPPED: usize = 2;
/// Periods that a step is made from.
const COMBINED: usize = 5;
/// Longest time constant that is believed, s: it bounds the steps.
pub const SLOWEST_S: f64 = 60.0;
/// Longest step, rad: where a longer one seems right, the motion is not yet near enough to be linear, and the step may lead
/// to where another motion begins than the trial's.
const LONGEST: f64 = 5.0 * PI / 180.0;
/// Largest difference of the two estimates of a step, over the longer one, for a move by the whole step ...
const DIFFERENCE: f64 = 0.7;
/// ... and by half of it.
const LARGEST_DIFFERENCE: f64 = 0.85;
/// A step shorter than this, rad, ends the coarse periods, whose own error is of this size.
pub const CLOSE: f64 = 1.0 * PI / 180.0;
/// A step shorter than this, rad, ends the ordinary periods.
const VERY_CLOSE: f64 = 0.5 * PI / 180.0;

/// How a search ends.
pub enum Outcome {
    /// With a motion that repeats.
    Found(Box<Found>),
    /// Without one, after this trial, for lack of time or because a step failed.
    Lost(Box<Trial>),
    /// There is nothing to search for.
    None,
}

/// A motion that repeats.
pub struct Found {
    /// Its last period.
    pub trial: Trial,
    /// The means over the period before.
    pub before: Steady,
    /// What is left of the attitude's way to it, rad.
    pub distance: f64,
    /// Samples of the last period.
    pub samples: Vec<Sample>,
    /// The state before the first step, where a step may have led to another motion than the trial's: the flagella have touched.
    pub unmoved: Option<State>,
    /// Settings of coarse periods.
    pub coarse: SolverSettings,
    /// Settings of periods that are as accurate as a trial.
    pub ordinary: SolverSettings,
}

/// Searches for the motion that repeats.
///
/// Most of the search needs no great accuracy. Periods in which the flagella touch have coarse steps, at about half the
/// cost, until the motion is close. Where it is very close, all periods are more accurate than those of a trial.
///
/// # Errors
/// Impossible parameters or speeds, and [`SolveError::Interrupted`].
pub fn shoot(problem: &Problem, watch: Watch) -> Result<Outcome, SolveError> {
    let Problem { robot, rpm, longest_s, output, .. } = *problem;
    let speeds = rpm.map(|rpm| rpm * PI / 30.0);
    let Some(period) = period::common(speeds) else {
        // What is impossible is an error here, too.
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
            // With the assumed decay, too: small differences tell little of the true one.
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
                // Coarse periods end elsewhere.
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

/// Returns the share of a step that is to be trusted. Where none is, a period passes without a step: the motion decays by
/// itself, or leaves what is not stable. `is_sure`: coarse periods that are close need no more.
fn trusted(distance: f64, longest: f64, difference: f64, is_sure: bool) -> Option<f64> {
    let is_plausible = distance >= TOLERANCE && distance < longest && difference <= LARGEST_DIFFERENCE;
    (is_plausible || is_sure).then_some(if difference <= DIFFERENCE { 1.0 } else { 0.5 })
}

/// Returns the settings of coarse periods, of ordinary ones, and of those that may be the result.
fn accuracies(solver: &SolverSettings, speeds: [f64; 2], interval: f64) -> [SolverSettings; 3] {
    let ordinary = with_even_steps(solver, speeds, interval);
    let fine = SolverSettings { tolerance: ordinary.tolerance * FINE_TOLERANCE, ..ordinary.clone() };
    [with_coarse_steps(&ordinary), ordinary, fine]
}

/// Runs a trial to its end and returns its slow coordinates at the start and at the ends of `count` intervals (s); `None` if a
/// step fails.
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

/// Returns the step from the start of the last period to the motion that repeats, by that period alone and by the last
/// ones; not finite where a direction does not decay. `newton`: what makes a step of the change of a period.
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

/// Returns the state of a trial moved in its slow coordinates; in its attitude alone where flagella with other bends would
/// overlap more. The bends of flagella that lean on each other follow the attitude.
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

/// Returns settings with steps of which a whole number makes this time (s): they need no step of another length at its end.
fn with_even_steps(settings: &SolverSettings, speeds: [f64; 2], time: f64) -> SolverSettings {
    let fastest = speeds[0].abs().max(speeds[1].abs()).max((speeds[0] - speeds[1]).abs());
    let longest = settings.longest_step_s.min(settings.step_rad / fastest.max(1e-9));
    SolverSettings { longest_step_s: time / (time / longest - 1e-9).ceil(), ..settings.clone() }
}

/// Returns settings that are less accurate about contact. The length of free steps stays, and with it the solver's inverses.
fn with_coarse_steps(settings: &SolverSettings) -> SolverSettings {
    let tolerance = (settings.tolerance * COARSE_TOLERANCE).min(LARGEST_TOLERANCE).max(settings.tolerance);
    SolverSettings { step_error: settings.step_error * COARSE_ERROR, tolerance, ..settings.clone() }
}
