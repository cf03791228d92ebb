//! Time series.

use crate::statistics::Line;
use std::ops::Range;

/// A gap is an interval longer than this many median intervals, and longer than [`GAP_S`].
const GAP_INTERVALS: f64 = 8.0;
const GAP_S: f64 = 0.25;

/// `N` quantities at the same times, which never decrease. NaN is a missing value.
#[derive(Clone, PartialEq, Debug)]
pub struct Columns<const N: usize> {
    /// Seconds.
    pub time_s: Vec<f64>,
    /// The quantities: `values[k][i]` at `time_s[i]`.
    pub values: [Vec<f64>; N],
}

impl<const N: usize> Default for Columns<N> {
    fn default() -> Self {
        Self { time_s: Vec::new(), values: std::array::from_fn(|_| Vec::new()) }
    }
}

impl<const N: usize> Columns<N> {
    /// Adds a row. It is ignored if its time is not finite or decreases.
    pub fn push(&mut self, time_s: f64, row: [f64; N]) {
        if time_s.is_finite() && self.time_s.last().is_none_or(|last| *last <= time_s) {
            self.time_s.push(time_s);
            self.values.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
        }
    }

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Returns whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Returns one row.
    pub fn row(&self, i: usize) -> [f64; N] {
        std::array::from_fn(|k| self.values[k][i])
    }

    /// Returns the last `M` quantities.
    pub(crate) fn last<const M: usize>(&self) -> Columns<M> {
        Columns { time_s: self.time_s.clone(), values: std::array::from_fn(|k| self.values[N - M + k].clone()) }
    }

