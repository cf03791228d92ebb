//! Anderson acceleration of a slowly converging iteration (Walker and Ni 2011).
//!
//! Combines the last few iterates so that the weighted change of a sweep is smallest.

use crate::linear::solve;

/// Number of differences of iterates that are combined.
const DEPTH: usize = 5;
/// Largest coefficient of a combination: larger ones amplify noise.
const LARGEST: f64 = 30.0;
/// Tikhonov regularisation of the least-squares problem, over its largest diagonal entry: nearly parallel changes must not
/// make it singular.
const REGULARISATION: f64 = 1e-8;
/// The least regularisation, for changes that are all zero.
const TINY: f64 = 1e-300;

/// The last iterates.
#[derive(Clone, Debug, Default)]
pub struct Anderson {
    iterates: Vec<Vec<f64>>,
    changes: Vec<Vec<f64>>,
}

impl Anderson {
    /// Removes all iterates.
    pub fn clear(&mut self) {
        self.iterates.clear();
        self.changes.clear();
    }

    /// Adds the iterate `before` a sweep and `after` it; entries with weight 0 do not count in the change.
    pub fn record(&mut self, before: &[f64], after: Vec<f64>, weights: &[f64]) {
        if self.iterates.last().is_some_and(|v| v.len() != after.len()) {
            self.clear();
        }
        let change = after.iter().zip(before).zip(weights).map(|((a, b), w)| (a - b) * w).collect();
        self.changes.push(change);
        self.iterates.push(after);
        if self.iterates.len() > DEPTH + 1 {
            self.iterates.remove(0);
            self.changes.remove(0);
        }
    }

    /// Returns the combined iterate; `None` with too few iterates, or if the coefficients are too large.
    pub fn combine(&self) -> Option<Vec<f64>> {
        let newest = self.iterates.len().checked_sub(1).filter(|n| *n > 0)?;
        let last = &self.changes[newest];
        let differences: Vec<Vec<f64>> = (0..newest)
            .map(|j| self.changes[j + 1].iter().zip(&self.changes[j]).map(|(a, b)| a - b).collect())
            .collect();
        let mut rows: Vec<Vec<f64>> = (differences.iter())
            .map(|a| differences.iter().map(|b| dot(a, b)).chain([dot(a, last)]).collect())
            .collect();
        let scale = (0..newest).map(|i| rows[i][i]).fold(0.0, f64::max);
        for (i, row) in rows.iter_mut().enumerate() {
            row[i] += REGULARISATION * scale + TINY;
        }
        let shares = solve(rows)?;
        if shares.iter().any(|s| s.abs() > LARGEST) {
            return None;
        }
        let mut out = self.iterates[newest].clone();
        for (j, share) in shares.iter().enumerate() {
            for ((o, a), b) in out.iter_mut().zip(&self.iterates[j + 1]).zip(&self.iterates[j]) {
                *o -= share * (a - b);
            }
        }
        Some(out)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight sums, so that the compiler may vectorise.
    let mut sums = [0.0; 8];
    let (chunks, rest) = (a.chunks_exact(8).zip(b.chunks_exact(8)), a.len() / 8 * 8);
    for (x, y) in chunks {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + a[rest..].iter().zip(&b[rest..]).map(|(x, y)| x * y).sum::<f64>()
}
