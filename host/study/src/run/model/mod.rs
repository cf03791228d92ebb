//! Runs trials in the simulator, and writes the same logs as the rig.
//!
//! The log of a modelled trial gets its name when it is complete. Until then it has a temporary name, so a killed run leaves no
//! incomplete log, and a resumed session computes the trial again. Its content depends only on plan, robot, options and program:
//! trials share nothing that changes a result, and no log contains the host's clock (see [`biflag_log`]). Results have the same
//! bits on every processor.

mod batch;
mod board;
mod error;
mod log;
mod motion;
mod motors;
mod phases;
mod steered;
mod trial;

pub(crate) use batch::pool;
pub use batch::{Batch, Job, ModelRun};
pub use error::ModelError;
pub use motion::Motion;
pub use motors::{MOTOR_S, Motors};
pub use phases::{PhaseMeans, has_phases, note_on_phases, note_on_unknown_angles};
pub use steered::{DELAY_S, Steered, SteeredError, steer};
pub use trial::{Course, write_log};

use crate::plan::Plan;
use biflag_log::{Method, ModelMeta};
use protocol::Settings;
use protocol::units::AxisMap;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::step::InversesAtRest;
use sim::trial::Options;

/// The robot, the closure and the board of modelled trials.
#[derive(Clone, Debug)]
pub struct Model {
    /// The robot, checked.
    pub robot: Robot,
    /// The closure: how the flagella act on the base.
    pub closure: Closure,
    /// Rate and shapes.
    pub options: Options,
    /// Settings of the robot's board.
    settings: Settings,
    meta: ModelMeta,
    /// Inverses shared by its trials.
    at_rest: InversesAtRest,
}

impl Model {
    /// Creates the model of a plan's robot.
    ///
    /// Its board has the settings of the plan, but its sensor is ideal: it is aligned with the body's axes and has no
    /// bias.
    ///
    /// # Errors
    /// [`crate::plan::PlanError`], and [`crate::plan::board::BoardSettingsError`].
    pub fn of_plan(plan: &Plan, closure: Closure, options: Options) -> miette::Result<Self> {
        let robot = plan.robot.parse()?;
        Ok(Self::new(robot, plan.board.apply(Settings::DEFAULT)?, closure, plan.method, options))
    }

    /// Creates the model of a checked robot. Its board has these settings, except for the sensor's axes and bias.
    pub fn new(robot: Robot, board: Settings, closure: Closure, method: Method, options: Options) -> Self {
        // Numbers, flags, names and short lists all have a form in TOML.
        let parameters = toml::to_string(&robot).unwrap_or_default();
        let ideal = AxisMap::IDENTITY;
        let settings = Settings { gyro_axes: ideal, accel_axes: ideal, gyro_bias: [0.0; 3], ..board };
        let meta = ModelMeta { closure, method, rate_hz: options.rate_hz, shapes: options.shapes, parameters };
        Self { robot, closure, options, settings, meta, at_rest: InversesAtRest::default() }
    }

    /// Returns the model's metadata record.
    pub fn meta(&self) -> &ModelMeta {
        &self.meta
    }
}
