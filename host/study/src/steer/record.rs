//! A set-point in the log.

use super::SetPoint;
use biflag_log::schema::biflag::{self, Vector};

/// The times when a set-point was due, observed and in force.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Times {
    /// The board's clock when it was due, µs.
    pub due_us: u64,
    /// The board's clock at its observation, µs.
    pub observed_us: u64,
    /// The board's clock in the first frame with the set-point in force, µs; `None` if the next set-point came first.
    pub in_force_us: Option<u64>,
}

impl Times {
    /// Returns whether it was in force more than one period after it was due, or never.
    pub fn is_late(&self) -> bool {
        self.in_force_us.is_none_or(|in_force_us| in_force_us > self.due_us + super::PERIOD_US)
    }

    /// Returns the time from the observation until the set-point is in force, s.
    pub fn latency_s(&self) -> Option<f64> {
        Some((self.in_force_us?.saturating_sub(self.observed_us)) as f64 * 1e-6)
    }
}

/// Returns the message of a set-point. `time_s`: the trial's clock at its observation.
pub fn message(time_s: f64, times: &Times, set_point: &SetPoint) -> biflag::Steering {
    let SetPoint { observation, speeds } = set_point;
    let (wanted, measured) = (&observation.wanted, &observation.measured);
    let [x, y, z] = measured.rates_dps;
    biflag::Steering {
        time_s,
        due_us: times.due_us,
        observed_us: times.observed_us,
        in_force_us: times.in_force_us.unwrap_or_default(),
        late: times.is_late(),
        wanted_yaw_deg: wanted.yaw_deg,
        wanted_pitch_deg: wanted.pitch_deg,
        yaw_deg: measured.yaw_deg,
        pitch_deg: measured.pitch_deg,
        roll_deg: measured.roll_deg,
        mean_yaw_deg: observation.mean_yaw_deg,
        mean_pitch_deg: observation.mean_pitch_deg,
        angular_velocity_dps: Some(Vector { x, y, z }),
        speed1_rpm: measured.speeds_rpm[0],
        speed2_rpm: measured.speeds_rpm[1],
        turns1: measured.turns[0],
        turns2: measured.turns[1],
        target1_rpm: speeds[0].rpm(),
        target2_rpm: speeds[1].rpm(),
    }
}
