//! Quantities over time, reduced to fit on a page.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Map, Value, json};
use study::attitude::Columns;
use study::statistics::extremes;

/// Least mean number of samples in a stretch: the range of fewer is not informative.
const STRETCH_SAMPLES: usize = 4;

/// Largest number of stretches: about a second each in a trial of two minutes. A mean over much less than a turn would contain
/// the swing.
const MAX_STRETCHES: usize = 120;

/// Times that differ by less than this from an even spacing are stored as evenly spaced.
const EVEN_S: f64 = 5e-4;

/// Quantities for which a chart shows only the mean of a stretch, not its range, because they change slowly or in steps.
const MEAN_ALONE: [&str; 7] = ["uncertainty", "true_yaw", "true_pitch", "true_roll", "contact", "target1", "target2"];

fn has_range(name: &str) -> bool {
    !MEAN_ALONE.contains(&name)
}

/// A table reduced to fit on the page.
#[derive(Clone, Debug)]
pub(super) struct Fitted<const N: usize> {
    /// All samples, or evenly chosen ones. Each row is a row of the original table.
    pub samples: Columns<N>,
    /// The data of the charts if not all samples are kept.
    pub ranges: Option<Ranges<N>>,
}

/// Smallest, largest and mean value of each quantity in stretches of equal length; NaN in a stretch without samples.
#[derive(Clone, Debug)]
pub(super) struct Ranges<const N: usize> {
    /// Start of the first stretch.
    pub from_s: f64,
    /// Length of each stretch.
    pub width_s: f64,
    pub low: [Vec<f64>; N],
    pub high: [Vec<f64>; N],
    pub mean: [Vec<f64>; N],
}

/// Returns the ranges in `count` stretches of equal length; there must be a row.
fn ranges<const N: usize>(table: &Columns<N>, count: usize) -> Ranges<N> {
    let (from_s, to_s) = (table.time_s[0], table.time_s[table.time_s.len() - 1]);
    let width_s = (to_s - from_s) / count as f64;
    let empty = || std::array::from_fn(|_| vec![f64::NAN; count]);
    let mut ranges = Ranges { from_s, width_s, low: empty(), high: empty(), mean: empty() };
    let stretch = |time: f64| (((time - from_s) / width_s) as usize).min(count - 1);
    for k in 0..N {
        let mut seen = vec![0.0; count];
        for (time, value) in table.time_s.iter().zip(&table.values[k]).filter(|(_, value)| value.is_finite()) {
            let i = stretch(*time);
            seen[i] += 1.0;
            // The least and the greatest of NaN and a number are the number.
            ranges.low[k][i] = ranges.low[k][i].min(*value);
            ranges.high[k][i] = ranges.high[k][i].max(*value);
            let mean = &mut ranges.mean[k][i];
            *mean = if mean.is_nan() { *value } else { *mean + (value - *mean) / seen[i] };
        }
    }
    ranges
}

/// Returns the data that fit into about `bytes` of text: the whole table, or ranges, in at most half of the room, and evenly
/// chosen samples.
pub(super) fn fitted<const N: usize>(table: &Columns<N>, names: &[&str; N], bytes: usize) -> Fitted<N> {
    // Text has four characters for three bytes.
    let bytes = bytes / 4 * 3;
    let present = || (0..N).filter(|k| has(table, *k)).map(|k| has_range(names[k]));
    let row_bytes = 2 * present().count();
    let rows = table.len();
    let time_bytes = if even(&table.time_s).is_some() { 0 } else { 4 };
    if rows * (time_bytes + row_bytes) <= bytes {
        return Fitted { samples: table.clone(), ranges: None };
    }
    let stretch_bytes = present().map(|has_range| if has_range { 6 } else { 2 }).sum::<usize>().max(1);
    let most = MAX_STRETCHES.min(rows / STRETCH_SAMPLES).max(1);
    let stretches = (bytes / 2 / stretch_bytes).clamp(1, most);
    let rest = bytes - (stretches * stretch_bytes).min(bytes / 2);
    Fitted { samples: table.sampled(rest / (4 + row_bytes)), ranges: Some(ranges(table, stretches)) }
}

/// Returns whether a column has a value.
fn has<const N: usize>(table: &Columns<N>, k: usize) -> bool {
    table.values[k].iter().any(|value| value.is_finite())
}

