//! Slow changes in a rig: the voltage of its battery, and the speed of a motor.

use crate::imu::noise::Noise;

/// The supply of the motors.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Supply {
    /// Voltages of a full battery, V, and after [`DISCHARGE_S`] with a motor on.
    pub volts: [f64; 2],
    /// Time with a motor on, s.
    pub on_s: f64,
    /// The voltage that a fault sets instead, V.
    pub forced_v: Option<f64>,
}

/// Own choice: an hour with a motor on empties the battery.
pub const DISCHARGE_S: f64 = 3600.0;

impl Supply {
    /// Returns a full battery with these voltages, full and empty.
    pub const fn new(volts: [f64; 2]) -> Self {
        Self { volts, on_s: 0.0, forced_v: None }
    }

    /// Returns the voltage, V.
    pub fn now_v(&self) -> f64 {
        let [full, empty] = self.volts;
        self.forced_v.unwrap_or(full + (empty - full) * (self.on_s / DISCHARGE_S).min(1.0))
    }
}

/// Relative change of a speed: an Ornstein-Uhlenbeck process. The speed of a real motor wanders with its brushes, its grease and
/// its temperature.
#[derive(Clone, Debug)]
pub struct Wander {
    deviation: f64,
    /// The change now.
    pub now: f64,
    /// Time since its last step, s.
    since_s: f64,
    noise: Noise,
}

/// Own choice: its time constant, s, and the interval of its steps.
const CORRELATION_S: f64 = 30.0;
const STEP_S: f64 = 0.1;

impl Wander {
    /// Returns a change with this standard deviation; none at 0.
    pub fn new(deviation: f64, seed: u64) -> Self {
        let mut noise = Noise::new(seed);
        Self { deviation, now: deviation * noise.normal(), since_s: 0.0, noise }
    }

    /// Advances by `seconds`.
    pub fn advance(&mut self, seconds: f64) {
        if self.deviation == 0.0 {
            return;
        }
        self.since_s += seconds;
        while self.since_s >= STEP_S {
            self.since_s -= STEP_S;
            let kept = (-STEP_S / CORRELATION_S).exp();
            self.now = kept * self.now + self.deviation * (1.0 - kept * kept).sqrt() * self.noise.normal();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_battery_sags_by_its_use() {
        let mut supply = Supply::new([6.5, 5.5]);
        let at = |on_s| Supply { on_s, ..supply }.now_v();
        assert_eq!([0.0, 1800.0, 3600.0, 9000.0].map(at), [6.5, 6.0, 5.5, 5.5]);
        supply.forced_v = Some(5.0);
        assert_eq!(supply.now_v(), 5.0);
    }

    #[test]
    fn a_speed_wanders_by_its_deviation_and_slowly() {
        let mut wander = Wander::new(0.03, 7);
        let values: Vec<f64> = (0..30_000)
            .map(|_| {
                wander.advance(1.0);
                wander.now
            })
            .collect();
        let product =
            |lag: usize| values.iter().zip(&values[lag..]).map(|(a, b)| a * b).sum::<f64>() / values.len() as f64;
        let (deviation, kept) = (product(0).sqrt(), product(30) / product(0));
        assert!((deviation - 0.03).abs() < 0.003 && (kept - (-1.0_f64).exp()).abs() < 0.1, "{deviation} {kept}");
    }
}
