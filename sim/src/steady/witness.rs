//! The witness of a search: the trial's own path, from before the first step of the search.
//!
//! A step of a search may lead to where another stable motion begins; robots whose flagella touch have more than one. So the
//! state that no step has moved goes on without steps, and its means over a period are compared with those of the motion. They
//! agree as soon as their difference is within both ±, or has fallen to [`FALLEN`] of what it was: modes that are left decay in
//! 18 s or less, and a path that ends elsewhere keeps most of its distance. They agree earlier where the changes of the last
//! periods already lead to within both ±.
//!
//! Far from the motion its periods are coarse, as those of the search are. A path that seems to end elsewhere goes on as
//! accurate as a trial before it is believed.

use super::shooting::CLOSE;
use super::{Problem, SolveError, Watch, distance, run};
use crate::V3;
use crate::functions::exp;
use crate::params::SolverSettings;
use crate::step::state::State;
use crate::trial::Trial;
use crate::trial::means::Steady;
use crate::trial::profile::SpeedProfile;

/// Share of the first difference to which it must fall.
const FALLEN: f64 = 0.2;
/// Longest time of a witness, s: four of the longest time constants.
const LONGEST_S: f64 = 72.0;
/// Time constant, s, with which a difference would still have to fall for the witness to go on.
const LONGEST_DECAY_S: f64 = 30.0;

/// Lets a state go on, period after period, until it agrees with a motion or is known to end elsewhere. Returns its last period,
/// and whether it agrees. `trial`: the last period of the motion; `found`: its means and their standard errors; `coarse`,
/// `ordinary`: settings of coarse periods, and of those of a trial.
///
/// # Errors
/// [`SolveError::Interrupted`] and [`SolveError::Profile`]. Where a step fails, nothing agrees.
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
        // Where the witness is refused, the trial goes on from it.
        witness.set_accuracy(ordinary);
        if has_failed {
            return Ok((witness, false));
        }
        let now = witness.window_summary().steady;
        // Without angles there is no difference of them: the trial decides.
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
            // Coarse periods lead elsewhere.
            path.truncate(1);
        }
        state = witness.state().clone();
    }
}

/// Returns where a path of differences ends if each change is as much smaller than the one before as the last one was (Aitken's
/// extrapolation); `None` for a path of less than three points.
fn end(path: &[V3], period: f64) -> Option<V3> {
    let [.., one, two, three] = path else { return None };
    let (earlier, later) = (two - one, three - two);
    let kept = (later.dot(&earlier) / earlier.norm_squared().max(f64::MIN_POSITIVE))
        .clamp(0.0, exp(-period / LONGEST_DECAY_S));
    Some(three + later * (kept / (1.0 - kept)))
}

/// Returns the difference of the angles of two motions, over twice the ± of the second one.
fn difference(one: &Steady, other: &Steady) -> V3 {
    let angles = one.attitude.iter().zip(&other.attitude);
    V3::from_iterator(angles.map(|(one, other)| (one.mean - other.mean) / (2.0 * other.uncertainty())))
}
