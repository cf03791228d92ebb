//! Checks whether the angles come back to their zero after a run.
//!
//! The zero is where the robot hangs at rest, and the tether brings it back there. After the run, a part of the run's
//! yaw remains, which shrinks during the decay. A larger remainder shows that the zero has moved since the rest before
//! the run, that the sensor has turned on the robot, or that the gyroscope's bias has changed. The yaw is then wrong by
//! about as much, and the sensor's budget does not contain this error. The tilt of an import comes back by the robot's weight.

use super::data::Data;
use crate::attitude::Track;
use protocol::units::CentiRpm;
use sim::functions::exp;
use std::ops::Range;

/// Time in which the motors stop and soft flagella spring back, s. This turns the robot by a part of the yaw.
const SPRINGS_BACK_S: f64 = 4.0;

/// Averaging time of an angle at the end, s.
const LAST_S: f64 = 1.0;

/// Largest time constant of the return, relative to the robot file's.
const SLOWER: f64 = 2.0;

/// Largest part of an angle that may be left at the end if its change is to tell what is left.
const SEEN: f64 = 0.75;

/// Assumed largest distance from the zero at rest, due to joint and tether, degrees.
const ALLOWED_DEG: f64 = 5.0;

/// Assumed largest change of a tilt at rest, degrees.
const ALLOWED_TILT_DEG: f64 = 1.5;

/// An angle that does not come back.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct NotBack {
    /// `yaw`, `pitch` or `roll`.
    pub angle: &'static str,
    /// Time after the run, s.
    pub after_s: f64,
    /// The angle at its end, degrees.
    pub end_deg: f64,
    /// The nearest value that is possible after a return to rest, degrees.
    pub nearest_deg: f64,
}

/// Returns the first of some angles that does not come back after the run. Each has the whole angle of which it is a part, its 95 %
/// uncertainty at the end of the log, degrees, and the time constant of its return, s. A tilt is a whole: its pitch and roll change into
/// each other as the robot turns back.
pub(super) fn not_back<'a>(
    data: &Data,
    angles: impl IntoIterator<Item = (&'static str, [Track<'a>; 2], f64, f64)>,
) -> Option<NotBack> {
    let is_of_robot = data.speeds() != [CentiRpm(0); 2];
    angles.into_iter().filter(|_| is_of_robot).find_map(|(angle, tracks, stated_deg, time_constant_s)| {
        let after = data.times.decay.start..data.times.decay.end.min(tracks[0].span().end);
        let allowed_deg = if angle == "yaw" { ALLOWED_DEG } else { ALLOWED_TILT_DEG };
        let [end_deg, nearest_deg] = missed(tracks, &after, allowed_deg + stated_deg, time_constant_s)?;
        Some(NotBack { angle, after_s: after.end - after.start, end_deg, nearest_deg })
    })
}

/// Returns whether the phase after a run is too short to show where the yaw goes.
pub(super) fn is_short(after: &Range<f64>) -> bool {
    after.end - LAST_S < after.start + SPRINGS_BACK_S
}

/// Returns a part of an angle at the end of the phase after the run, and the nearest value possible after a return to rest,
/// degrees, if the two differ.
fn missed([part, whole]: [Track; 2], after: &Range<f64>, allowed_deg: f64, time_constant_s: f64) -> Option<[f64; 2]> {
    let sprung_s = after.start + SPRINGS_BACK_S;
    if is_short(after) {
        return None;
    }
    let [part_deg, end_deg] = [part, whole].map(|track| track.mean(after.end - LAST_S..after.end));
    let (part_deg, end_deg) = (part_deg?, end_deg?);
    let left = exp(-(after.end - sprung_s) / (SLOWER * time_constant_s));
    let first = whole.time_s.iter().zip(whole.value).filter(|(time, _)| (after.start..sprung_s).contains(*time));
    // What is left is bounded by the change as well, which a zero that has moved does not increase.
    let change = |deg: f64| if left < SEEN { (deg - end_deg) * left / (1.0 - left) } else { left * deg };
    let most = |deg: f64| (left * deg).clamp(change(deg).min(0.0), change(deg).max(0.0));
    let [low, high] = first.fold([0.0_f64; 2], |[low, high], (_, deg)| [low.min(most(*deg)), high.max(most(*deg))]);
    let low = if part == whole { low } else { -high };
    let nearest_deg = part_deg.clamp(low - allowed_deg, high + allowed_deg);
    (part_deg != nearest_deg).then_some([part_deg, nearest_deg])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::Columns;

    /// Returns the result of [`missed`] after a run that ends at a yaw, for a robot that returns to a rest with this
    /// time constant.
    fn after(run_deg: f64, time_constant_s: f64, rest_deg: f64, length_s: f64) -> Option<[f64; 2]> {
        let mut yaw = Columns::<1>::default();
        for time_s in (0..=(100.0 * length_s) as u32).map(|i| f64::from(i) * 0.01) {
            yaw.push(time_s, [rest_deg + (run_deg - rest_deg) * (-time_s / time_constant_s).exp()]);
        }
        missed([yaw.track(0); 2], &(0.0..length_s), 7.0, 10.8)
    }

    #[test]
    fn yaw_that_ends_beyond_its_return_to_rest_is_missed() {
        for (run_deg, time_constant_s, rest_deg, length_s) in
            [(-67.0, 10.8, 0.0, 30.0), (-127.0, 6.0, 0.0, 17.3), (310.0, 18.0, 0.0, 20.0), (15.0, 10.8, -6.0, 30.0)]
        {
            assert_eq!(after(run_deg, time_constant_s, rest_deg, length_s), None, "{run_deg} {time_constant_s}");
        }
        // Too short to judge.
        assert_eq!(after(-67.0, 10.8, 90.0, 4.5), None);
        for (run_deg, rest_deg, nearest_deg) in
            [(7.0, 19.0, 7.0), (-67.0, 20.0, 7.0), (-30.0, -60.0, -7.0), (20.0, 12.0, 10.2)]
        {
            let [end_deg, nearest] = after(run_deg, 10.8, rest_deg, 30.0).unwrap();
            assert!((nearest - nearest_deg).abs() < 0.1 && (end_deg - rest_deg).abs() < 6.0, "{end_deg} {nearest}");
        }
    }
}
