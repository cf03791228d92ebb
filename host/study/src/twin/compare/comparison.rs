//! The result of a comparison.

use super::sides::Sides;
use crate::statistics;
use crate::trial::{AngleTerm, Budget, LogFinding};
use crate::twin::headline::headline;
use crate::twin::sensor_key::SensorKey;
use serde::Serialize;
use std::path::PathBuf;

/// Rounding error of the difference between two models, degrees.
pub(super) const ROUNDING_DEG: f64 = 0.01;

/// A trial compared with its model, or with another trial at the same speeds. `json.rs` defines its keys.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
#[serde(remote = "Self")]
pub struct Comparison {
    /// Name of the measured trial.
    pub name: String,
    /// Speed of flagellum 1.
    pub w1_rpm: f64,
    /// Speed of flagellum 2.
    pub w2_rpm: f64,
    /// The measured log.
    #[serde(serialize_with = "crate::text::path")]
    pub measured: PathBuf,
    /// The modelled log.
    #[serde(serialize_with = "crate::text::path")]
    pub modelled: PathBuf,
    /// Yaw, pitch and roll of both.
    pub angles: [AngleComparison; 3],
    /// Why no transient is judged; `None` if every transient with a known uncertainty is.
    #[serde(skip)]
    pub unjudged: Option<Unjudged>,
    /// Settling times of both.
    pub settling: Settling,
    /// Share of the run in which both attitudes are known; gaps of a log make up the rest.
    pub compared_share: f64,
    /// Drift removed from the measured steady yaw.
    pub yaw_drift_deg: f64,
    /// The subtracted zero: yaw, pitch and roll in the still phase before the run.
    pub measured_zero_deg: [f64; 3],
    /// The same for the model.
    pub modelled_zero_deg: [f64; 3],
    /// Time by which the model was shifted to match the measurement, after the starts of the motors were aligned.
    pub time_shift_s: f64,
    /// Start of both runs, each on the clock of its log.
    pub run_start_s: [f64; 2],
    /// Causes of the uncertainty of the steady errors.
    pub budget: Vec<AngleTerm>,
    /// Steady errors beyond their uncertainty.
    pub differences: Vec<Difference>,
    /// Whether they are also beyond chance, given the number of tests in the session: see `twin/session`.
    #[serde(rename = "beyond_chance")]
    pub is_beyond_chance: bool,
    /// Findings about both logs.
    pub findings: Vec<LogFinding>,
    /// The kinds of the two trials.
    pub sides: Sides,
    /// Name of the second trial in findings: `replay` if it is the replay of the first, otherwise its name in [`Sides::names`].
    #[serde(skip)]
    pub other: &'static str,
    /// Where both ran.
    pub origin: [&'static str; 2],
    /// The differences as text.
    pub verdict: String,
    /// Warnings about the comparison itself.
    pub warnings: Vec<String>,
    /// The sensors of both; trials with the same sensor share its errors.
    #[serde(skip)]
    pub(in crate::twin) sensors: [Option<SensorKey>; 2],
}

impl Comparison {
    /// Returns the measured steady yaw, pitch and roll, degrees.
    pub fn measured_deg(&self) -> [f64; 3] {
        self.angles.each_ref().map(|angle| angle.measured_deg)
    }

    /// Returns the modelled steady yaw, pitch and roll, degrees.
    pub fn modelled_deg(&self) -> [f64; 3] {
        self.angles.each_ref().map(|angle| angle.modelled_deg)
    }

    /// Returns the result in one plain sentence; the verdict has the numbers of the test.
    pub fn headline(&self) -> String {
        headline(std::slice::from_ref(self), &[], None)
    }

    /// Returns whether neither steady angles nor transients differ.
    pub fn agrees(&self) -> bool {
        self.differences.is_empty() && self.transients_agree()
    }

    /// Returns whether any transient is judged: the run is long enough, and the uncertainty is known.
    pub fn judges_transients(&self) -> bool {
        self.angles.iter().any(|angle| angle.transient.is_some())
    }

    /// Returns whether the transients do not differ, as far as they are judged.
    pub fn transients_agree(&self) -> bool {
        !self.settling.differs && !self.angles.iter().any(|angle| angle.transient.is_some_and(Transient::differs))
    }
}

/// An angle of a trial compared with its model, or with another trial.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct AngleComparison {
    /// `yaw`, `pitch` or `roll`.
    pub angle: &'static str,
    /// Measured steady angle: the mean over the end of the run ([`sim::trial::means`]), relative to the zero before it.
    pub measured_deg: f64,
    /// The same for the model.
    pub modelled_deg: f64,
    /// Modelled minus measured steady angle.
    pub error_deg: f64,
    /// 95 % uncertainty of the error from the measurements; zero between models, `None` if it is unknown.
    pub uncertainty: Option<Uncertainty>,
    /// Error of the model's own steady angle, from neglected effects ([`sim::accuracy`]); `None` if the measured trial
    /// comes from a model or a simulated robot, or if the other trial is measured.
    pub model_error_deg: Option<f64>,
    /// The largest of the three parts, which limits the comparison.
    pub limited_by: Option<Limit>,
    /// Whether the angle cannot refute the model: its error is within the model's own, and that is larger than the
    /// uncertainty.
    pub cannot_refute: bool,
    /// Root mean square of the error over the run, without the gaps of both logs.
    pub rmse_deg: f64,
    /// The error of the transient; `None` if it is not judged.
    pub transient: Option<Transient>,
    /// Causes of the uncertainty; empty if it is unknown.
    #[serde(skip)]
    pub(in crate::twin) budget: Budget,
    /// Standard uncertainty from the second trial's own errors, degrees. All comparisons with the same second trial
    /// share it.
    #[serde(skip)]
    pub(in crate::twin) other_u_deg: f64,
}

