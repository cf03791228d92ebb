//! Round values along an axis.

/// Returns the multiples from `low` to `high` of the smallest step that is 1, 2 or 5 times a power of ten and at least `least`;
/// of a smaller step if there would be fewer than two.
pub fn round(low: f64, high: f64, least: f64) -> Vec<f64> {
    let decade = 10_f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0].map(|k| k * decade).into_iter().find(|step| *step >= least * (1.0 - 1e-9));
    let step = step.unwrap_or(10.0 * decade);
    let first = (low / step - 1e-9).ceil() as i64;
    let values: Vec<f64> =
        (first..).map(|i| i as f64 * step).take_while(|value| *value <= high + 1e-9 * step).collect();
    if values.len() < 2 && low < high { round(low, high, 0.5 * least) } else { values }
}