    /// Returns one quantity over time.
    pub fn track(&self, k: usize) -> Track<'_> {
        Track { time_s: &self.time_s, value: &self.values[k] }
    }

    /// Returns all quantities over time.
    pub fn tracks(&self) -> [Track<'_>; N] {
        std::array::from_fn(|k| self.track(k))
    }

    /// Returns the range from the first to the last time; empty without rows.
    pub fn span(&self) -> Range<f64> {
        span(&self.time_s)
    }

    /// Returns the values at a time (see [`Track::at`]); NaN without rows.
    pub fn at(&self, time_s: f64) -> [f64; N] {
        let Some(place) = Place::of(&self.time_s, time_s) else { return [f64::NAN; N] };
        self.values.each_ref().map(|values| place.value(values))
    }

    /// Returns the values at the time of a row, or between two rows that are at most `longest_s` apart.
    pub fn within(&self, longest_s: f64, time_s: f64) -> Option<[f64; N]> {
        let place = Place::of(&self.time_s, time_s)?;
        let is_seen = place.between.map_or(self.time_s[place.after] == time_s, |[_, step_s]| step_s <= longest_s);
        is_seen.then(|| self.values.each_ref().map(|values| place.value(values)))
    }

    /// Returns the median interval between rows.
    pub fn interval_s(&self) -> Option<f64> {
        let mut steps: Vec<f64> = self.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let middle = steps.len() / 2;
        (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    /// Returns the longest interval between rows that is not a gap.
    pub(crate) fn longest_step_s(&self) -> Option<f64> {
        Some(GAP_S.max(GAP_INTERVALS * self.interval_s()?))
    }

    /// Returns, for each of the times, whether it is outside all gaps; within a gap, a value would be interpolated.
    pub fn are_seen(&self, times: impl Iterator<Item = f64>) -> Vec<bool> {
        let longest_s = self.longest_step_s().unwrap_or(f64::INFINITY);
        let is_seen = |time: f64| {
            let after = self.time_s.partition_point(|t| *t <= time);
            let Some(before) = after.checked_sub(1).map(|before| self.time_s[before]) else { return true };
            before == time || self.time_s.get(after).is_none_or(|after| after - before <= longest_s)
        };
        times.map(is_seen).collect()
    }

    /// Returns the columns with a row of NaN in each gap, so no line is drawn across it.
    #[must_use]
    pub fn broken_at_gaps(&self) -> Self {
        let Some(longest_s) = self.longest_step_s() else { return self.clone() };
        let mut broken = Self::default();
        for (i, time) in self.time_s.iter().enumerate() {
            if let Some(last) = broken.time_s.last()
                && time - last > longest_s
            {
                broken.push(0.5 * (last + time), [f64::NAN; N]);
            }
            broken.push(*time, self.row(i));
        }
        broken
    }

    /// Returns at most about `most` evenly chosen rows, including the last row and the start of every gap.
    #[must_use]
    pub fn sampled(&self, most: usize) -> Self {
        let rows = self.len();
        let step = rows.div_ceil(most.max(2)).max(1);
        let mut sampled = Self::default();
        let is_gap = |i: usize| self.row(i).iter().all(|value| value.is_nan());
        for i in 0..rows {
            let begins_gap = || is_gap(i) && !(i > 0 && is_gap(i - 1));
            if i % step == 0 || i + 1 == rows || begins_gap() {
                sampled.push(self.time_s[i], self.row(i));
            }
        }
        sampled
    }
}

fn span(times: &[f64]) -> Range<f64> {
    times.first().zip(times.last()).map_or(0.0..0.0, |(first, last)| *first..*last)
}

/// Where a time lies among others.
struct Place {
    /// Index of the first time that is not earlier, or of the last one.
    after: usize,
    /// If it lies between two times: how far after the first one, and their distance, s.
    between: Option<[f64; 2]>,
}

impl Place {
    /// Returns `None` without times.
    fn of(times_s: &[f64], time_s: f64) -> Option<Self> {
        let after = times_s.partition_point(|t| *t < time_s).min(times_s.len().checked_sub(1)?);
        let before_s = after.checked_sub(1).filter(|_| times_s[after] > time_s).map(|before| times_s[before]);
        Some(Self { after, between: before_s.map(|before_s| [time_s - before_s, times_s[after] - before_s]) })
    }

    fn value(&self, values: &[f64]) -> f64 {
        let (i, v1) = (self.after, values[self.after]);
        self.between.map_or(v1, |[passed_s, step_s]| values[i - 1] + (v1 - values[i - 1]) * passed_s / step_s)
    }
}

/// One quantity over time.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Track<'a> {
    /// Seconds; never decreases.
    pub time_s: &'a [f64],
    /// The quantity: `value[i]` at `time_s[i]`.
    pub value: &'a [f64],
}

