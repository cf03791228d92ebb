//! Spikes that the motors' PWM couples into the encoder lines if leads of a motor and of an encoder share a cable.
//!
//! Each edge of the voltage at a motor inverts the lines beside its leads for a time. The edges are those of the
//! timers' outputs in fast PWM: up when the counter restarts, down one count after the compare value. A new compare
//! value comes into force when the counter restarts (sections 15.7.3 and 15.9.2 of the data sheet).

use crate::bridge::{Bridge, Drive};

/// Counts of a period in fast PWM.
const COUNTS: u64 = 256;

/// The leads that share a cable.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Cable {
    /// Duration of a spike, cycles.
    pub width: u64,
    /// Whether both motors and encoders share one cable; otherwise each motor has one with its encoder.
    pub shared: bool,
    /// Whether the lines of C1 and C2 are beside the motor's leads.
    pub channels: [bool; 2],
}

/// One timer's output at its motor.
#[derive(Clone, Copy, Debug, Default)]
struct Pwm {
    /// Whether it switches the motor's voltage.
    switches: bool,
    /// Cycles of a period.
    period: u64,
    /// Compare value in force, the next one, and the cycle at which the next one was written.
    compare: u8,
    next: u8,
    written: u64,
}

impl Pwm {
    /// Returns the cycles since its two last edges, `phase` cycles after the counter restarted; none without edges.
    fn since(&mut self, cycle: u64, phase: u64) -> Option<[u64; 2]> {
        if self.written + phase <= cycle {
            self.compare = self.next;
        }
        let high = (u64::from(self.compare) + 1) * (self.period / COUNTS);
        let has_edges = self.switches && high < self.period;
        has_edges.then(|| [0, high].map(|edge| (phase + self.period - edge) % self.period))
    }
}

/// The spikes.
#[derive(Clone, Debug, Default)]
pub struct Coupling {
    /// The cable; `None` keeps all lines apart.
    pub cable: Option<Cable>,
    pwm: [Pwm; 2],
}

impl Coupling {
    /// Sets the drive of the bridge from now on: compare values of motors 1 and 2, and periods in cycles.
    pub fn drive(&mut self, cycle: u64, bridge: &Bridge, compare: [u8; 2], periods: [u64; 2]) {
        for (motor, pwm) in self.pwm.iter_mut().enumerate() {
            pwm.switches = matches!(bridge.drive[motor], Drive::Voltage(_) | Drive::Pulses { .. });
            pwm.period = periods[motor];
            if pwm.next != compare[motor] {
                (pwm.next, pwm.written) = (compare[motor], cycle);
            }
        }
    }

    /// Returns which lines of encoders 1 and 2 are inverted now, and the cycles until that may change. `phases`: cycles
    /// since the timers of motors 1 and 2 restarted.
    pub fn strike(&mut self, cycle: u64, phases: [u64; 2]) -> ([[bool; 2]; 2], u64) {
        let (mut struck, mut next) = ([false; 2], u64::MAX);
        let Some(Cable { width, shared, channels }) = self.cable else { return ([[false; 2]; 2], next) };
        for (motor, pwm) in self.pwm.iter_mut().enumerate() {
            for since in pwm.since(cycle, phases[motor]).into_iter().flatten() {
                let is_struck = since < width;
                struck[motor] |= is_struck;
                next = next.min(if is_struck { width } else { pwm.period } - since);
            }
        }
        if shared {
            struck = [struck[0] || struck[1]; 2];
        }
        (struck.map(|is_struck| channels.map(|beside| beside && is_struck)), next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_edge_of_the_pwm_strikes_the_lines_of_its_cable() {
        let cable = Some(Cable { width: 160, shared: false, channels: [true, false] });
        let mut coupling = Coupling { cable, ..Coupling::default() };
        let bridge = Bridge { drive: [Drive::Voltage(0.5), Drive::Coast], ..Bridge::default() };
        coupling.drive(0, &bridge, [99, 200], [16384; 2]);
        let (mut cycle, mut spikes, mut is_struck) = (16384, Vec::new(), false);
        while cycle < 3 * 16384 {
            let (struck, next) = coupling.strike(cycle, [cycle % 16384; 2]);
            assert_eq!(struck[1], [false; 2]);
            assert!(!struck[0][1]);
            if struck[0][0] != is_struck {
                is_struck = !is_struck;
                spikes.push(cycle % 16384);
            }
            cycle += next;
        }
        assert_eq!(spikes, [0, 160, 6400, 6560].repeat(2));
    }

    #[test]
    fn a_compare_value_comes_into_force_where_the_counter_begins_anew() {
        let cable = Some(Cable { width: 32, shared: true, channels: [true; 2] });
        let mut coupling = Coupling { cable, ..Coupling::default() };
        let bridge = Bridge { drive: [Drive::Voltage(0.5), Drive::Coast], ..Bridge::default() };
        coupling.drive(0, &bridge, [99, 0], [16384; 2]);
        let mut strikes = |cycle: u64| coupling.strike(cycle, [cycle % 16384; 2]).0 == [[true; 2]; 2];
        assert!(strikes(16384 + 6400) && !strikes(16384 + 3200));
        coupling.drive(20000, &bridge, [49, 0], [16384; 2]);
        let mut strikes = |cycle: u64| coupling.strike(cycle, [cycle % 16384; 2]).0 == [[true; 2]; 2];
        assert!(strikes(16384 + 6400));
        assert!(strikes(2 * 16384 + 3200) && !strikes(2 * 16384 + 6400));
    }
}
