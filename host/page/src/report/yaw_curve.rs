//! The yaw of a trial with few points, for a small picture.

use study::trial::{Data, Zeroed};
use study::twin::Compared;

/// The most points of a curve.
const MOST_POINTS: usize = 90;

/// The yaw over the run of a trial: the time from its start (s), the trial's own yaw, and that of the other side (degrees, NaN
/// where there is none).
pub(super) fn curve(data: &Data, zeroed: &Zeroed, compared: Option<&Compared>) -> Vec<[f64; 3]> {
    let run_s = data.times.run.end - data.times.run.start;
    let all: Vec<[f64; 3]> = match compared {
        Some(compared) => {
            compared.points.iter().map(|point| [point.time_s, point.measured_deg[0], point.modelled_deg[0]]).collect()
        }
        None => {
            let times = zeroed.angles_deg.time_s.iter().enumerate();
            times.map(|(i, time)| [time - zeroed.run.start, zeroed.angles_deg.row(i)[0], f64::NAN]).collect()
        }
    };
    let in_run: Vec<[f64; 3]> = all.into_iter().filter(|[time, ..]| (0.0..=run_s).contains(time)).collect();
    in_run.iter().step_by(in_run.len().div_ceil(MOST_POINTS).max(1)).copied().collect()
}
