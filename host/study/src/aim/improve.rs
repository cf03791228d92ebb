//! Improves speeds towards a target attitude: Gauss-Newton steps within bounds, with Broyden's updates of the
//! derivatives.
//!
//! An evaluation of the model takes a tenth of a second or more and has an error of some hundredths of a degree, so
//! finite differences would take most of the time. The derivatives start from the table's, and each evaluation corrects
//! them (Broyden 1965, Math. Comput. 19, 577). The crate `levenberg-marquardt`, which fits the parameters, needs
//! derivatives at every point and has no bounds.

use super::error::AimError;
use super::quantity::Attitude;
use super::target::{Target, largest};
use nalgebra::{DMatrix, DVector};
use protocol::units::CentiRpm;
use sim::functions::powi;

/// Largest step of a speed at first, rpm.
const FIRST_STEP: f64 = 20.0;
/// Smallest step tried, rpm.
const LAST_STEP: f64 = 0.05;
/// Most evaluations of the model in a search.
pub const VALUES: usize = 9;
/// Step length at which an update corrects the derivatives by half, rpm: the differences over much shorter steps are
/// mostly errors.
const TELLING_STEP: f64 = 0.5;
/// Smallest predicted improvement of a step: in degrees, and as a share of the error.
const GAIN: [f64; 2] = [0.03, 0.01];

/// The best speeds of a search.
#[derive(Clone, PartialEq, Debug)]
pub struct Best<T> {
    /// The speeds.
    pub rpm: [f64; 2],
    /// The evaluation at these speeds.
    pub state: T,
    /// Largest error of a value, degrees.
    pub error: f64,
    /// Derivatives of the values with respect to the speeds, 1/rpm, as corrected by the search.
    pub derivatives: DMatrix<f64>,
    /// Whether the search has ended because its time was over.
    pub is_cut_short: bool,
}

/// The target, and how closely to reach it.
#[derive(Clone, Copy, Debug)]
pub struct Goal<'a> {
    /// The target.
    pub target: &'a Target,
    /// The thrust error that counts as much as one degree, N.
    pub thrust_step_n: f64,
    /// Error of all values below which the search ends, degrees.
    pub close: f64,
    /// Most evaluations in the search.
    pub values: usize,
}

/// A point of a search.
struct Point<T> {
    rpm: [f64; 2],
    state: T,
    values: DVector<f64>,
    misses: DVector<f64>,
}

/// Improves speeds until all errors are below [`Goal::close`], or until no step is predicted to reduce them.
///
/// `derivatives`: initial derivatives of the values with respect to the speeds, 1/rpm; `value`: returns the attitude at
/// given speeds, and data for the caller.
///
/// # Errors
/// Any error of `value` at the start; later only [`AimError::Interrupted`]. If the time is over, the search ends.
pub fn improve<T>(
    goal: Goal,
    start: [f64; 2],
    mut derivatives: DMatrix<f64>,
    mut value: impl FnMut([f64; 2]) -> Result<(Attitude, T), AimError>,
) -> Result<Best<T>, AimError> {
    let mut point = |rpm: [f64; 2]| -> Result<Point<T>, AimError> {
        let (attitude, state) = value(rpm)?;
        let values = goal.target.values(&attitude, goal.thrust_step_n).into();
        let misses = goal.target.misses(&attitude, goal.thrust_step_n).into();
        Ok(Point { rpm, state, values, misses })
    };
    let mut best = point(on_board(start))?;
    let mut longest = FIRST_STEP;
    let mut is_cut_short = false;
    for _ in 1..goal.values {
        let miss = best.misses.norm();
        if best.misses.amax() < goal.close || longest < LAST_STEP {
            break;
        }
        let step = step(&derivatives, &best.misses, bounds(best.rpm, longest));
        let left = (&best.misses - &derivatives * DVector::from_column_slice(&step)).norm();
        let rpm = on_board([0, 1].map(|k| best.rpm[k] + step[k]));
        let taken = DVector::from_iterator(2, (0..2).map(|k| rpm[k] - best.rpm[k]));
        if miss - left < GAIN[0].max(GAIN[1] * miss) || taken.norm() == 0.0 {
            break;
        }
        let next = match point(rpm) {
            Ok(next) => next,
            Err(AimError::Interrupted) => return Err(AimError::Interrupted),
            Err(AimError::TimeOver) => {
                is_cut_short = true;
                break;
            }
            // The model fails there: try a shorter step.
            Err(_) => {
                longest = 0.5 * taken.amax();
                continue;
            }
        };
        let unforeseen = &next.values - &best.values - &derivatives * &taken;
        derivatives += unforeseen * taken.transpose() / (taken.norm_squared() + TELLING_STEP * TELLING_STEP);
        if next.misses.norm() < miss {
            longest = longest.max(2.0 * taken.amax());
            best = next;
        } else {
            longest = 0.5 * taken.amax();
        }
    }
    let error = largest(best.misses.as_slice());
    Ok(Best { rpm: best.rpm, error, state: best.state, derivatives, is_cut_short })
}

/// Returns the nearest speeds that the board can set, rpm.
pub fn on_board(rpm: [f64; 2]) -> [f64; 2] {
    let limit = CentiRpm::LIMIT.rpm();
    rpm.map(|rpm| CentiRpm::from_rpm(rpm.clamp(-limit, limit)).rpm())
}

