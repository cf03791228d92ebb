//! The model's side of a session: the trials of a plan in the simulator, written to the same logs as those of the rig.
//!
//! A log of a modelled trial appears in its session when it is whole. Until then it bears another name, so that a killed
//! run leaves nothing that could be taken for a trial, and whoever goes on begins that trial anew. What is in it depends
//! on plan, robot and program alone: trials share nothing while they run, and no log knows of a clock (see
//! [`crate::log`]). Processors of different kinds may differ in the last digits.

mod batch;
mod board;
mod bundling;
mod error;
pub(crate) mod messages;
pub(crate) mod shapes;
mod trial;

pub use batch::{Batch, Job, TrialRun};
pub use bundling::BundlingChange;
pub use error::ModelError;
pub use trial::{Course, Turn, Watch};

use crate::log::ModelMeta;
use crate::plan::Plan;
use protocol::Settings;
use protocol::units::AxisMap;
use sim::params::Robot;
use sim::robot::closure::Closure;
use sim::trial::Options;

/// What trials are computed with.
#[derive(Clone, Debug)]
pub struct Model {
    /// The robot, checked.
    pub robot: Robot,
    /// How the flagella act on the base.
    pub closure: Closure,
    /// Rate and shapes.
    pub options: Options,
    /// Settings of the board that is in the robot.
    settings: Settings,
    meta: ModelMeta,
}

impl Model {
    /// The model of a plan's robot.
    ///
    /// Its board has the settings that the plan writes, but its sensor is ideal: it sits along the body's axes and has no
    /// bias.
    ///
    /// # Errors
    /// [`crate::plan::PlanError`], and [`crate::plan::board::BoardSettingsError`].
    pub fn of_plan(plan: &Plan, closure: Closure, options: Options) -> miette::Result<Self> {
        let robot = plan.robot.parse()?;
        Ok(Self::new(robot, plan.board.apply(Settings::DEFAULT)?, closure, options))
    }

    /// The model of a robot, checked, whose board has these settings but for the sensor's place and bias.
    pub fn new(robot: Robot, board: Settings, closure: Closure, options: Options) -> Self {
        // Numbers, flags, names and short lists all have a form in TOML.
        let parameters = toml::to_string(&robot).unwrap_or_default();
        let ideal = AxisMap::IDENTITY;
        let settings = Settings { gyro_axes: ideal, accel_axes: ideal, gyro_bias: [0.0; 3], ..board };
        let meta = ModelMeta { closure, rate_hz: options.rate_hz, shapes: options.shapes, parameters };
        Self { robot, closure, options, settings, meta }
    }

    /// What stands of it in every log.
    pub fn meta(&self) -> &ModelMeta {
        &self.meta
    }
}
