//! Runs trials: the [model]'s runs, and the code that the rig and the model share so that both write the same kind of
//! log.

pub mod model;
mod recorder;

pub use recorder::{AtRest, Measured, Recorder};

use crate::plan::{Phases, Plan, Trial};
use crate::program;
use biflag_log::{BoardMeta, Origin, PlanMeta, RobotMeta, Start, TrialMeta};
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
        trial: trial_meta(trial, attempt),
        robot: RobotMeta { name: plan.robot.name.clone(), text: plan.robot.text.clone() },
        board,
        sensor: plan.sensor.clone().filter(|_| origin != Origin::Model),
    }
}

/// Returns the record of a trial.
pub(crate) fn trial_meta(trial: &Trial, attempt: u32) -> TrialMeta {
    let [w1_rpm, w2_rpm] = trial.speeds.map(|speed| speed.rpm());
    let Phases { calibrate_s, preroll_s, run_s, decay_s, .. } = trial.phases;
    TrialMeta {
        name: trial.name.clone(),
        index: trial.index,
        repeat: trial.repeat,
        attempt,
        w1_rpm,
        w2_rpm,
        calibrate_s,
        preroll_s,
        run_s,
        decay_s,
        reverse_motor: trial.reverse.map(|reverse| reverse.motor),
        reverse_after_s: trial.reverse.map(|reverse| reverse.after_s),
        phase_deg: trial.phase_deg,
    }
}
