//! The attitude of a trial, judged by its findings: a finding may remove its uncertainties.

use super::data::Data;
use super::finding::Finding;
use super::findings::findings;
use super::zero::Zeroed;
use std::ops::Range;

impl Zeroed {
    /// Computes the attitude of a trial.
    pub fn new(data: &Data) -> Self {
        Self::judged(data, data.times.decay.clone())
    }

    /// Computes the attitude of a trial, with the drift only from the still phase before the run.
    pub fn from_rest(data: &Data) -> Self {
        Self::judged(data, data.duration_s..data.duration_s)
    }

    fn judged(data: &Data, after: Range<f64>) -> Self {
        let mut zeroed = Self::with_end(data, after);
        let is_unsure = findings(data, &zeroed).iter().any(Finding::empties_uncertainty);
        zeroed.judge(is_unsure);
        zeroed
    }
}
