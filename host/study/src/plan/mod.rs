//! A plan: the TOML file that lists the trials of a session.
//!
//! ```
//! let plan = study::plan::Plan::parse("[speeds]\npairs = [[50, 10]]\ngrid = { w1 = [0, 90, 45], w2 = [0, 0, 1] }", "p.toml")?;
//! assert_eq!(plan.trials.len(), 4);
//! assert_eq!(plan.trials[0].name, "001_w1+50_w2+10");
//! assert_eq!(plan.trials[0].phases.run_s, 120.0);
//! # Ok::<(), study::plan::PlanError>(())
//! ```

pub mod board;
pub(crate) mod error;
pub(crate) mod expand;
pub(crate) mod file;
mod fit;
mod hand_turn;
pub mod line;
mod rest;
pub mod robot;
mod schedule;
mod shipped;
pub(crate) mod source;
pub(crate) mod units;

pub use board::BoardSettings;
pub use error::PlanError;
pub use expand::{board_speed, note_on_grid};
pub use file::{MAX_PHASE_S, MIN_RUN_S};
pub use fit::{Fit, FittedParameter, FittedTo, MAX_FACTOR, with_fit};
pub use hand_turn::{Axis, HandTurn};
pub use robot::{PHYSICAL, PUBLISHED, RobotFile};
pub use schedule::{Change, Phase, Schedule, ScheduledEvent, Setpoint, TICK_US, WAIT};
pub use shipped::{Shipped, comments, robot_keys};

use biflag_log::{MeasuredSensorMeta, Method, TrialMeta};
use protocol::units::CentiRpm;

/// An example of a plan with every table.
pub const EXAMPLE: &str = include_str!("example.toml");

/// Largest number of trials in a plan.
pub const MAX_TRIALS: usize = 10_000;

/// A plan, checked and expanded.
#[derive(Clone, PartialEq, Debug)]
pub struct Plan {
    /// `[session] name`; the name of the session's folder unless the user says otherwise.
    pub name: String,
    /// Name of the operator.
    pub operator: String,
    /// A free note.
    pub note: String,
    /// The robot.
    pub robot: RobotFile,
    /// The measured sensor: name and text of its file.
    pub sensor: Option<MeasuredSensorMeta>,
    /// Seed that shuffles the trials; `None` keeps the order of the file.
    pub seed: Option<u64>,
    /// The trials in the order in which they run.
    pub trials: Vec<Trial>,
    /// Settings to write to the board before the first trial.
    pub board: BoardSettings,
    /// How a model computes the trials.
    pub method: Method,
    /// The turn that the user makes by hand during the run.
    pub hand_turn: Option<HandTurn>,
    /// The content of the file.
    pub text: String,
}

impl Plan {
    /// Returns a plan of one trial at these speeds, named after them and `suffix`. `trial` contains the lines of its
    /// table `[trial]`.
    ///
    /// ```
    /// use protocol::units::CentiRpm;
    /// let plan = study::plan::Plan::of_speeds([50.0, -10.5].map(CentiRpm::from_rpm), "run = 60", "")?;
    /// assert_eq!((plan.name.as_str(), plan.trials.len()), ("w1+50_w2-10.5", 1));
    /// # Ok::<(), study::plan::PlanError>(())
    /// ```
    ///
    /// # Errors
    /// [`PlanError::Invalid`] if a plan cannot have these lines.
    pub fn of_speeds(speeds: [CentiRpm; 2], trial: &str, suffix: &str) -> Result<Self, PlanError> {
        let [w1, w2] = speeds.map(CentiRpm::rpm);
        let text = format!(
            "[session]\nname = \"w1{w1:+}_w2{w2:+}{suffix}\"\n\n[trial]\n{trial}\n\n[speeds]\npairs = [[{w1}, {w2}]]\n"
        );
        Self::parse(&text, "--speeds")
    }
}