impl<const N: usize> Fitted<N> {
    /// Returns the table for the page's script; columns without a value are left out.
    pub fn page(&self, names: &[&str; N]) -> Value {
        let mut page = Map::new();
        page.insert("time".to_owned(), times(&self.samples.time_s));
        let mut stretches = Map::new();
        for (k, name) in names.iter().enumerate().filter(|(k, _)| has(&self.samples, *k)) {
            page.insert((*name).to_owned(), quantised(&self.samples.values[k]));
            let Some(ranges) = &self.ranges else { continue };
            let mean = quantised(&ranges.mean[k]);
            let quantity = if has_range(name) {
                json!({ "mean": mean, "low": quantised(&ranges.low[k]), "high": quantised(&ranges.high[k]) })
            } else {
                json!({ "mean": mean })
            };
            stretches.insert((*name).to_owned(), quantity);
        }
        if let Some(Ranges { from_s, width_s, mean, .. }) = &self.ranges {
            let count = mean.first().map_or(0, Vec::len);
            page.insert(
                "ranges".to_owned(),
                json!({ "from_s": from_s, "width_s": width_s, "count": count, "columns": stretches }),
            );
        }
        page.into()
    }

    /// Returns the length of a stretch; `None` if all samples are kept.
    pub fn range_s(&self) -> Option<f64> {
        self.ranges.as_ref().map(|ranges| ranges.width_s)
    }
}

/// Returns values for the page in 16 bits each: `from + step` times the number, 65535 for a missing value. Equal values need no
/// numbers.
pub(super) fn quantised(values: &[f64]) -> Value {
    const LEVELS: f64 = 65_534.0;
    let [least, most] = extremes(values.iter().copied().filter(|value| value.is_finite()));
    if most == least && values.iter().all(|value| value.is_finite()) {
        return json!({ "from": least, "step": 0.0, "count": values.len() });
    }
    let from = if least.is_finite() { least } else { 0.0 };
    let step = if most > least { (most - least) / LEVELS } else { 1.0 };
    let number = |value: &f64| if value.is_finite() { ((value - from) / step).round() as u16 } else { u16::MAX };
    json!({ "from": from, "step": step, "u16": bytes(values.iter().map(|value| number(value).to_le_bytes())) })
}

/// Returns times for the page: the first one and the interval if they are evenly spaced, otherwise in 32 bits each.
pub(super) fn times(values: &[f64]) -> Value {
    match even(values) {
        Some(step) => json!({ "from": values[0], "step": step, "count": values.len() }),
        None => single(values),
    }
}

/// Returns the interval of evenly spaced times; `None` if they are not evenly spaced.
fn even(times: &[f64]) -> Option<f64> {
    let [first, .., last] = times else { return None };
    let step = (last - first) / (times.len() - 1) as f64;
    let is_even = times.iter().enumerate().all(|(i, time)| (time - (first + i as f64 * step)).abs() < EVEN_S);
    is_even.then_some(step)
}

/// Returns values for the page in 32 bits each.
pub(super) fn single(values: &[f64]) -> Value {
    json!({ "f32": bytes(values.iter().map(|value| (*value as f32).to_le_bytes())) })
}

