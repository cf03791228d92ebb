//! Quantities over time, and as many points of them as a page has room for.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Value, json};

/// How many times the usual distance of two samples makes a gap, and how long it is at least.
const GAP: f64 = 8.0;
const GAP_S: f64 = 0.25;

/// `N` quantities at the same times, which never go back. NaN stands where there is none.
#[derive(Clone, Debug)]
pub(super) struct Table<const N: usize> {
    pub time_s: Vec<f64>,
    pub columns: [Vec<f64>; N],
}

impl<const N: usize> Default for Table<N> {
    fn default() -> Self {
        Self { time_s: Vec::new(), columns: std::array::from_fn(|_| Vec::new()) }
    }
}

impl<const N: usize> Table<N> {
    /// Adds a row. One whose time goes back is left out.
    pub fn push(&mut self, time_s: f64, row: [f64; N]) {
        if time_s.is_finite() && self.time_s.last().is_none_or(|last| *last <= time_s) {
            self.time_s.push(time_s);
            self.columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
        }
    }

    fn row(&self, i: usize) -> [f64; N] {
        std::array::from_fn(|k| self.columns[k][i])
    }

    /// The same with a row of NaN in each gap, so that no line is drawn across it.
    pub fn broken_at_gaps(&self) -> Self {
        let mut steps: Vec<f64> = self.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        if steps.is_empty() {
            return self.clone();
        }
        let middle = steps.len() / 2;
        let usual = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
        let mut broken = Self::default();
        for (i, time) in self.time_s.iter().enumerate() {
            if let Some(last) = broken.time_s.last()
                && time - last > GAP_S.max(GAP * usual)
            {
                let between = 0.5 * (last + time);
                broken.push(between, [f64::NAN; N]);
            }
            broken.push(*time, self.row(i));
        }
        broken
    }

    /// At most about `most` rows, evenly chosen, the last among them: for what grows steadily.
    pub fn sampled(&self, most: usize) -> Self {
        let rows = self.time_s.len();
        let step = rows.div_ceil(most.max(2)).max(1);
        let mut table = Self::default();
        (0..rows).step_by(step).for_each(|i| table.push(self.time_s[i], self.row(i)));
        if step > 1 && !(rows - 1).is_multiple_of(step) {
            table.push(self.time_s[rows - 1], self.row(rows - 1));
        }
        table
    }

    /// At most `most` rows. Where there are more, each stretch of time keeps the smallest and the largest value of each
    /// quantity, in the order in which they came: peaks stay, and nothing moves by more than [`Thinned::every_s`].
    pub fn thinned(&self, most: usize) -> Thinned<N> {
        let rows = self.time_s.len();
        if rows <= most.max(2) {
            return Thinned { table: self.clone(), every_s: 0.0 };
        }
        let stretches = (most / 2).max(1);
        let mut table = Self::default();
        let mut every_s = 0.0_f64;
        for stretch in 0..stretches {
            let range = stretch * rows / stretches..(stretch + 1) * rows / stretches;
            let times = [self.time_s[range.start], self.time_s[range.start + range.len() / 2]];
            every_s = every_s.max(self.time_s[range.end - 1] - times[0]);
            let extremes = self.columns.each_ref().map(|column| extremes(&column[range.clone()]));
            for (i, time) in times.into_iter().enumerate() {
                table.push(time, extremes.map(|pair| pair[i]));
            }
        }
        Thinned { table, every_s }
    }
}

/// A table with fewer rows.
#[derive(Clone, Debug)]
pub(super) struct Thinned<const N: usize> {
    pub table: Table<N>,
    /// The length of time that two rows stand for; 0 where every sample is there.
    pub every_s: f64,
}

/// The smallest and the largest of some values, the earlier one first; NaN where there is a gap among them.
fn extremes(values: &[f64]) -> [f64; 2] {
    let (mut least, mut most) = (0, 0);
    for (i, value) in values.iter().enumerate() {
        if value.is_nan() {
            return [f64::NAN; 2];
        }
        if *value < values[least] {
            least = i;
        }
        if *value > values[most] {
            most = i;
        }
    }
    if least <= most { [values[least], values[most]] } else { [values[most], values[least]] }
}

