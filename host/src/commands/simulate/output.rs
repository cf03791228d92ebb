//! The result of `biflag simulate`.

use crate::plan::Trial;
use crate::run::model::ModelRun;
use crate::text;
use biflag_log::SteadyMeta;
use protocol::units::CentiRpm;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};

#[derive(Debug, Serialize)]
pub struct Simulated {
    #[serde(serialize_with = "crate::text::path")]
    pub session: PathBuf,
    /// Ratio of simulated to wall time of the whole command; `null` if all trials were already complete.
    pub real_time_factor: Option<f64>,
    pub trials: Vec<SimulatedTrial>,
}

#[derive(Debug, Serialize)]
pub struct SimulatedTrial {
    pub name: String,
    pub w1_rpm: f64,
    pub w2_rpm: f64,
    #[serde(serialize_with = "crate::text::path")]
    pub log: PathBuf,
    #[serde(flatten)]
    pub steady: Option<SteadyMeta>,
    /// `null` if the trial was computed by an earlier run.
    pub wall_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

impl SimulatedTrial {
    pub fn new(trial: &Trial, log: &Path) -> Self {
        let [w1_rpm, w2_rpm] = trial.speeds.map(CentiRpm::rpm);
        Self { name: trial.name.clone(), w1_rpm, w2_rpm, log: log.to_owned(), steady: None, wall_s: None, error: None }
    }
}

impl From<&ModelRun> for SimulatedTrial {
    fn from(run: &ModelRun) -> Self {
        Self {
            steady: run.result.as_ref().ok().cloned(),
            wall_s: Some(run.wall_s),
            error: run.result.as_ref().err().map(ToString::to_string),
            ..Self::new(&run.trial, &run.log)
        }
    }
}

impl fmt::Display for SimulatedTrial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(error) = &self.error {
            return write!(f, "error: {error}");
        }
        write!(f, "{}", self.name)?;
        let Some(steady) = &self.steady else { return Ok(()) };
        let SteadyMeta { yaw_deg, pitch_deg, roll_deg, settle_s, .. } = steady;
        let [yaw, pitch, roll] = [yaw_deg, pitch_deg, roll_deg].map(|deg| text::decimal(*deg, 2));
        write!(f, ": yaw {yaw}°, pitch {pitch}°, roll {roll}°")?;
        match steady.settled {
            true => write!(f, ", settled after {settle_s:.0} s")?,
            false => write!(f, ", not settled")?,
        }
        if let Some(wall_s) = self.wall_s {
            write!(f, "; {:.0} times real time", steady.simulated_s / wall_s)?;
        }
        Ok(())
    }
}
