//! Runs trials: the [model]'s runs, and the code that the rig and the model share so that both write the same kind of
//! log.

pub mod model;
mod recorder;

pub use recorder::{AtRest, Measured, Recorder};

use crate::plan::{Plan, Trial};
use crate::program;
use biflag_log::{BoardMeta, Origin, PlanMeta, RobotMeta, Start};
use std::time::SystemTime;

/// Returns the first records of the log of a trial.
pub fn start(
    plan: &Plan,
    trial: &Trial,
    attempt: u32,
    origin: Origin,
    board: Option<BoardMeta>,
    time: SystemTime,
) -> Start {
    Start {
        identity: program::identity(origin, time),
        plan: PlanMeta {
            name: plan.name.clone(),
            operator: plan.operator.clone(),
            note: plan.note.clone(),
            trials: plan.trials.len(),
            text: plan.text.clone(),
        },
        trial: trial.meta(attempt),
        robot: RobotMeta { name: plan.robot.name.clone(), text: plan.robot.text.clone() },
        board,
        sensor: plan.sensor.clone().filter(|_| origin != Origin::Model),
    }
}