/// Returns bytes as text, in Base64.
pub(super) fn bytes<const N: usize>(values: impl Iterator<Item = [u8; N]>) -> String {
    BASE64_STANDARD.encode(values.flatten().collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ONE: [&str; 1] = ["one"];

    fn table(values: &[f64]) -> Columns<1> {
        let mut table = Columns::default();
        (0..).zip(values).for_each(|(i, value)| table.push(f64::from(i) * 0.01, [*value]));
        table
    }

    /// Decodes [`quantised`] as the page's script does.
    fn read(value: &Value) -> Vec<f64> {
        if let Some(count) = value["count"].as_u64() {
            return vec![value["from"].as_f64().unwrap(); count as usize];
        }
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
        fn ranges_hold_every_sample_and_no_more(values in prop::collection::vec(-1e3..1e3, 8..500), count in 1usize..50) {
            let ranges = super::ranges(&table(&values), count);
            prop_assert_eq!(ranges.mean[0].len(), count);
            for i in 0..count {
                let low = ranges.from_s + i as f64 * ranges.width_s;
                let last = i + 1 == count;
                let inside = |time: f64| time >= low - 1e-9 && (last || time < low + ranges.width_s + 1e-9);
                let near = |k: &usize| inside(*k as f64 * 0.01);
                let own: Vec<f64> = (0..values.len()).filter(near).map(|k| values[k]).collect();
                let [least, most, mean] = [&ranges.low, &ranges.high, &ranges.mean].map(|column| column[0][i]);
                if own.is_empty() {
                    prop_assert!(least.is_nan() && most.is_nan() && mean.is_nan());
                } else if least.is_finite() {
                    prop_assert!(own.contains(&least) && own.contains(&most) && least <= mean + 1e-9 && mean <= most + 1e-9);
                }
            }
            let extreme = |values: &[f64]| values.iter().fold([f64::NAN; 2], |[a, b], v| [a.min(*v), b.max(*v)]);
            prop_assert_eq!([extreme(&ranges.low[0])[0], extreme(&ranges.high[0])[1]], extreme(&values));
        }

        #[test]
        fn a_fitted_table_keeps_its_room_and_real_rows(rows in 2usize..3000, bytes in 400usize..20_000) {
            let mut whole = Columns::default();
            for i in 0..rows {
                let angle = i as f64 * 0.7;
                whole.push(i as f64 * 0.05, [angle.sin(), angle.cos()]);
            }
            let columns = ["speed1", "target1"];
            let fitted = super::fitted(&whole, &columns, bytes);
            // A row is a point of the circle; a minimum beside a maximum would not be.
            for i in 0..fitted.samples.time_s.len() {
                let [sin, cos] = fitted.samples.row(i);
                prop_assert!((sin.hypot(cos) - 1.0).abs() < 1e-12);
            }
            prop_assert_eq!(fitted.ranges.is_none(), fitted.samples.time_s.len() == rows);
            // In addition to the numbers: names, and the origin and the step of seven columns.
            prop_assert!(fitted.page(&columns).to_string().len() < bytes + 100 + 7 * 90);
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
    fn even_times_need_no_room() {
        let every = |step: f64| (0..1000).map(|i| 0.3 + f64::from(i) * step).collect::<Vec<_>>();
        let mut values = every(0.05);
        assert_eq!(times(&values)["count"], 1000);
        assert!((times(&values)["step"].as_f64().unwrap() - 0.05).abs() < 1e-12);
        values[500] += 0.01;
        assert!(times(&values)["f32"].is_string() && times(&[1.0])["f32"].is_string() && times(&[])["f32"] == "");
        // 1000 rows of two bytes are 2667 bytes of text; with times of four bytes they would be 8000.
        let whole = table(&(0..1000).map(f64::from).collect::<Vec<_>>());
        assert!(fitted(&whole, &ONE, 2_700).ranges.is_none() && fitted(&whole, &ONE, 2_600).ranges.is_some());
    }

    #[test]
    fn a_fast_wobble_is_a_band_about_its_mean() {
        let values: Vec<f64> = (0..10_000).map(|i| 5.0 + (f64::from(i) * 0.31).sin()).collect();
        let fitted = super::fitted(&table(&values), &ONE, 4_000);
        let ranges = fitted.ranges.as_ref().unwrap();
        for i in 0..ranges.mean[0].len() {
            let [low, high, mean] = [&ranges.low, &ranges.high, &ranges.mean].map(|column| column[0][i]);
            // A stretch has 83 samples, about four periods.
            assert!(low < 4.02 && high > 5.98 && (mean - 5.0).abs() < 0.1, "{low} {mean} {high}");
        }
        let page = fitted.page(&ONE);
        assert_eq!(page["ranges"]["count"], ranges.mean[0].len());
        assert_eq!(read(&page["ranges"]["columns"]["one"]["mean"]).len(), ranges.mean[0].len());
    }

    #[test]
    fn a_gap_is_no_line_and_no_value() {
        let mut gap = table(&[1.0, 2.0, 3.0]);
        gap.push(5.0, [4.0]);
        gap.push(4.0, [9.0]);
        let broken = gap.broken_at_gaps();
        assert_eq!(broken.time_s.len(), 5);
        assert!(broken.values[0][3].is_nan() && broken.values[0][4] == 4.0);
        let values = read(&quantised(&broken.values[0]));
        assert!(values[3].is_nan() && values[4] == 4.0 && values[0] == 1.0);
        assert!(read(&quantised(&[f64::NAN, f64::INFINITY])).iter().all(|value| value.is_nan()));
        assert!(Columns::<1>::default().broken_at_gaps().time_s.is_empty());
        // Few samples keep the gap, and a stretch within it has no range.
        assert!(broken.sampled(2).values[0].iter().any(|value| value.is_nan()));
        let ranges = super::ranges(&broken, 5);
        assert!(ranges.mean[0][2].is_nan() && ranges.low[0][0] == 1.0 && ranges.high[0][0] == 3.0);
    }
}