impl AngleComparison {
    /// Sets the fields that follow from the errors and uncertainties.
    pub(super) fn judged(mut self) -> Self {
        self.limited_by = self.limit();
        self.cannot_refute = match (self.uncertainty, self.model_error_deg) {
            (Some(uncertainty), Some(model)) => model > uncertainty.total_deg && self.error_deg.abs() <= model,
            _ => false,
        };
        self
    }

    /// Returns the steady error if it exceeds its uncertainty.
    pub(in crate::twin) fn difference(&self) -> Option<Difference> {
        let allowed_deg = self.uncertainty?.total_deg.max(ROUNDING_DEG);
        let Self { angle, error_deg, model_error_deg, .. } = *self;
        (error_deg.abs() > allowed_deg).then_some(Difference { angle, error_deg, allowed_deg, model_error_deg })
    }

    /// Returns the probability of a steady error at least this large by chance; `None` if the uncertainty is unknown or
    /// zero.
    pub(in crate::twin) fn p_value(&self) -> Option<f64> {
        let uncertainty = self.uncertainty.filter(|uncertainty| uncertainty.total_deg > ROUNDING_DEG)?;
        Some(statistics::student_p_value(self.error_deg / uncertainty.u_deg, uncertainty.degrees_of_freedom))
    }

    fn limit(&self) -> Option<Limit> {
        let Uncertainty { noise_deg, sensor_deg, .. } = self.uncertainty?;
        let parts = [
            (Limit::Noise, noise_deg),
            (Limit::Sensor, sensor_deg),
            (Limit::Model, self.model_error_deg.unwrap_or_default()),
        ];
        let (limit, deg) = parts.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        (deg > ROUNDING_DEG).then_some(limit)
    }
}

/// The part that limits a comparison.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// Noise and drift of the trial: longer rests and repeats help.
    Noise,
    /// The sensor's errors, common to all its trials: measuring the sensor helps.
    Sensor,
    /// The model's own error.
    Model,
}

/// The 95 % uncertainty of a steady error, with its parts.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Uncertainty {
    /// Part due to the trials: noise and drift.
    pub noise_deg: f64,
    /// Part common to all trials of the sensors.
    pub sensor_deg: f64,
    /// Both parts: the smallest difference that the trials could show.
    pub total_deg: f64,
    /// Standard uncertainty.
    #[serde(skip)]
    pub u_deg: f64,
    /// Its degrees of freedom.
    #[serde(skip)]
    pub degrees_of_freedom: f64,
}

/// The error of a transient: the error before the steady end of the run, minus the part that the steady error explains
/// under the known uncertainties.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Transient {
    /// Its root mean square.
    pub residual_deg: f64,
    /// Bound that 95 of 100 equal transients do not exceed, including the tolerance of the model's speeds.
    pub allowed_deg: f64,
    /// Number of independent samples in it, because drift correlates neighbours.
    pub independent_samples: f64,
    /// The model's own error of the angle over the same time, root mean square; see [`AngleComparison::model_error_deg`].
    pub model_error_deg: Option<f64>,
}

impl Transient {
    /// Returns whether it is larger than allowed.
    pub fn differs(self) -> bool {
        self.residual_deg > self.allowed_deg
    }
}

/// Why the transients of a run are not judged.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Unjudged {
    /// The run before its steady end is too short.
    Short,
    /// Too little of the run before its steady end was measured.
    Gaps,
    /// One of the two is a steady state.
    SteadyState,
    /// One of the two is of motors without encoders. When they begin to turn depends on the bridge (half a second later, if it lets
    /// them run freely), and nothing shows from which angles; both move the transient by degrees.
    NoEncoders,
}

impl Unjudged {
    /// All reasons.
    pub const ALL: [Self; 4] = [Self::Short, Self::Gaps, Self::SteadyState, Self::NoEncoders];

    /// Returns the reason as part of a sentence.
    pub fn text(self) -> &'static str {
        match self {
            Self::Short => "the run is too short to judge the transients",
            Self::Gaps => "gaps leave too little of the run to judge the transients",
            Self::SteadyState => "a steady state has no transient",
            Self::NoEncoders => "without encoders the start of the motors is too little known to judge the transients",
        }
    }
}

/// Settling times of the attitudes.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Settling {
    /// Measured, from the start of the run; `None` if not settled.
    pub measured_s: Option<f64>,
    /// The same for the model.
    pub modelled_s: Option<f64>,
    /// Ratio of the modelled to the measured settling time; `None` if one of them did not settle, or settled at once.
    pub ratio: Option<f64>,
    /// Whether they differ by more than their uncertainties allow.
    pub differs: bool,
}

/// A steady error beyond its uncertainty.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct Difference {
    /// `yaw`, `pitch` or `roll`.
    pub angle: &'static str,
    /// The error.
    pub error_deg: f64,
    /// Its 95 % uncertainty.
    pub allowed_deg: f64,
    /// The model's own error, see [`AngleComparison::model_error_deg`].
    pub model_error_deg: Option<f64>,
}

/// Both attitudes at one time.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Point {
    /// Time from the start of the run.
    pub time_s: f64,
    /// Measured yaw (unwrapped), pitch and roll relative to their zero, with drift removed; NaN in a gap of the log.
    pub measured_deg: [f64; 3],
    /// The same for the model.
    pub modelled_deg: [f64; 3],
    /// 95 % uncertainty of the measured yaw since the start of the run; NaN if it is unknown.
    pub yaw_uncertainty_deg: f64,
}