/// One trial.
#[derive(Clone, PartialEq, Debug)]
pub struct Trial {
    /// Unique in the session and a valid file name, such as `001_w1+50_w2+10`, `002_w1+50_w2+10_r2` or
    /// `003_w1+90_w2+90_p3`, the third starting phase. The number is the position in the order.
    pub name: String,
    /// Position in the order, from 0.
    pub index: usize,
    /// Which repeat of the same speeds, from 1.
    pub repeat: u32,
    /// Speeds of flagella 1 and 2.
    pub speeds: [CentiRpm; 2],
    /// The duration of each phase.
    pub phases: Phases,
    /// A motor that reverses during the run.
    pub reverse: Option<Reverse>,
    /// Angles of flagella 1 and 2 from their marks at the start, degrees; `None` if the plan does not set them: models
    /// then start at zero, a rig at the present angles.
    pub phase_deg: Option<[f64; 2]>,
}

impl Trial {
    /// Returns the target speeds at the end of the run, where the steady angles are measured: after a reversal, if there is one.
    pub fn final_speeds(&self) -> [CentiRpm; 2] {
        self.reverse.map_or(self.speeds, |reverse| reverse.of(self.speeds))
    }

    /// Returns its record in a log.
    pub fn meta(&self, attempt: u32) -> TrialMeta {
        let [w1_rpm, w2_rpm] = self.speeds.map(|speed| speed.rpm());
        let Phases { calibrate_s, preroll_s, run_s, decay_s, .. } = self.phases;
        TrialMeta {
            name: self.name.clone(),
            index: self.index,
            repeat: self.repeat,
            attempt,
            w1_rpm,
            w2_rpm,
            calibrate_s,
            preroll_s,
            run_s,
            decay_s,
            reverse_motor: self.reverse.map(|reverse| reverse.motor),
            reverse_after_s: self.reverse.map(|reverse| reverse.after_s),
            phase_deg: self.phase_deg,
        }
    }

    /// Returns whether another trial differs from this one at most in its starting phase.
    pub fn is_at_the_phases_of(&self, other: &Self) -> bool {
        (self.speeds, self.repeat) == (other.speeds, other.repeat)
    }
}

/// A motor that reverses during the run, at the same speed.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Reverse {
    /// Number of the motor, 1 or 2.
    pub motor: u8,
    /// Time of the reversal, seconds from the start of the run.
    pub after_s: f64,
}

impl Reverse {
    /// Returns the speeds after the reversal, given the speeds before it.
    pub fn of(&self, mut before: [CentiRpm; 2]) -> [CentiRpm; 2] {
        if let Some(speed) = before.get_mut(usize::from(self.motor.wrapping_sub(1))) {
            speed.0 = -speed.0;
        }
        before
    }

    /// Returns the text of the event in a log.
    pub fn text(&self, speeds: [CentiRpm; 2]) -> String {
        let [w1, w2] = self.of(speeds).map(CentiRpm::rpm);
        format!("motor {} reverses: from here on {w1:+} and {w2:+} rpm", self.motor)
    }
}

/// Durations of the phases of a trial, in their order, seconds. On a rig, the trial begins with a wait until the robot is
/// still, and the decay ends when it is.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Phases {
    /// Longest wait before the calibration; 0 for none.
    pub rest_at_most_s: f64,
    /// Calibration of the gyroscope, at rest; 0 keeps the bias in the board's settings.
    pub calibrate_s: f64,
    /// At rest before the motors turn.
    pub preroll_s: f64,
    /// At the trial's speeds.
    pub run_s: f64,
    /// Motors off.
    pub decay_s: f64,
}

impl Phases {
    /// Returns the phases of a trial with only a run.
    pub fn of_run(run_s: f64) -> Self {
        Self { rest_at_most_s: 0.0, calibrate_s: 0.0, preroll_s: 0.0, run_s, decay_s: 0.0 }
    }

    /// Returns the planned duration of the trial without a wait, seconds.
    pub fn total_s(&self) -> f64 {
        self.calibrate_s + self.preroll_s + self.run_s + self.decay_s
    }
}

impl Default for Phases {
    fn default() -> Self {
        Self { rest_at_most_s: 300.0, calibrate_s: 5.0, preroll_s: 20.0, run_s: 120.0, decay_s: 30.0 }
    }
}
