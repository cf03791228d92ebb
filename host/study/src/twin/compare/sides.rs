//! The kinds of two compared trials, and their names in texts.

use super::Comparison;
use crate::trial::Data;
use serde::Serialize;

/// The kinds of two compared trials. Two recordings, or two models, must not be called a measurement and its model.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(rename_all = "snake_case")]
pub enum Sides {
    /// A recording, and then a model.
    #[default]
    MeasurementAndModel,
    /// A model, and then a recording.
    ModelAndMeasurement,
    /// Two recordings, of a rig or of an emulated board.
    Recordings,
    /// Two models; one may be the replay of the other.
    Models,
}

impl Sides {
    pub(super) fn of(a: &Data, b: &Data) -> Self {
        match (a.is_model(), b.is_model()) {
            (true, true) => Self::Models,
            (false, false) => Self::Recordings,
            (true, false) => Self::ModelAndMeasurement,
            (false, true) => Self::MeasurementAndModel,
        }
    }

    /// Returns the subject of a sentence about both.
    pub fn text(self) -> &'static str {
        match self {
            Self::MeasurementAndModel | Self::ModelAndMeasurement => "model and measurement",
            Self::Recordings => "the two recordings",
            Self::Models => "the two models",
        }
    }

    /// Returns the subject of a sentence about several trials, which only differ in kind if the user has added logs.
    pub fn of_all(trials: &[Comparison]) -> &'static str {
        match trials.split_first() {
            Some((first, rest)) if rest.iter().all(|trial| trial.sides == first.sides) => first.sides.text(),
            _ => "both sides",
        }
    }

    /// Returns the names of both in legends and tables.
    pub fn names(self) -> [&'static str; 2] {
        match self {
            Self::MeasurementAndModel => ["measured", "model"],
            Self::ModelAndMeasurement => ["model", "measured"],
            Self::Recordings => ["first recording", "second recording"],
            Self::Models => ["first model", "second model"],
        }
    }
}
