//! Steers the robot on the rig, or on the emulated board.

use super::super::{board_sensor, record, settings, virtual_board};
use super::Args;
use super::course::Expected;
use super::output::Ran;
use crate::link::Link;
use crate::plan::{Plan, board};
use crate::progress::Progress;
use crate::run;
use crate::run::rig::{self, RecordError, RunContext, SimulatedRobot, VirtualNano, fault_log};
use crate::session::{Session, Sharing};
use biflag_log::{BoardMeta, Origin, SteerMeta};
use miette::{Diagnostic, Report};
use protocol::Command;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::SystemTime;
use study::sensor::Sensor;
use study::steer::{Steering, Wanted, yaw_error};

/// Steers a board. Returns the log.
///
/// # Errors
/// Failures before the run; a failure in the run is part of the result.
pub fn steer(
    args: &Args,
    plan: &Plan,
    folder: &Path,
    (steering, meta): (&mut Steering, &SteerMeta),
    expected: &Expected,
    interrupted: &AtomicBool,
) -> miette::Result<(PathBuf, Ran)> {
    let nano = if args.r#virtual { Some(start_virtual(args, plan)?) } else { None };
    let port = virtual_board::port(nano.as_ref(), args.port.as_deref())?;
    let robot = nano.map(|nano| SimulatedRobot::new(nano, plan, args.sensor.seed(None))).transpose()?;
    let link = match &robot {
        Some(robot) if args.lock_step => robot.lock_step()?,
        _ => Link::open_unless(&port, interrupted)?,
    };
    if robot.is_none() {
        record::check_settings(&link)?;
    }
    link.command(Command::Stop)?;
    let mut plan = plan.clone();
    settings::need_encoders(&settings::read(&link)?)?;
    let note_of_sensor = board_sensor::complete(&mut plan, &link)?;
    let plan = &plan;
    let session = Session::create(folder, plan)?;
    let _lock = session.lock(Sharing::Alone)?;
    let trial = &plan.trials[0];
    let (attempt, path) = session.next_attempt(trial)?;
    let settings = settings::read(&link)?;
    let faults = fault_log::read(&link)?.iter().map(fault_log::to_log).collect();
    let board = BoardMeta { faults, ..board::to_log(link.info(), &settings) };
    let origin = if robot.is_some() { Origin::VirtualRig } else { Origin::Rig };
    let start = run::start(plan, trial, attempt, origin, Some(board), SystemTime::now());

    let mut progress = Progress::new(trial.phases.total_s());
    let Wanted { yaw_deg, pitch_deg } = steering.wanted;
    progress.line(&format!("to hold: yaw {yaw_deg}°, pitch {pitch_deg}°, for {} s", trial.phases.run_s));
    let (rest_s, run_s) = (trial.phases.preroll_s.max(1.0), trial.phases.run_s);
    let notes = note_of_sensor.into_iter().chain(expected.note());
    notes.for_each(|note| progress.line(&format!("note: {note}")));
    let error = yaw_error(&Sensor::of(plan.sensor.as_ref()), [yaw_deg, expected.tilt_deg], rest_s, run_s);
    progress.line(&format!(
        "the yaw comes from the gyroscope: after {run_s} s it may be off by {error}; rest alone shows its drift"
    ));
    let mut context = RunContext { robot: robot.as_ref(), ..RunContext::new(&link, &progress, interrupted) };
    record::check_trial(&context, folder, trial.phases.total_s())?;
    let steered = rig::steer(&mut context, &path, &start, trial, settings, (steering, meta))?;
    progress.end_trial(trial.phases.total_s());
    progress.ring();
    progress.finish();
    let interrupted = matches!(steered.run.error, Some(RecordError::Interrupted));
    let error = steered.run.error.filter(|_| !interrupted).map(report);
    Ok((path, Ran { tally: steered.tally, notes: steered.run.notes, error, interrupted }))
}

fn start_virtual(args: &Args, plan: &Plan) -> miette::Result<VirtualNano> {
    let speed = if args.lock_step { "exchange" } else { &args.speed };
    let mut arguments = vec!["--speed".into(), speed.into()];
    arguments.extend(args.sensor.arguments(None));
    let (robot, _file) = virtual_board::robot(&plan.robot)?;
    arguments.extend(["--robot".into(), robot]);
    virtual_board::start(arguments, &args.faults)
}

/// Returns an error without the advice to resume a session, because a steered run begins anew.
fn report(error: RecordError) -> Report {
    let help = error.help().map(|help| help.to_string()).unwrap_or_default();
    match help.strip_suffix("; then continue with --resume") {
        Some(help) => miette::miette!(help = help.to_owned(), "{error}"),
        None => error.into(),
    }
}
