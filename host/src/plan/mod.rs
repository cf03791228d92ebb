//! A plan: the TOML file that says what trials a session is made of.
//!
//! ```
//! let plan = host::plan::Plan::parse("[speeds]\npairs = [[50, 10]]\ngrid = { w1 = [0, 90, 45], w2 = [0, 0, 1] }", "p.toml")?;
//! assert_eq!(plan.trials.len(), 4);
//! assert_eq!(plan.trials[0].name, "001_w1+50_w2+10");
//! assert_eq!(plan.trials[0].phases.run_s, 120.0);
//! # Ok::<(), host::plan::PlanError>(())
//! ```

mod error;
mod expand;
mod file;

pub use error::PlanError;
pub use file::PUBLISHED;

use crate::board_settings::BoardSettings;
use protocol::units::CentiRpm;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A plan that shows every table.
pub const EXAMPLE: &str = r#"[session]
name = "glycerin"
seed = 7                 # shuffles the order of the trials
repeats = 1

[trial]                  # seconds
calibrate = 5            # gyroscope at rest; 0 keeps the bias in the board's settings
preroll = 20
run = 120
decay = 30

[speeds]                 # rpm, -90 to 90; pairs and a grid may both be given
pairs = [[50, 15], [0, 45]]
grid = { w1 = [-90, 90, 10], w2 = [0, 90, 10] }

[board]                  # optional: settings to put in force before the first trial
deadline_ms = 500
"#;

/// The most trials that a plan may have.
pub const MAX_TRIALS: usize = 10_000;

/// A plan, checked and expanded.
#[derive(Clone, PartialEq, Debug)]
pub struct Plan {
    /// `[session] name`; the name of the session's folder unless the user says otherwise.
    pub name: String,
    /// Who runs it.
    pub operator: String,
    /// Whatever is worth knowing later.
    pub note: String,
    /// What robot it is.
    pub robot: Robot,
    /// Seed of the trials' order; `None`: as listed.
    pub seed: Option<u64>,
    /// The trials in the order in which they are to run.
    pub trials: Vec<Trial>,
    /// Settings to write to the board before the first trial.
    pub board: BoardSettings,
    /// The file, as it was read.
    pub text: String,
}

/// The robot's parameters: those published, or a file.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Robot {
    /// `published`, or the path in the plan.
    pub name: String,
    /// The file's content; empty for `published`.
    pub text: String,
}

/// One trial.
#[derive(Clone, PartialEq, Debug)]
pub struct Trial {
    /// Unique in the session and fit for a file's name, such as `001_w1+50_w2+10` or `002_w1+50_w2+10_r2`. The number
    /// is the place in the order.
    pub name: String,
    /// Place in the order, from 0.
    pub index: usize,
    /// Which repeat of the same speeds, from 1.
    pub repeat: u32,
    /// Speeds of flagella 1 and 2.
    pub speeds: [CentiRpm; 2],
    /// How long everything takes.
    pub phases: Phases,
    /// A motor that turns the other way from some moment of the run on.
    pub reverse: Option<Reverse>,
}

/// A motor that turns the other way, as fast as before, from some moment of the run on.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub struct Reverse {
    /// Its number, 1 or 2.
    pub motor: u8,
    /// When, in seconds from the start of the run.
    pub after_s: f64,
}

impl Reverse {
    /// The speeds from then on, where `before` are those until then.
    pub fn of(&self, mut before: [CentiRpm; 2]) -> [CentiRpm; 2] {
        if let Some(speed) = before.get_mut(usize::from(self.motor.wrapping_sub(1))) {
            speed.0 = -speed.0;
        }
        before
    }

    /// How a log says it.
    pub fn text(&self, speeds: [CentiRpm; 2]) -> String {
        let [w1, w2] = self.of(speeds).map(CentiRpm::rpm);
        format!("motor {} reverses: from here on {w1:+} and {w2:+} rpm", self.motor)
    }
}

/// The phases of a trial in their order, seconds.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub struct Phases {
    /// Calibration of the gyroscope, at rest; 0: the bias in the board's settings is good.
    pub calibrate_s: f64,
    /// At rest before the motors turn.
    pub preroll_s: f64,
    /// At the trial's speeds.
    pub run_s: f64,
    /// Motors off.
    pub decay_s: f64,
}

impl Phases {
    /// The whole trial, seconds.
    pub fn total_s(&self) -> f64 {
        self.calibrate_s + self.preroll_s + self.run_s + self.decay_s
    }

    /// When the motors start, in seconds from the end of the calibration.
    pub fn run_start_s(&self) -> f64 {
        self.preroll_s
    }

    /// When the motors stop, in seconds from the end of the calibration.
    pub fn run_end_s(&self) -> f64 {
        self.preroll_s + self.run_s
    }
}

impl Default for Phases {
    fn default() -> Self {
        Self { calibrate_s: 5.0, preroll_s: 20.0, run_s: 120.0, decay_s: 30.0 }
    }
}

impl Plan {
    /// Reads a plan, and the robot's file that it names.
    ///
    /// # Errors
    /// [`PlanError`]: the file cannot be read, or says what cannot be.
    pub fn load(path: &Path) -> Result<Self, PlanError> {
        let text = std::fs::read_to_string(path).map_err(|source| PlanError::Read { path: path.to_owned(), source })?;
        let mut plan = Self::parse(&text, &path.display().to_string())?;
        if plan.robot.name != PUBLISHED {
            let path = path.parent().unwrap_or(Path::new("")).join(&plan.robot.name);
            plan.robot.text = std::fs::read_to_string(&path).map_err(|source| PlanError::ReadRobot { path, source })?;
        }
        Ok(plan)
    }

    /// Reads a plan from its text; `source` is what errors call it. The robot's file is not read.
    ///
    /// # Errors
    /// [`PlanError`]: the text says what cannot be.
    pub fn parse(text: &str, source: &str) -> Result<Self, PlanError> {
        file::parse(text, source)
    }

    /// How long all trials take, seconds.
    pub fn total_s(&self) -> f64 {
        self.trials.iter().map(|trial| trial.phases.total_s()).sum()
    }
}
