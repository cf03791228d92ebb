//! The progress of a sweep: its shards, and the reasons for failed points.

use super::SweepError;
use super::folder::{Counts, Folder};
use super::key::Key;
use super::point::{Point, Points, Shard, Sweep};
use crate::text::count;
use std::collections::BTreeMap;

/// The progress of a shard.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ShardCounts {
    /// Number of its points.
    pub points: u64,
    /// Number of finished points, including failed ones.
    pub done: u64,
    /// Number of failed points.
    pub failed: u64,
}

/// A reason for failed points.
#[derive(Clone, PartialEq, Debug)]
pub struct Reason {
    /// Number of points that failed for this reason, ignoring the numbers in its text.
    pub points: u64,
    /// The first of them: its index in the plan.
    pub index: u64,
    /// Its own reason.
    pub text: String,
}

impl Folder {
    /// Returns the progress of each of this many shards.
    pub fn shards(&self, of: u64, counts: &Counts) -> Vec<ShardCounts> {
        let mut shards = vec![ShardCounts::default(); of as usize];
        for index in 0..self.sweep.plan.points() {
            let shard = &mut shards[Shard::index_of(&self.sweep.name(index), of) as usize];
            shard.points += 1;
            shard.done += u64::from(counts.done.has(index));
            shard.failed += u64::from(counts.failed.has(index));
        }
        shards
    }

    /// Returns the reasons of all points that failed, the most frequent first.
    ///
    /// # Errors
    /// A part cannot be read.
    pub fn reasons(&self) -> Result<Vec<Reason>, SweepError> {
        let mut reasons = BTreeMap::<String, Reason>::new();
        let mut counted = Points::none(self.sweep.plan.points());
        self.read(|_, record| {
            let index = record.index;
            if let Some(text) = record.outcome.as_ref().err().filter(|_| counted.add(index)) {
                let new = || Reason { points: 0, index, text: text.to_owned() };
                let reason = reasons.entry(without_numbers(text)).or_insert_with(new);
                reason.points += 1;
                if index < reason.index {
                    (reason.index, reason.text) = (index, text.to_owned());
                }
            }
            Ok(())
        })?;
        let mut reasons: Vec<_> = reasons.into_values().collect();
        reasons.sort_by_key(|reason| std::cmp::Reverse(reason.points));
        Ok(reasons)
    }
}

impl Sweep {
    /// Returns a note on points whose means are not known, with the first of them.
    pub fn note_on_not_found(&self, points: &Points) -> Option<String> {
        let text = |index: u64| {
            let Point { speeds_rpm: [w1, w2], values, .. } = self.point(index);
            let values = self.plan.axes.iter().zip(values).filter(|(axis, _)| !matches!(axis.key, Key::Speed(_)));
            let values: String = values.map(|(axis, value)| format!(", {} {value}", axis.key.name())).collect();
            format!("({w1}, {w2}) rpm{values}")
        };
        let named: Vec<_> = (0..self.plan.points()).filter(|index| points.has(*index)).take(3).map(text).collect();
        let (number, named) = (count(points.count() as usize, "point"), named.join("; "));
        let what = "of which no steady state was found in `run` seconds: their means are not known (`kind`)";
        (!named.is_empty()).then(|| format!("{number}, {what}, as at {named}"))
    }
}

/// Returns a reason with a placeholder for each number.
fn without_numbers(reason: &str) -> String {
    let is_number = |word: &str| word.trim_matches([',', ':', ';', '(', ')']).parse::<f64>().is_ok();
    let words = reason.split(' ').map(|word| if is_number(word) { "#" } else { word });
    words.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_differ_in_their_words() {
        let [one, two, other] =
            ["a_m = 0.0135: needs more than 2.38e-2 m", "a_m = 7: needs more than 3 m", "b_m = 7: needs"];
        assert_eq!(without_numbers(one), "a_m = # needs more than # m");
        assert!(without_numbers(one) == without_numbers(two) && without_numbers(one) != without_numbers(other));
    }
}
