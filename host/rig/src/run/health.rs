//! Checks sensor, wiring, supply and firmware from a trial's telemetry.

use protocol::Telemetry;
use protocol::units::Count;

/// Supply below which the user is warned, V. USB allows 4.40 V at the end of a long cable, and the board stops the motors
/// at 4.3 V.
const LOW_SUPPLY_V: f64 = 4.5;

/// Number of edges of both encoders without motion up to which the user is not warned. A shaft that turns back just
/// after an edge makes two of them without any noise, and the board's position stays right.
pub const GLITCHES_ALLOWED: u64 = 10;

/// Edges per second without motion, while a motor is driven, above which a trial is not complete. The board corrects
/// speed and position for the edges that it recognises, but such a cable may carry other disturbances.
const DISTURBED_HZ: f64 = 100.0;

/// Shortest time for judging that rate, s.
const JUDGED_S: f64 = 1.0;

/// Counts the problems in the frames of a trial.
#[derive(Debug, Default)]
pub(super) struct Health {
    last: Option<Telemetry>,
    clipped: u64,
    glitches: u64,
    missed_ticks: u64,
    /// Time with a motor on.
    driven_s: f64,
    lowest_supply_v: Option<f64>,
}

impl Health {
    pub(super) fn frame(&mut self, frame: &Telemetry) {
        let before = self.last.replace(*frame).unwrap_or(*frame);
        let since = |now: Count, before: Count| u64::from(now.0.wrapping_sub(before.0));
        self.clipped += since(frame.clipped, before.clipped);
        self.glitches += since(frame.glitches, before.glitches);
        self.missed_ticks += since(frame.missed_ticks, before.missed_ticks);
        if frame.duty.iter().any(|duty| duty.0 != 0) {
            self.driven_s += f64::from(frame.time.since(before.time)) * 1e-6;
        }
        // 0 until the board has measured it.
        if frame.supply.0 > 0 {
            let supply_v = frame.supply.volts();
            self.lowest_supply_v = Some(self.lowest_supply_v.map_or(supply_v, |lowest| lowest.min(supply_v)));
        }
    }

    /// Returns the number of edges per second without motion, if it is too large for a trial.
    pub(super) fn disturbed_hz(&self) -> Option<f64> {
        let rate_hz = self.glitches as f64 / self.driven_s.max(JUDGED_S);
        (rate_hz > DISTURBED_HZ).then_some(rate_hz)
    }

    /// Returns a warning for each problem.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.clipped > 0 {
            warnings.push(format!(
                "{} readings were at the end of the sensor's range: give a wider gyro_range_dps or accel_range_g in the plan",
                self.clipped
            ));
        }
        if self.glitches > GLITCHES_ALLOWED {
            warnings.push(format!(
                "the encoders' lines had {} edges that are not motion: keep them away from the motors' leads, and check \
                 their ground",
                self.glitches
            ));
        }
        if self.missed_ticks > 0 {
            let ticks = self.missed_ticks;
            warnings.push(format!("the board missed {ticks} ticks: please report this and attach the log"));
        }
        if let Some(volts) = self.lowest_supply_v.filter(|volts| *volts < LOW_SUPPLY_V) {
            warnings.push(format!(
                "the board's supply fell to {volts:.2} V: use another USB cable or port, and check that the motors have \
                 a supply of their own"
            ));
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::units::{Duty, Micros, Millivolts};

    #[test]
    fn a_sound_trial_has_no_warnings_and_counts_before_it_do_not_matter() {
        let mut health = Health::default();
        let sound =
            Telemetry { clipped: Count(7), glitches: Count(90), missed_ticks: Count(3), ..Telemetry::default() };
        health.frame(&sound);
        health.frame(&Telemetry { supply: Millivolts(4500), glitches: Count(100), ..sound });
        assert_eq!(health.warnings(), [""; 0]);
    }

    #[test]
    fn each_problem_is_a_warning_across_the_wrap_of_its_counter() {
        let mut health = Health::default();
        health.frame(&Telemetry { clipped: Count(65_535), supply: Millivolts(4900), ..Telemetry::default() });
        health.frame(&Telemetry { clipped: Count(1), glitches: Count(11), ..Telemetry::default() });
        let supply = Millivolts(4449);
        health.frame(&Telemetry {
            clipped: Count(1),
            glitches: Count(11),
            missed_ticks: Count(1),
            supply,
            ..Telemetry::default()
        });
        let warnings = health.warnings();
        for (warning, said) in warnings.iter().zip(["2 readings", "11 edges", "1 ticks", "4.45 V"]) {
            assert!(warning.contains(said), "{warning}");
        }
        assert_eq!(warnings.len(), 4);
    }

    #[test]
    fn a_trial_with_more_than_100_false_edges_for_each_second_of_its_motors_is_disturbed() {
        for (glitches, disturbed_hz) in [(200, None), (201, Some(100.5))] {
            let mut health = Health::default();
            let mut frame = Telemetry::default();
            // 10 s at rest, 2 s with a motor on; the counter wraps.
            for second in 0..=12 {
                frame.time = Micros(second * 1_000_000);
                frame.duty = [Duty(0), Duty(if second > 10 { -90 } else { 0 })];
                frame.glitches = Count(if second > 10 { glitches - 100 } else { 65_436 });
                health.frame(&frame);
            }
            assert_eq!(health.disturbed_hz(), disturbed_hz);
        }
    }
}
