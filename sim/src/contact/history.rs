//! History of the flagella's bundling state: apart, touching or bundled.
//!
//! Flagella that touch once per turn count as touching throughout: a closer state is recorded at once, a looser one after it
//! has lasted for [`RELEASE_DELAY_S`].

use super::bundling::Bundling;
use serde::{Deserialize, Serialize};

/// Duration that a looser state must last, s: more than a turn at all but the slowest speeds.
pub const RELEASE_DELAY_S: f64 = 1.0;

/// A bundling state of the flagella and its start.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub struct BundlingChange {
    /// Time of the trial, s.
    pub time_s: f64,
    /// The state.
    pub bundling: Bundling,
}

/// The states of a trial so far.
#[derive(Clone, Debug, Default)]
pub struct BundlingHistory {
    /// The states in order of time; the first is the state at the trial's start.
    pub changes: Vec<BundlingChange>,
    /// The closest state since the flagella left the last recorded state, with its start.
    looser: Option<BundlingChange>,
}

impl BundlingHistory {
    /// Adds a sample; returns the new state if the state changed.
    pub fn push(&mut self, time_s: f64, bundling: Bundling) -> Option<BundlingChange> {
        let sample = BundlingChange { time_s, bundling };
        let closeness = |change: &BundlingChange| change.bundling as u8;
        let change = match self.changes.last() {
            Some(last) if closeness(&sample) == closeness(last) => {
                self.looser = None;
                return None;
            }
            Some(last) if closeness(&sample) < closeness(last) => {
                let looser = self.looser.get_or_insert(sample);
                if closeness(&sample) > closeness(looser) {
                    looser.bundling = bundling;
                }
                if time_s - looser.time_s < RELEASE_DELAY_S {
                    return None;
                }
                *looser
            }
            _ => sample,
        };
        self.looser = None;
        self.changes.push(change);
        (self.changes.len() > 1).then_some(change)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Bundling::{Apart, Bundled, Touching};

    #[test]
    fn periodic_touching_is_one_state_and_looser_states_need_a_second() {
        let mut history = BundlingHistory::default();
        for i in 0..400 {
            let time_s = f64::from(i) * 0.05;
            let bundling = match time_s {
                t if t < 2.0 => Apart,
                t if t < 8.0 => [Touching, Apart][usize::from(i % 14 > 4)],
                t if t < 12.0 => Bundled,
                t if t < 15.0 => [Touching, Apart][usize::from(i % 14 > 4)],
                _ => Apart,
            };
            history.push(time_s, bundling);
        }
        let changes: Vec<_> = history.changes.iter().map(|change| (change.bundling, change.time_s)).collect();
        let states: Vec<_> = changes.iter().map(|change| change.0).collect();
        assert_eq!(states, [Apart, Touching, Bundled, Touching, Apart]);
        for (change, time_s) in changes.iter().zip([0.0, 2.1, 8.0, 12.0, 14.9]) {
            assert!((change.1 - time_s).abs() < 0.3, "{changes:?}");
        }
    }
}