/// Returns the smallest and largest change of each speed: at most `longest`, and within the board's range.
fn bounds(rpm: [f64; 2], longest: f64) -> [[f64; 2]; 2] {
    let limit = CentiRpm::LIMIT.rpm();
    rpm.map(|rpm| [(-limit - rpm).max(-longest), (limit - rpm).min(longest)])
}

/// Returns the step within bounds that minimises the error of linear values.
fn step(derivatives: &DMatrix<f64>, misses: &DVector<f64>, bounds: [[f64; 2]; 2]) -> [f64; 2] {
    let columns = [0, 1].map(|k| derivatives.column(k).into_owned());
    let product = |a: usize, b: usize| columns[a].dot(&columns[b]);
    let determinant = product(0, 0) * product(1, 1) - powi(product(0, 1), 2);
    let right = [columns[0].dot(misses), columns[1].dot(misses)];
    let free = [
        (product(1, 1) * right[0] - product(0, 1) * right[1]) / determinant,
        (product(0, 0) * right[1] - product(0, 1) * right[0]) / determinant,
    ];
    if (0..2).all(|k| free[k] >= bounds[k][0] && free[k] <= bounds[k][1]) {
        return free;
    }
    // If the minimum lies outside the bounds, the minimum within them is on one of the four sides.
    let mut least = ([0.0; 2], misses.norm());
    for k in 0..2 {
        for side in bounds[k] {
            let other = 1 - k;
            let rest = misses - &columns[k] * side;
            let along = columns[other].dot(&rest) / product(other, other).max(f64::MIN_POSITIVE);
            let along = along.clamp(bounds[other][0], bounds[other][1]);
            let left = (rest - &columns[other] * along).norm();
            if left < least.1 {
                let mut step = [side; 2];
                step[other] = along;
                least = (step, left);
            }
        }
    }
    least.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aim::quantity::Quantity;

    const CLOSE: f64 = 0.1;

    /// A smooth map without a model: yaw falls with the sum of the speeds, pitch with their difference.
    fn attitude([w1, w2]: [f64; 2]) -> Attitude {
        let (sum, difference) = (w1 + w2, w1 - w2);
        Attitude {
            yaw_deg: -sum - 2e-3 * sum * sum,
            pitch_deg: -0.1 * difference + 1e-4 * difference * sum,
            ..Attitude::default()
        }
    }

    fn search(yaw: f64, pitch: f64, start: [f64; 2], derivatives: &[f64]) -> (Best<()>, usize) {
        let target = Target { wanted: vec![(Quantity::Yaw, yaw), (Quantity::Pitch, pitch)] };
        let goal = Goal { target: &target, thrust_step_n: 1.0, close: CLOSE, values: VALUES };
        let mut values = 0;
        let derivatives = DMatrix::from_row_slice(2, 2, derivatives);
        let best = improve(goal, start, derivatives, |rpm| {
            values += 1;
            Ok((attitude(rpm), ()))
        });
        (best.unwrap(), values)
    }

    #[test]
    fn a_target_within_the_bounds_is_met_with_few_values() {
        let wanted = attitude([40.0, -20.0]);
        let (best, values) = search(wanted.yaw_deg + 360.0, wanted.pitch_deg, [35.0, -10.0], &[-1.0, -1.0, -0.1, 0.1]);
        assert!(best.error < CLOSE && values <= 5, "{best:?}, {values} values");
        // Derivatives that are 50 % too large are corrected.
        let (best, values) = search(wanted.yaw_deg, wanted.pitch_deg, [50.0, 0.0], &[-1.5, -1.5, -0.15, 0.15]);
        assert!(best.error < CLOSE && values <= 8, "{best:?}, {values} values");
    }

    #[test]
    fn a_search_whose_time_is_over_has_its_best_speeds() {
        let target = Target { wanted: vec![(Quantity::Yaw, -60.0), (Quantity::Pitch, -3.0)] };
        let goal = Goal { target: &target, thrust_step_n: 1.0, close: CLOSE, values: VALUES };
        let derivatives = || DMatrix::from_row_slice(2, 2, &[-1.0, -1.0, -0.1, 0.1]);
        for (most, is_cut_short) in [(1, true), (2, true), (VALUES, false)] {
            let mut left = most;
            let best = improve(goal, [10.0, 10.0], derivatives(), |rpm| {
                left = usize::checked_sub(left, 1).ok_or(AimError::TimeOver)?;
                Ok((attitude(rpm), rpm))
            });
            let best = best.unwrap();
            assert_eq!((best.is_cut_short, best.rpm), (is_cut_short, best.state), "{most} values: {best:?}");
            assert_eq!(best.rpm == [10.0, 10.0], most == 1);
        }
        let never = improve(goal, [10.0, 10.0], derivatives(), |_| Err::<(Attitude, ()), _>(AimError::TimeOver));
        assert!(matches!(never, Err(AimError::TimeOver)));
    }

    #[test]
    fn a_target_beyond_the_bounds_ends_at_them() {
        let (best, _) = search(0.0, -40.0, [60.0, -60.0], &[-1.0, -1.0, -0.1, 0.1]);
        assert_eq!(best.rpm, [90.0, -90.0]);
        assert!((best.error - 22.0).abs() < 0.1, "{best:?}");
    }
}
