//! The steady angles of a trial. Every command uses them.

use super::budget::{AngleTerm, Budget};
use super::data::Data;
use crate::attitude::Columns;
use crate::swing::SwingSpeeds;
use crate::text::decimal;
use biflag_log::Summary;
use serde::Serialize;
use std::fmt;
use std::ops::Range;
use std::sync::OnceLock;

/// Time in which the swing has settled enough, s, and the largest share of the run.
const SETTLED_S: f64 = 15.0;
const SETTLED_SHARE: f64 = 0.4;

/// The mean attitude at the end of the run.
#[derive(Clone, PartialEq, Debug)]
pub struct Steady {
    /// Yaw, pitch, roll.
    pub angles_deg: [f64; 3],
    /// Causes of uncertainty of yaw, pitch, roll and tilt; `None` if unknown, empty for a model.
    pub budgets: [Option<Budget>; 4],
    /// 95 % uncertainties of yaw, pitch, roll and tilt that a model states; `None` if it states none, or for a measured trial.
    pub of_model: Option<[f64; 4]>,
    /// What an unsettled measured run may still change, as standard uncertainties of yaw, pitch and roll; 0 if the budgets hold it,
    /// and for a model.
    pub to_come_deg: [f64; 3],
    /// The drift that was removed from the yaw; `None` for a model.
    pub drift_deg: Option<f64>,
    /// The averaging window of the angles: see [`sim::trial::means`].
    pub window: Range<f64>,
    /// Whether yaw and pitch had settled.
    pub settled: bool,
    /// Settling time, s from the start of the run; `None` if not settled, or if the model solved for the steady state.
    pub settle_s: Option<f64>,
    /// The part of the run in which the robot swings steadily, or why there is none.
    pub(super) swing_s: Result<Range<f64>, &'static str>,
    /// Relative 95 % uncertainty of the rate of the board's clock.
    pub(super) clock_95: f64,
    /// The speeds measured from this swing; computed on demand, because this takes time.
    pub(super) measured: OnceLock<SwingSpeeds>,
    /// The modelled motion of an imported robot, also computed on demand.
    pub(super) modelled: OnceLock<Option<Columns<3>>>,
}

/// The steady angles of a trial, as every command reports them.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct Angles {
    /// Steady yaw relative to the rest before the run, corrected for drift.
    pub yaw_deg: f64,
    /// 95 % uncertainty of the yaw from its [`Budget`], or as a model states it; `None` if it is unknown.
    pub yaw_uncertainty_deg: Option<f64>,
    /// Steady pitch.
    pub pitch_deg: f64,
    /// Its 95 % uncertainty.
    pub pitch_uncertainty_deg: Option<f64>,
    /// Steady roll.
    pub roll_deg: f64,
    /// Its 95 % uncertainty.
    pub roll_uncertainty_deg: Option<f64>,
    /// Steady tilt: the angle between the robot's axis and the vertical.
    pub tilt_deg: f64,
    /// Its 95 % uncertainty, to first order: a smaller tilt cannot be distinguished from zero.
    pub tilt_uncertainty_deg: Option<f64>,
    /// The drift that was removed from the yaw; `None` for a model.
    pub drift_deg: Option<f64>,
    /// Duration of the still phase after the run; `None` for a model.
    pub still_after_s: Option<f64>,
    /// Time over which the angles are averaged.
    pub steady_s: f64,
    /// Whether yaw and pitch had settled before that time.
    pub settled: bool,
    /// Angle turned about each body axis over the whole trial.
    pub turned_deg: [f64; 3],
    /// The speeds measured from the swing of the robot.
    #[serde(flatten)]
    pub measured: SwingSpeeds,
    /// The causes of the uncertainties; empty for a model, or if they are unknown.
    #[serde(skip)]
    pub budget: Vec<AngleTerm>,
}

/// Returns the part of a run in which the robot swings steadily, or why there is none.
pub(super) fn swing_s(data: &Data, run: &Range<f64>) -> Result<Range<f64>, &'static str> {
    if data.reverse().is_some() || data.records.steer.is_some() {
        return Err("the speeds change in the run");
    }
    if data.records.import.as_ref().is_some_and(|import| !import.constant.is_empty()) {
        return Err("not all angles are measured");
    }
    Ok(settled_s(run))
}

/// Returns the part of a run in which the swing has settled.
pub(super) fn settled_s(run: &Range<f64>) -> Range<f64> {
    run.start + SETTLED_S.min(SETTLED_SHARE * (run.end - run.start))..run.end
}

impl Steady {
    /// Returns the speeds measured from the swing of the robot.
    pub fn measured(&self, angles_deg: &Columns<3>) -> &SwingSpeeds {
        self.measured.get_or_init(|| SwingSpeeds::of(angles_deg, self.swing_s.clone()).with_error(self.clock_95))
    }

    /// Returns the causes of uncertainty of all angles.
    pub fn budget(&self) -> Vec<AngleTerm> {
        let of = ["yaw", "pitch", "roll", "tilt"].into_iter().zip(&self.budgets);
        of.filter_map(|(angle, budget)| Some(budget.as_ref()?.terms_of(angle))).flatten().collect()
    }
}

impl Angles {
    /// Copies the angles into a summary.
    pub fn fill(&self, summary: &mut Summary) {
        summary.yaw_deg = Some(self.yaw_deg);
        summary.yaw_uncertainty_deg = self.yaw_uncertainty_deg;
        summary.pitch_deg = Some(self.pitch_deg);
        summary.roll_deg = Some(self.roll_deg);
    }

    /// Returns yaw, pitch and roll as cells of a table, degrees: `-48.35 ± 1.87`, with `?` for an unknown uncertainty.
    pub fn cells(&self) -> [String; 3] {
        let [yaw, pitch, roll, _] = self.named();
        [yaw, pitch, roll].map(|(_, angle, uncertainty)| {
            let uncertainty = uncertainty.map_or_else(|| "?".to_owned(), |uncertainty| decimal(uncertainty, 2));
            format!("{} ± {uncertainty}", decimal(angle, 2))
        })
    }

    /// Returns yaw, pitch, roll and tilt with their names and uncertainties.
    pub(crate) fn named(&self) -> [(&'static str, f64, Option<f64>); 4] {
        [
            ("yaw", self.yaw_deg, self.yaw_uncertainty_deg),
            ("pitch", self.pitch_deg, self.pitch_uncertainty_deg),
            ("roll", self.roll_deg, self.roll_uncertainty_deg),
            ("tilt", self.tilt_deg, self.tilt_uncertainty_deg),
        ]
    }
}

/// Yaw, pitch and roll, each with its uncertainty if it is known.
impl fmt::Display for Angles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, (name, angle, uncertainty)) in self.named().into_iter().take(3).enumerate() {
            write!(f, "{}{name} {}°", if i == 0 { "" } else { ", " }, decimal(angle, 2))?;
            if let Some(uncertainty) = uncertainty {
                write!(f, " ± {uncertainty:.2}°")?;
            }
        }
        if self.settled { Ok(()) } else { f.write_str("; not settled") }
    }
}
