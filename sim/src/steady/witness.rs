//! The witness of a search: the trial's own path, simulated without steps from the state before the first step.
//!
//! A step of a search may lead to another stable motion: robots whose flagella touch have several. So the means of the
//! witness over a period are compared with those of the motion found. They agree when their difference is within twice the
//! uncertainty, or has fallen to [`FALLEN`] of its first value: the remaining modes decay in 18 s or less, and a path that
//! ends elsewhere keeps most of its distance. They also agree when the extrapolation of the last periods is within twice the
//! uncertainty.
//!
//! Far from the motion the periods are coarse, as in the search. A path that seems to end elsewhere is first continued with
//! the accuracy of a trial.

use super::shooting::CLOSE;
use super::{Problem, SolveError, Watch, distance, run};
use crate::V3;
use crate::functions::exp;
use crate::params::SolverSettings;
use crate::step::state::State;
use crate::trial::Trial;
use crate::trial::means::Steady;
use crate::trial::profile::SpeedProfile;

/// Means agree when their difference has fallen to this share of the first one.
const FALLEN: f64 = 0.2;
/// Longest time of a witness, s: four times the longest time constant.
const LONGEST_S: f64 = 72.0;
/// Longest time constant, s, of a difference that may still decay.
const LONGEST_DECAY_S: f64 = 30.0;

/// Simulates a state, period after period, until its means agree with those of a motion or it is known to end elsewhere.
/// Returns the last period, and whether they agree. `trial`: the last period of the motion; `found`: its means and their
/// standard errors; `coarse`, `ordinary`: settings of coarse periods and of a trial.
///
/// # Errors
/// [`SolveError::Interrupted`] and [`SolveError::Profile`]. A failing step counts as no agreement.
pub fn agrees(
    problem: &Problem,
    trial: &Trial,
    [coarse, ordinary]: [&SolverSettings; 2],
    mut state: State,
    found: &Steady,
    watch: Watch,
) -> Result<(Trial, bool), SolveError> {
    let (period, from) = (trial.profile.end() - trial.profile.start(), state.time);
    let whole = SpeedProfile::constant(problem.rpm, from + LONGEST_S + period)?.from_angles(problem.start_rad);
    let mut witness = trial.clone();
    let mut path: Vec<V3> = Vec::new();
    let mut is_coarse = true;
    loop {
        witness.set_accuracy(if is_coarse { coarse } else { ordinary });
        witness = witness.followed_by(whole.between(state.time, state.time + period)?, state);
        let has_failed = run(&mut witness, f64::INFINITY, None, watch)?.is_err();
        // Without agreement the trial goes on from the witness.
        witness.set_accuracy(ordinary);
        if has_failed {
            return Ok((witness, false));
        }
        let now = witness.window_summary().steady;
        // An overturned robot has no angles to compare: the trial decides.
        if now.is_overturned() || found.is_overturned() {
            return Ok((witness, false));
        }
        path.push(difference(&now, found));
        let [first, last] = [path[0], path[path.len() - 1]].map(|difference| difference.amax());
        if last <= (FALLEN * first).max(1.0) || end(&path, period).is_some_and(|end| end.amax() <= 1.0) {
            return Ok((witness, true));
        }
        let ends_elsewhere = match path[..] {
            [.., before, now] => last - (now - before).amax() / (1.0 - exp(-period / LONGEST_DECAY_S)) > 1.0,
            _ => false,
        };
        if (ends_elsewhere && !is_coarse) || witness.state().time + period > from + LONGEST_S {
            return Ok((witness, false));
        }
        if is_coarse && (ends_elsewhere || distance(&now, found) < CLOSE) {
            is_coarse = false;
            // Coarse periods lead to a slightly different state.
            path.truncate(1);
        }
        state = witness.state().clone();
    }
}

/// Returns the end of a path of differences by Aitken's extrapolation: the ratio of successive changes stays that of the last
/// two. `None` for a path of fewer than three points.
fn end(path: &[V3], period: f64) -> Option<V3> {
    let [.., one, two, three] = path else { return None };
    let (earlier, later) = (two - one, three - two);
    let kept = (later.dot(&earlier) / earlier.norm_squared().max(f64::MIN_POSITIVE))
        .clamp(0.0, exp(-period / LONGEST_DECAY_S));
    Some(three + later * (kept / (1.0 - kept)))
}

/// Returns the difference of the angles of two motions, divided by twice the uncertainty of the second.
fn difference(one: &Steady, other: &Steady) -> V3 {
    let angles = one.attitude.iter().zip(&other.attitude);
    V3::from_iterator(angles.map(|(one, other)| (one.mean - other.mean) / (2.0 * other.uncertainty())))
}