impl Track<'_> {
    /// Returns the range from the first to the last time; empty without rows.
    pub fn span(&self) -> Range<f64> {
        span(self.time_s)
    }

    /// Returns the value at a time by linear interpolation; beyond the ends, the value at the end.
    pub fn at(&self, time_s: f64) -> Option<f64> {
        Place::of(self.time_s, time_s).map(|place| place.value(self.value))
    }

    /// Returns the mean over a range of time by the trapezium rule. It weights values by time, so lost frames do no
    /// harm.
    pub fn mean(&self, range: Range<f64>) -> Option<f64> {
        let length = range.end - range.start;
        let (mut t0, mut v0) = (range.start, self.at(range.start)?);
        if length <= 0.0 {
            return Some(v0);
        }
        let first = self.time_s.partition_point(|t| *t <= range.start);
        let last = self.time_s.partition_point(|t| *t < range.end).max(first);
        let inside = self.time_s[first..last].iter().copied().zip(self.value[first..last].iter().copied());
        let mut area = 0.0;
        for (time, value) in inside.chain([(range.end, self.at(range.end)?)]) {
            area += 0.5 * (v0 + value) * (time - t0);
            (t0, v0) = (time, value);
        }
        Some(area / length)
    }

    /// Returns the mean rate of change per second over a range of time.
    pub fn rate(&self, range: Range<f64>) -> Option<f64> {
        let length = range.end - range.start;
        if length > 0.0 { Some((self.at(range.end)? - self.at(range.start)?) / length) } else { None }
    }

    /// Returns the slope per second over a range of time by least squares, with equal weights.
    pub fn slope(&self, range: Range<f64>) -> Option<f64> {
        let part = self.time_s.partition_point(|t| *t < range.start)..self.time_s.partition_point(|t| *t <= range.end);
        let points = self.time_s[part.clone()].iter().copied().zip(self.value[part].iter().copied());
        let line = Line::through(points);
        (line.spread > 0.0).then_some(line.slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn columns(values: &[f64]) -> Columns<1> {
        let mut columns = Columns::default();
        (0..).zip(values).for_each(|(i, value)| columns.push(f64::from(i) * 0.01, [*value]));
        columns
    }

    proptest! {
        /// A table has the numbers of its log.
        #[test]
        fn values_at_rows_are_those_of_the_rows(values in prop::collection::vec(-1e3..1e3, 2..200)) {
            let columns = columns(&values);
            let at = columns.time_s.iter().map(|time| columns.track(0).at(*time).unwrap());
            prop_assert!(at.eq(values));
        }

        /// Means over adjacent ranges, weighted by length, add up.
        #[test]
        fn means_of_adjacent_ranges_add_up(values in prop::collection::vec(-1e3..1e3, 2..200), parts in [0.0..1.0f64, 0.0..1.0, 0.0..1.0]) {
            let columns = columns(&values);
            let mut times = parts.map(|part| part * columns.span().end);
            times.sort_by(f64::total_cmp);
            let [a, b, c] = times;
            let area = |from: f64, to: f64| columns.track(0).mean(from..to).unwrap() * (to - from);
            prop_assert!((area(a, b) + area(b, c) - area(a, c)).abs() < 1e-9 * 1e3);
        }
    }

    #[test]
    fn mean_is_weighted_by_time() {
        let mut columns = Columns::default();
        [(0.0, 0.0), (1.0, 2.0), (3.0, 2.0), (4.0, 0.0)].into_iter().for_each(|(t, v)| columns.push(t, [v]));
        let track = columns.track(0);
        assert_eq!(track.mean(0.0..4.0), Some(1.5));
        assert_eq!(track.mean(0.5..3.5), Some((0.75 + 4.0 + 0.75) / 3.0));
        assert_eq!((track.mean(2.0..2.0), track.mean(9.0..10.0)), (Some(2.0), Some(0.0)));
        assert_eq!(Columns::<1>::default().track(0).mean(0.0..1.0), None);
    }

    #[test]
    fn sampled_rows_are_original_rows() {
        let whole = columns(&(0..1001).map(|i| f64::from(i) * 0.3).collect::<Vec<_>>());
        let few = whole.sampled(100);
        assert!(few.len() <= 101 && few.time_s.first() == Some(&0.0) && few.time_s.last() == Some(&10.0));
        assert!(few.time_s.iter().zip(&few.values[0]).all(|(time, value)| (value - time * 30.0).abs() < 1e-9));
        assert_eq!(columns(&[1.0, 2.0]).sampled(5).values[0], [1.0, 2.0]);
        assert!(Columns::<1>::default().sampled(5).is_empty());
    }

    #[test]
    fn gap_gets_a_row_without_values() {
        let mut gap = columns(&[1.0, 2.0, 3.0]);
        gap.push(5.0, [4.0]);
        gap.push(4.0, [9.0]);
        let broken = gap.broken_at_gaps();
        assert_eq!(broken.len(), 5);
        assert!(broken.values[0][3].is_nan() && broken.values[0][4] == 4.0);
        assert_eq!(gap.are_seen([0.0, 0.015, 0.02, 1.0, 5.0, 9.0].into_iter()), [true, true, true, false, true, true]);
        assert!(Columns::<1>::default().broken_at_gaps().is_empty());
        assert!(broken.sampled(2).values[0].iter().any(|value| value.is_nan()), "few samples keep the gap");
    }
}
