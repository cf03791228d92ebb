//! How well a number is known, and whether chance explains a scatter or a difference.

mod line;
mod student;

pub use line::Line;
pub use student::student_95;

use libm::lgamma;
use nalgebra::DMatrix;
use sim::functions::{exp, ln, ln_1p, powi};

/// Degrees of freedom above which a distribution equals its limit for infinitely many.
const MANY: f64 = 1e6;

/// Returns the least and the largest of numbers.
pub fn extremes(numbers: impl IntoIterator<Item = f64>) -> [f64; 2] {
    numbers.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], x| [least.min(x), most.max(x)])
}

/// Returns numbers in order, each once.
pub fn distinct(numbers: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = numbers.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    sorted
}

/// Returns the items in their order, equal ones once.
pub fn each_once<T: PartialEq>(items: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut found = Vec::new();
    for item in items {
        if !found.contains(&item) {
            found.push(item);
        }
    }
    found
}

/// Returns the two-sided probability that the ratio of a difference to its standard uncertainty is at least this large, by
/// Student's distribution (Abramowitz and Stegun 26.7.1 and 26.5.27).
pub fn student_p_value(ratio: f64, degrees_of_freedom: f64) -> f64 {
    let freedom = degrees_of_freedom.clamp(1.0, MANY);
    incomplete_beta(freedom / (freedom + ratio * ratio), 0.5 * freedom, 0.5)
}

/// Returns the quantile of a variance with `degrees_of_freedom`, relative to its expectation, itself known with
/// `known_with` degrees of freedom: Fisher's F, or chi squared over its degrees of freedom if `known_with` is infinite.
pub fn variance_ratio(probability: f64, degrees_of_freedom: f64, known_with: f64) -> f64 {
    let (one, two) = (degrees_of_freedom.clamp(1.0, MANY), known_with.clamp(1.0, MANY));
    // Abramowitz and Stegun 26.6.2.
    let below = |ratio: f64| 1.0 - incomplete_beta(two / (two + one * ratio), 0.5 * two, 0.5 * one);
    // Bisection of the logarithm.
    let (mut low, mut high) = (-60.0_f64, 60.0_f64);
    while high - low > 1e-12 {
        let middle = 0.5 * (low + high);
        if below(exp(middle)) < probability { low = middle } else { high = middle }
    }
    exp(0.5 * (low + high))
}

/// Returns the regularised incomplete beta function by its continued fraction (Abramowitz and Stegun 26.5.8), evaluated forwards
/// (Lentz 1976).
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    /// The fraction converges in about the square root of the larger parameter.
    const MOST_TERMS: u32 = 10_000;
    const TINY: f64 = 1e-300;
    if x <= 0.0 || x >= 1.0 {
        return if x <= 0.0 { 0.0 } else { 1.0 };
    }
    // It converges fast only on this side of the mean.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(1.0 - x, b, a);
    }
    let front = exp(lgamma(a + b) - lgamma(a) - lgamma(b) + a * ln(x) + b * ln_1p(-x)) / a;
    let away_from_zero = |value: f64| if value.abs() < TINY { TINY } else { value };
    let (mut fraction, mut c, mut d) = (1.0, 1.0, 0.0);
    for i in 0..MOST_TERMS {
        let m = f64::from(i / 2);
        let term = match i {
            0 => 1.0,
            _ if i % 2 == 0 => m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m)),
            _ => -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0)),
        };
        d = 1.0 / away_from_zero(1.0 + term * d);
        c = away_from_zero(1.0 + term / c);
        fraction *= c * d;
        if (c * d - 1.0).abs() < 1e-14 {
            break;
        }
    }
    front * (fraction - 1.0)
}

/// Returns the effective degrees of freedom of a variance with parts that are estimated: each part's variance and degrees of
/// freedom (Welch and Satterthwaite; GUM, G.2b).
pub fn effective_freedom(variance: f64, parts: impl Iterator<Item = (f64, f64)>) -> f64 {
    let spread: f64 = parts.map(|(part, freedom)| powi(part, 2) / freedom).sum();
    if spread > 0.0 { powi(variance, 2) / spread } else { f64::INFINITY }
}

