//! What a trial's telemetry says about the sensor, the wires, the supply and the program.

use protocol::Telemetry;
use protocol::units::Count;

/// Supply below which the user is warned, V. USB allows 4.40 V at the end of a long cable, and the board stops the motors
/// at 4.3 V.
const LOW_SUPPLY_V: f64 = 4.5;

/// Number of edges that are not motion, of both encoders, up to which the user is not warned. A shaft that turns back
/// just after an edge makes two without any noise, and the board's position stays right.
pub const GLITCHES_ALLOWED: u64 = 10;

/// Counts what is wrong in the frames of a trial.
#[derive(Debug, Default)]
pub(super) struct Health {
    last: Option<Telemetry>,
    clipped: u64,
    glitches: u64,
    missed_ticks: u64,
    lowest_supply_v: Option<f64>,
}

impl Health {
    pub(super) fn frame(&mut self, frame: &Telemetry) {
        let before = self.last.replace(*frame).unwrap_or(*frame);
        let since = |now: Count, before: Count| u64::from(now.0.wrapping_sub(before.0));
        self.clipped += since(frame.clipped, before.clipped);
        self.glitches += since(frame.glitches, before.glitches);
        self.missed_ticks += since(frame.missed_ticks, before.missed_ticks);
        // 0 until the board has measured it.
        if frame.supply.0 > 0 {
            let supply_v = frame.supply.volts();
            self.lowest_supply_v = Some(self.lowest_supply_v.map_or(supply_v, |lowest| lowest.min(supply_v)));
        }
    }

    /// Returns a warning for each problem.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.clipped > 0 {
            warnings.push(format!(
                "{} readings were at the end of the sensor's range: give a wider gyro_range or accel_range in the plan",
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
    use protocol::units::Millivolts;

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
}
