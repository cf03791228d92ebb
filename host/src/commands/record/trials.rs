//! The trials of a session, recorded one after another.

use super::recorded::Recorded;
use super::row::RecordedTrial;
use super::viewers::Viewers;
use crate::commands::answer::finding_line;
use crate::commands::settings;
use crate::link::Link;
use crate::plan::line::Lines;
use crate::plan::{Plan, Trial, board};
use crate::preview::Preview;
use crate::progress::Progress;
use crate::run;
use crate::run::rig::{
    self, Notes, RecordError, RigRun, RunContext, SimulatedRobot, VirtualNano, fault_log, park, preflight,
};
use crate::session::Session;
use biflag_log::{BoardMeta, Origin};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;

/// Largest number of attempts to calibrate the gyroscope for a trial. After them, a robot that still moves ends the session.
const CALIBRATIONS: usize = 3;

/// The rig on which the trials of a session are recorded.
pub(super) struct Rig<'a> {
    pub link: Link,
    pub interrupted: &'a AtomicBool,
    pub robot: Option<SimulatedRobot>,
    pub lines: Option<Lines>,
    pub typed: Notes,
    pub session: Session,
    pub plan: Plan,
    pub origin: Origin,
    pub viewers: Viewers,
}

impl Rig<'_> {
    /// Prints the findings about the plan, the session and its logs before the first trial.
    pub fn say_what_is_known(&self, knows_angles: bool, recorded: &Recorded, progress: &Progress) {
        let preview = Preview::of(&self.plan, knows_angles);
        let findings = self.session.clock_behind().into_iter().chain(preview.findings);
        findings.for_each(|finding| progress.line(&finding_line(None, &finding)));
        recorded.say_left_out(progress);
    }

    /// Records trials one after another. Returns whether nothing was lost and there are no warnings.
    pub fn record(
        &self,
        todo: &[Trial],
        mut player: Option<&mut VirtualNano>,
        recorded: &mut Recorded,
        progress: &mut Progress,
    ) -> miette::Result<bool> {
        let (mut is_lossless, mut followed) = (true, self.lines.clone());
        for (done, trial) in todo.iter().enumerate() {
            if self.interrupted.load(Ordering::Relaxed) {
                return Err(RecordError::Interrupted.into());
            }
            let (player, robot, lines) = (player.as_deref_mut(), self.robot.as_ref(), followed.as_ref());
            let context = RunContext::new(&self.link, progress, self.interrupted);
            let mut context = RunContext { player, robot, lines, typed: Notes::clone(&self.typed), ..context };
            let rest_s = todo[done..].iter().map(|trial| trial.phases.total_s()).sum();
            check_trial(&context, &recorded.session, rest_s)?;
            park_for(&context, trial)?;
            self.viewers.session(&recorded.trials, Some(trial));
            let (path, run) = self.trial(&mut context, trial)?;
            progress.end_trial(trial.phases.total_s());
            let mut row = RecordedTrial::of_run(trial, path, &run, self.origin);
            if let (Some(turn), Some(angles)) = (self.plan.hand_turn, &row.angles) {
                let (verdict, agrees) = turn.verdict(angles.turned_deg);
                row.hand_turn = Some(verdict);
                if !agrees {
                    row.warnings.push("the sensor did not measure the turn made by hand".to_owned());
                }
            }
            progress.line(&row.to_string());
            let turned_rpm = row.angles.as_ref().and_then(|angles| angles.measured.rpm());
            if let (Some(lines), Some(turned_rpm)) = (&mut followed, turned_rpm) {
                lines.follow(trial.speeds, turned_rpm);
            }
            is_lossless &= run.summary.link.is_lossless() && row.warnings.is_empty();
            recorded.trials.push(row);
            self.viewers.session(&recorded.trials, None);
            if let Some(error) = run.error {
                return Err(error.into());
            }
        }
        Ok(is_lossless)
    }

    /// Runs a trial and writes its log. A robot that moves during the calibration has two more attempts to come to rest,
    /// because a session of many hours should not end with one push of the table. Each attempt has a log and a line.
    fn trial(&self, context: &mut RunContext, trial: &Trial) -> miette::Result<(PathBuf, RigRun)> {
        let mut calibrations = 1;
        loop {
            context.tap = self.viewers.tap(trial);
            let (path, mut run) = self.attempt(context, trial)?;
            let refused = match &run.error {
                Some(RecordError::Preflight(refused)) if refused.may_pass_at_rest() => refused.to_string(),
                _ => return Ok((path, run)),
            };
            if calibrations == CALIBRATIONS {
                return Ok((path, run));
            }
            if context.interrupted.load(Ordering::Relaxed) {
                run.error = Some(RecordError::Interrupted);
                return Ok((path, run));
            }
            calibrations += 1;
            context.progress.line(&RecordedTrial::of_run(trial, path, &run, self.origin).to_string());
            context.progress.line(&format!("{}: {refused}; calibration {calibrations} begins", trial.name));
        }
    }

    /// Runs a trial once.
    fn attempt(&self, context: &mut RunContext, trial: &Trial) -> miette::Result<(PathBuf, RigRun)> {
        let (attempt, path) = self.session.next_attempt(trial)?;
        // A calibration changes the board's settings, so each log contains those at its start.
        let settings = settings::read(context.link)?;
        let faults = fault_log::read(context.link)?.iter().map(fault_log::to_log).collect();
        // The positions of the shafts are read now.
        let board = BoardMeta { faults, ..board::to_log(&park::info(context.link)?, &settings) };
        let start = run::start(&self.plan, trial, attempt, self.origin, Some(board), SystemTime::now());
        let run = rig::run(context, &path, &start, trial, settings)?;
        Ok((path, run))
    }
}

/// Checks disk and board before a trial. `rest_s` is the duration of the remaining trials.
pub(in crate::commands) fn check_trial(context: &RunContext, folder: &Path, rest_s: f64) -> Result<(), RecordError> {
    preflight::room(folder, rest_s, context.robot.is_some())?;
    preflight::supply(context.link, context.interrupted)
}

/// Turns the flagella to the starting angles of a trial, if it has some.
fn park_for(context: &RunContext, trial: &Trial) -> Result<(), RecordError> {
    let Some(angles_deg) = trial.phase_deg else { return Ok(()) };
    context.progress.phase(&trial.name, "to its starting angles");
    park::park(context.link, angles_deg, trial.speeds, &settings::read(context.link)?, context.interrupted)
}