/// The root mean square of values of a known covariance.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct ExpectedRms {
    /// Bound that 95 of 100 draws do not exceed.
    pub bound: f64,
    /// Number of independent values with the same scatter of the mean square; correlated values are fewer than they seem.
    pub independent: f64,
}

impl ExpectedRms {
    /// Returns the expected RMS of values with this covariance, itself known with `known_with` degrees of freedom. The
    /// sum of squares is approximated by a multiple of chi squared with the same mean and variance (Satterthwaite
    /// 1946).
    pub fn new(covariance: &DMatrix<f64>, known_with: f64) -> Self {
        let (trace, squares) = (covariance.trace(), covariance.norm_squared());
        if trace <= 0.0 {
            return Self::default();
        }
        let independent = trace * trace / squares;
        let mean_square = trace / covariance.nrows() as f64;
        Self { bound: (mean_square * variance_ratio(0.95, independent, known_with)).sqrt(), independent }
    }
}

/// Returns whether each difference is beyond chance, given the p-values of all. At most one in twenty of those beyond chance is
/// expected to be due to chance (Benjamini and Hochberg 1995).
pub fn beyond_chance(p_values: &[f64]) -> Vec<bool> {
    let mut ascending: Vec<f64> = p_values.iter().copied().filter(|p| p.is_finite()).collect();
    ascending.sort_by(f64::total_cmp);
    let tests = ascending.len() as f64;
    let limit = ascending.iter().enumerate().rev().find(|(i, p)| **p <= 0.05 * (i + 1) as f64 / tests);
    p_values.iter().map(|p| limit.is_some_and(|(_, limit)| p <= limit)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Abramowitz and Stegun, tables 26.8 to 26.10.
    #[test]
    fn quantiles_are_those_of_tables() {
        for (freedom, known_with, probability, expected) in [
            (1.0, f64::INFINITY, 0.95, 3.841),
            (4.0, f64::INFINITY, 0.975, 11.143 / 4.0),
            (4.0, f64::INFINITY, 0.025, 0.484 / 4.0),
            (2.0, 8.0, 0.95, 4.459),
            (1.0, 4.0, 0.95, 7.709),
        ] {
            let found = variance_ratio(probability, freedom, known_with);
            assert!((found / expected - 1.0).abs() < 2e-3, "{freedom}, {known_with}: {found}");
        }
        for (ratio, freedom) in [(12.706, 1.0), (2.776, 4.0), (1.960, f64::INFINITY)] {
            assert!((student_p_value(-ratio, freedom) - 0.05).abs() < 1e-4, "{freedom}");
        }
    }

    #[test]
    fn values_that_move_together_are_one() {
        let together = ExpectedRms::new(&DMatrix::from_element(50, 50, 0.04), f64::INFINITY);
        assert!(
            (together.independent - 1.0).abs() < 1e-9 && (together.bound - 0.2 * 1.960).abs() < 1e-3,
            "{together:?}"
        );
        let apart = ExpectedRms::new(&DMatrix::from_diagonal_element(50, 50, 0.04), f64::INFINITY);
        assert!((apart.independent - 50.0).abs() < 1e-9 && apart.bound < 0.2 * 1.17, "{apart:?}");
        assert_eq!(ExpectedRms::new(&DMatrix::zeros(3, 3), 4.0), ExpectedRms::default());
    }

    #[test]
    fn one_alarm_in_twenty_tests_is_chance() {
        let mut p_values = vec![0.5; 19];
        p_values.push(0.03);
        assert!(!beyond_chance(&p_values).contains(&true));
        p_values[0] = 1e-4;
        assert_eq!(beyond_chance(&p_values).iter().filter(|flagged| **flagged).count(), 1);
        assert_eq!(beyond_chance(&[0.04, 0.045, f64::NAN]), [true, true, false]);
        assert!(beyond_chance(&[]).is_empty());
    }
}
