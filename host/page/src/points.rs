//! The attitude of a trial over time, alone or beside the trial that it is compared with.

use study::attitude::Columns;
use study::trial::Zeroed;
use study::twin::{Compared, Point};

/// Returns the attitude at times by the trial's clock. `angles_deg`: the attitude of a trial alone, whose points have no model.
pub(crate) fn points(zeroed: &Zeroed, angles_deg: &Columns<3>, compared: Option<&Compared>) -> Vec<(f64, Point)> {
    if let Some(Compared { comparison, points, .. }) = compared {
        let start_s = comparison.run_start_s[0];
        return points.iter().map(|point| (point.time_s + start_s, *point)).collect();
    }
    let point = |(i, time_s): (usize, &f64)| {
        let point = Point {
            time_s: time_s - zeroed.run.start,
            measured_deg: angles_deg.row(i),
            modelled_deg: [f64::NAN; 3],
            yaw_uncertainty_deg: zeroed.yaw_uncertainty(*time_s).unwrap_or(f64::NAN),
        };
        (*time_s, point)
    };
    angles_deg.time_s.iter().enumerate().map(point).collect()
}
