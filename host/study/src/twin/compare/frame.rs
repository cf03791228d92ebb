//! Checks whether a measurement matches its model in another frame.

use super::aligned::Aligned;
use super::pair::Pair;
use crate::swing::turned_deg;
use crate::trial::labelled;

/// Smallest error of the yaw (root mean square) for which the opposite sense is tried, degrees, and the largest share of it that
/// may be left.
const LEAST_YAW_DEG: f64 = 10.0;
const LEFT: f64 = 1.0 / 3.0;

/// Largest difference of a frame's turn from a quarter or a half, degrees. Another stiffness of the flagella turns the swing by
/// less.
const NEAR_DEG: f64 = 25.0;

/// Describes a frame that explains the difference from the model.
pub(super) fn cause(pair: &Pair, aligned: &Aligned) -> Option<String> {
    let (measured, modelled) = (&pair.measured, &pair.modelled);
    if !modelled.data.is_model() || measured.data.is_model() {
        return None;
    }
    let error_deg = |sign: f64| {
        let both = aligned.in_run.clone().map(|i| [aligned.modelled_deg[i][0], aligned.measured_deg[i][0]]);
        let errors = both.map(|[model, own]| sign * model - own).filter(|error| error.is_finite());
        let (sum, count) = errors.fold((0.0, 0.0_f64), |(sum, count), error| (sum + error * error, count + 1.0));
        (sum / count.max(1.0)).sqrt()
    };
    let yaw_deg = error_deg(1.0);
    if yaw_deg > LEAST_YAW_DEG && error_deg(-1.0) < LEFT * yaw_deg {
        return Some(
            "the robot turns the other way than its model: as if both motors and their encoders were reversed, or as if the frame \
             of the angles was mirrored or its z axis pointed down, or as if the yaw counted clockwise"
                .to_owned(),
        );
    }
    let [own, model] = [measured, modelled].map(|side| labelled(side.data, side.zeroed).ok());
    let deg = turned_deg(&model?, &own?)?;
    let turn = match deg.abs() {
        quarter if (quarter - 90.0).abs() < NEAR_DEG => "quarter",
        half if half > 180.0 - NEAR_DEG => "half",
        _ => return None,
    };
    Some(format!(
        "the robot swings in directions that are turned by {deg:.0} degrees from the model's: as if the sensor or the frame of the \
         angles was turned by a {turn} about the vertical"
    ))
}