/// Values for the page in 16 bits each: `from + step` times the number, 65535 for none.
pub(super) fn quantised(values: &[f64]) -> Value {
    const LEVELS: f64 = 65_534.0;
    let finite = values.iter().copied().filter(|value| value.is_finite());
    let (least, most) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)));
    let from = if least.is_finite() { least } else { 0.0 };
    let step = if most > least { (most - least) / LEVELS } else { 1.0 };
    let number = |value: &f64| if value.is_finite() { ((value - from) / step).round() as u16 } else { u16::MAX };
    json!({ "from": from, "step": step, "u16": bytes(values.iter().map(|value| number(value).to_le_bytes())) })
}

/// Values for the page in 32 bits each.
pub(super) fn single(values: &[f64]) -> Value {
    json!({ "f32": bytes(values.iter().map(|value| (*value as f32).to_le_bytes())) })
}

/// Bytes as text.
pub(super) fn bytes<const N: usize>(values: impl Iterator<Item = [u8; N]>) -> String {
    BASE64_STANDARD.encode(values.flatten().collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn table(values: &[f64]) -> Table<1> {
        let mut table = Table::default();
        (0..).zip(values).for_each(|(i, value)| table.push(f64::from(i) * 0.01, [*value]));
        table
    }

    /// What the page's script makes of [`quantised`].
    fn read(value: &Value) -> Vec<f64> {
        let data = BASE64_STANDARD.decode(value["u16"].as_str().unwrap()).unwrap();
        let (from, step) = (value["from"].as_f64().unwrap(), value["step"].as_f64().unwrap());
        let number = |pair: &[u8; 2]| match u16::from_le_bytes(*pair) {
            u16::MAX => f64::NAN,
            number => from + step * f64::from(number),
        };
        data.as_chunks().0.iter().map(number).collect()
    }

    proptest! {
        #[test]
        fn peaks_stay_where_they_are(values in prop::collection::vec(-1e3..1e3, 1..500), most in 2usize..100) {
            let whole = table(&values);
            let Thinned { table: thin, every_s } = whole.thinned(most);
            prop_assert!(thin.time_s.len() <= most.max(2) && thin.time_s.is_sorted());
            let extreme = |column: &[f64]| {
                let sorted = |a: &f64, b: &f64| a.total_cmp(b);
                (column.iter().copied().min_by(sorted), column.iter().copied().max_by(sorted))
            };
            prop_assert_eq!(extreme(&thin.columns[0]), extreme(&values));
            for (time, value) in thin.time_s.iter().zip(&thin.columns[0]) {
                let near = |t: &f64| (t - time).abs() <= every_s + 1e-9;
                prop_assert!(whole.time_s.iter().zip(&values).any(|(t, v)| near(t) && v == value));
            }
        }

        #[test]
        fn sixteen_bits_keep_a_value_within_half_a_step(values in prop::collection::vec(-1e6..1e6, 1..50)) {
            let page = quantised(&values);
            let step = page["step"].as_f64().unwrap();
            for (there, here) in read(&page).iter().zip(&values) {
                prop_assert!((there - here).abs() <= step * 0.501);
            }
        }
    }

    #[test]
    fn what_turns_steadily_is_shown_where_it_was() {
        let whole = table(&(0..1001).map(|i| f64::from(i) * 0.3).collect::<Vec<_>>());
        let few = whole.sampled(100);
        assert!(few.time_s.len() <= 101 && few.time_s.first() == Some(&0.0) && few.time_s.last() == Some(&10.0));
        let on_line = |(time, value): (&f64, &f64)| (value - time * 30.0).abs() < 1e-9;
        assert!(few.time_s.iter().zip(&few.columns[0]).all(on_line));
        assert_eq!(table(&[1.0, 2.0]).sampled(5).columns[0], [1.0, 2.0]);
        assert!(Table::<1>::default().sampled(5).time_s.is_empty());
    }

    #[test]
    fn a_gap_is_no_line_and_no_value() {
        let mut gap = table(&[1.0, 2.0, 3.0]);
        gap.push(5.0, [4.0]);
        gap.push(4.0, [9.0]);
        let broken = gap.broken_at_gaps();
        assert_eq!(broken.time_s.len(), 5);
        assert!(broken.columns[0][3].is_nan() && broken.columns[0][4] == 4.0);
        let values = read(&quantised(&broken.columns[0]));
        assert!(values[3].is_nan() && values[4] == 4.0 && values[0] == 1.0);
        assert!(read(&quantised(&[f64::NAN, f64::INFINITY])).iter().all(|value| value.is_nan()));
        assert!(Table::<1>::default().broken_at_gaps().time_s.is_empty());
    }
}
