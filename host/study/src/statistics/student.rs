//! Quantiles of Student's distribution.

use sim::functions::{ln, pow, powi};

/// Returns the two-sided 95 % quantile of Student's distribution (Abramowitz and Stegun 26.7.5; from their table 26.10
/// between one and four degrees of freedom, where the series is too small).
pub fn student_95(degrees_of_freedom: f64) -> f64 {
    const FEW: [f64; 4] = [12.706, 4.303, 3.182, 2.776];
    const NORMAL: f64 = 1.959_964;
    let f = degrees_of_freedom.max(1.0);
    if f.is_infinite() {
        return NORMAL;
    }
    if f < FEW.len() as f64 {
        // The quantile falls about as a power of the degrees of freedom.
        let (i, whole) = (f as usize - 1, f.floor());
        return FEW[i] * pow(FEW[i + 1] / FEW[i], ln(f / whole) / ln((whole + 1.0) / whole));
    }
    let z = NORMAL;
    let terms = [
        (powi(z, 3) + z) / 4.0,
        (5.0 * powi(z, 5) + 16.0 * powi(z, 3) + 3.0 * z) / 96.0,
        (3.0 * powi(z, 7) + 19.0 * powi(z, 5) + 17.0 * powi(z, 3) - 15.0 * z) / 384.0,
    ];
    z + terms[0] / f + terms[1] / powi(f, 2) + terms[2] / powi(f, 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn student_quantile_agrees_with_tables() {
        for (freedom, expected) in [
            (1.0, 12.706),
            (2.0, 4.303),
            (3.0, 3.182),
            (3.999, 2.776),
            (4.0, 2.776),
            (8.0, 2.306),
            (23.0, 2.069),
            (1000.0, 1.962),
            (f64::INFINITY, 1.960),
        ] {
            assert!((student_95(freedom) / expected - 1.0).abs() < 0.01, "{freedom}");
        }
    }
}
