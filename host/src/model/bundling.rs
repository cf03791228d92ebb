//! How close the flagella are as a trial goes on: apart, touching, bundled, and when that changed.
//!
//! Flagella that touch once a turn are touching all the time, so a closer state counts at once, and a looser one when it
//! has lasted for a second.

use serde::{Deserialize, Serialize};
use sim::contact::bundling::Bundling;

/// How long a looser state must last.
const LASTS_S: f64 = 1.0;

/// From some time on the flagella were in a state.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub struct BundlingChange {
    /// The trial's clock.
    pub time_s: f64,
    /// The state.
    pub bundling: Bundling,
}

/// The states so far.
#[derive(Default)]
pub(super) struct BundlingHistory {
    /// In their order, the first one from the trial's start.
    pub changes: Vec<BundlingChange>,
    /// The closest state since the flagella left the last of them, and since when.
    looser: Option<BundlingChange>,
}

impl BundlingHistory {
    /// Takes a sample; answers the state that the flagella went into, if they left another.
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
                if time_s - looser.time_s < LASTS_S {
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
    fn a_touch_once_a_turn_is_one_state_and_what_ends_has_ended_for_a_second() {
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
