//! Identifies the trial of a log by its content, not by its file name.
//!
//! A log belongs to the trial of the plan that its own records name. It is left out of the session, with a finding, if its plan,
//! its robot, its origin (rig, emulated board, model) or its board differs from most logs', or if it is a copy of another log. A
//! log with the name of another trial is used for the trial that it contains, with a finding; so is a log that is older than the
//! session, unless its trial has another log.

use super::{Session, SessionError, attempt_number, difference, log_names};
use crate::plan::{Plan, RobotFile};
use crate::program;
use crate::trial::{Finding, FindingKind};
use biflag_log::{
    BoardMeta, Identity, LogError, Origin, PlanMeta, Reader, RecoveryMeta, ReplayMeta, RobotMeta, TrialMeta,
};
use jiff::{SignedDuration, Timestamp};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::time::SystemTime;

/// A log may be older than its session by at most this time, because the computer's clock may have been set meanwhile.
const CLOCK_STEP: SignedDuration = SignedDuration::from_mins(10);

/// The logs of a session by their content.
#[derive(Debug, Default)]
pub(super) struct Sorted {
    /// The logs of each trial of the plan: numbers of their attempts, and names of the files.
    pub attempts: Vec<Vec<(u32, String)>>,
    /// For each trial, the excluded logs that have its name.
    pub left_out: Vec<Vec<String>>,
    /// Findings about logs, by file name.
    pub findings: BTreeMap<String, Finding>,
}

/// The identifying records of a log.
#[derive(Debug, Default)]
struct Known {
    identity: Option<Identity>,
    plan: Option<PlanMeta>,
    trial: Option<TrialMeta>,
    robot: Option<RobotMeta>,
    board: Option<BoardMeta>,
    is_recovered: bool,
    is_replay: bool,
    /// Whether the file is not a log at all.
    is_none: bool,
}

impl Known {
    /// Reads the records at the start of a log, and the one about its recovery at its end.
    fn read(log: &Path) -> Result<Self, LogError> {
        let read = || -> Result<Self, LogError> {
            let mut reader = Reader::open(log)?;
            let trial = reader.read_until::<TrialMeta>()?;
            let robot = reader.read_until::<RobotMeta>()?;
            let identity: Option<Identity> = reader.meta();
            let is_recorded = identity.as_ref().is_none_or(|identity| identity.origin.is_recorded());
            let board = if is_recorded { reader.read_until()? } else { None };
            let is_recovered = biflag_log::last_meta::<RecoveryMeta>(log)?.is_some();
            let is_replay = !is_recorded && biflag_log::last_meta::<ReplayMeta>(log)?.is_some();
            Ok(Self { plan: reader.meta(), identity, trial, robot, board, is_recovered, is_replay, is_none: false })
        };
        match read() {
            // A log that cannot be read now may still be complete.
            Err(error) if error.is_of_reading() => Err(error),
            Err(_) => Ok(Self { is_none: true, ..Self::default() }),
            known => known,
        }
    }

    fn origin(&self) -> Option<Origin> {
        Some(self.identity.as_ref()?.origin)
    }

    fn created(&self) -> Option<Timestamp> {
        self.identity.as_ref()?.created.parse().ok()
    }

    fn board_id(&self) -> Option<u16> {
        self.board.as_ref().map(|board| board.board_id).filter(|id| *id != 0)
    }

    /// Returns a key that only copies of one log share; `None` if it is not known.
    fn key(&self) -> Option<(String, String, u32, bool)> {
        let (identity, trial) = (self.identity.as_ref()?, self.trial.as_ref()?);
        Some((identity.created.clone(), trial.name.clone(), trial.attempt, self.is_recovered))
    }
}

/// Assigns logs to the trials of a session by their content.
pub(super) fn sort(session: &Session, names: &[String]) -> Result<Sorted, SessionError> {
    let (folder, plan) = (&session.folder, &session.plan);
    let known: Result<Vec<Known>, LogError> = names.par_iter().map(|name| Known::read(&folder.join(name))).collect();
    let logs: Vec<(&str, Known)> = names.iter().map(String::as_str).zip(known?).collect();
    let by_name: HashMap<&str, usize> = plan.trials.iter().map(|trial| (trial.name.as_str(), trial.index)).collect();
    let named = |name: &str| {
        name.split_once('.').and_then(|(stem, _)| by_name.get(stem).copied()).or_else(|| longest(plan, name))
    };
    let mut sorted = Sorted {
        attempts: vec![Vec::new(); plan.trials.len()],
        left_out: vec![Vec::new(); plan.trials.len()],
        findings: BTreeMap::new(),
    };
    let mut trials: Vec<Option<usize>> = logs.iter().map(|(_, known)| trial_of(plan, known)).collect();
    let mut strange = strange(session, &logs, &trials, &named);
    let mut old = Vec::new();
    for (i, (name, known)) in logs.iter().enumerate() {
        let of_name = named(name);
        if let Some((text, cure)) = strange[i].take() {
            let place = of_name.or(trials[i]).unwrap_or(0);
            sorted.findings.insert((*name).to_owned(), identity(format!("{name} {text}; it is left out"), cure));
            sorted.left_out[place].push((*name).to_owned());
            continue;
        }
        // Without a record of the trial, only the file name identifies it; a file that is not a log counts as one lost
        // attempt.
        let Some(trial) = trials[i].take().or(of_name) else { continue };
        let attempt = known.trial.as_ref().map(|trial| trial.attempt).filter(|attempt| *attempt > 0);
        let suffix = name.strip_prefix(&format!("{}.", plan.trials[trial].name));
        sorted.attempts[trial]
            .push((attempt.unwrap_or_else(|| attempt_number(suffix.unwrap_or_default())), (*name).to_owned()));
        if known.trial.is_none() && !known.is_none {
            let text = format!("{name} does not say which trial it holds: the name of its file is believed");
            sorted.findings.insert((*name).to_owned(), identity(text, "repeat the trial"));
        } else if known.trial.is_some() && of_name != Some(trial) {
            let own = &plan.trials[trial];
            let [w1, w2] = own.speeds.map(|speed| speed.rpm());
            let text = format!("{name} holds trial {} at {w1} and {w2} rpm, and is used as that", own.name);
            sorted.findings.insert((*name).to_owned(), identity(text, "give it the name of its trial"));
        } else if let Some(text) = older(session, name, known) {
            let cure = "set the clock; if the log is of another session, move it out of this one";
            sorted.findings.insert((*name).to_owned(), Finding::loss(FindingKind::Identity, text, cure));
            old.push(*name);
        }
    }
    let last = |(number, name): &(u32, String)| (!old.contains(&name.as_str()), *number, name.clone());
    sorted.attempts.iter_mut().for_each(|attempts| attempts.sort_by_key(last));
    Ok(sorted)
}

/// Why a log is left out, and what to do about it.
type Strange = Option<(String, &'static str)>;

/// Returns the logs that do not belong to the session: of another plan, origin or board than the others, or copies.
fn strange(
    session: &Session,
    logs: &[(&str, Known)],
    trials: &[Option<usize>],
    named: &dyn Fn(&str) -> Option<usize>,
) -> Vec<Strange> {
    let of_plan = |((_, known), trial): (&(&str, Known), &Option<usize>)| of_other_plan(session, known, *trial);
    let mut strange: Vec<Strange> = logs.iter().zip(trials).map(of_plan).collect();
    type Said<'a> = &'a dyn Fn(&Known, &str, u32) -> String;
    let other_origin: Said = &|known, example, _| {
        let own = crate::text::origin(known.origin().unwrap_or_default());
        format!("was {own}, other than {example} and the rest of the session")
    };
    let other_board: Said = &|known, example, most| {
        let own = known.board_id().unwrap_or_default();
        format!("was recorded with board {own}, and {example} with board {most}")
    };
    let origin: fn(&Known) -> Option<u32> = |known| known.origin().map(|origin| origin as u32);
    let board: fn(&Known) -> Option<u32> = |known| known.board_id().map(u32::from);
    for (of, text) in [(origin, other_origin), (board, other_board)] {
        let ours = (0..logs.len()).filter(|i| strange[*i].is_none() && trials[*i].is_some());
        let Some((most, example)) = most_common(ours.filter_map(|i| Some((of(&logs[i].1)?, i)))) else { continue };
        for (one, (_, known)) in strange.iter_mut().zip(logs).filter(|(one, _)| one.is_none()) {
            if of(known).is_some_and(|own| own != most) {
                *one = Some((text(known, logs[example].0, most), "move it out of the session"));
            }
        }
    }
    // Of several copies, the one named after its trial is kept.
    let mut first: HashMap<(String, String, u32, bool), usize> = HashMap::new();
    let fits = |i: usize| trials[i].is_some() && named(logs[i].0) == trials[i];
    let order = (0..logs.len()).filter(|i| fits(*i)).chain((0..logs.len()).filter(|i| !fits(*i)));
    for i in order {
        let Some(key) = logs[i].1.key().filter(|_| strange[i].is_none()) else { continue };
        match first.get(&key) {
            None => _ = first.insert(key, i),
            Some(other) => {
                strange[i] = Some((format!("is a copy of {}", logs[*other].0), "delete it, or repeat its trial"))
            }
        }
    }
    strange
}

/// Returns the value that most logs have, and the first log that has it. On a tie, recordings come before models, then the
/// first log in the folder.
fn most_common(values: impl Iterator<Item = (u32, usize)>) -> Option<(u32, usize)> {
    let mut counts: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
    values.for_each(|(value, log)| counts.entry(value).or_insert((0, log)).0 += 1);
    let best = counts.into_iter().max_by_key(|(value, (count, first))| (*count, std::cmp::Reverse((*value, *first))));
    best.map(|(value, (_, first))| (value, first))
}

fn identity(text: String, cure: &str) -> Finding {
    Finding::grave(FindingKind::Identity, text, cure)
}

/// Returns the trial whose name starts the file's name, if names contain dots.
fn longest(plan: &Plan, name: &str) -> Option<usize> {
    let fits =
        plan.trials.iter().filter(|trial| name.strip_prefix(&trial.name).is_some_and(|rest| rest.starts_with('.')));
    fits.max_by_key(|trial| trial.name.len()).map(|trial| trial.index)
}

/// Returns the trial of the plan that a log's records name.
fn trial_of(plan: &Plan, known: &Known) -> Option<usize> {
    let meta = known.trial.as_ref()?;
    let trial = plan.trials.get(meta.index)?;
    let mut planned = trial.meta(meta.attempt);
    if known.origin() == Some(Origin::Model) {
        // The log of a steady state contains one of its periods.
        let TrialMeta { calibrate_s, preroll_s, run_s, decay_s, .. } = *meta;
        planned = TrialMeta { calibrate_s, preroll_s, run_s, decay_s, ..planned };
    }
    (planned == *meta).then_some(meta.index)
}

/// Returns why a log does not belong to a session's plan, and the remedy.
fn of_other_plan(session: &Session, known: &Known, trial: Option<usize>) -> Option<(String, &'static str)> {
    let cure = "move it out of the session";
    let own = known.trial.as_ref()?;
    if trial.is_none() {
        let TrialMeta { name, w1_rpm, w2_rpm, .. } = own;
        let text = format!("holds trial {name} at {w1_rpm} and {w2_rpm} rpm of another plan than session.toml");
        return Some((text, cure));
    }
    if let Some(meta) = known.plan.as_ref().filter(|meta| meta.text != session.plan.text)
        && let Ok(plan) = Plan::parse(&meta.text, "the plan")
    {
        let plan = Plan { robot: session.plan.robot.clone(), ..plan };
        if let Some(different) = difference(&session.plan, &plan) {
            return Some((format!("is of another plan than session.toml: {different}"), cure));
        }
    }
    // A replay may have another robot than its recording.
    if !known.is_replay && known.robot.is_some() && RobotFile::of_log(known.robot.clone()) != session.plan.robot {
        return Some(("is of another robot than session.toml".to_owned(), cure));
    }
    None
}

impl Session {
    /// Returns a finding if the session began later than now: this computer's clock is behind.
    pub fn clock_behind(&self) -> Option<Finding> {
        let now = program::instant(SystemTime::now());
        let begun = self.begun_after(now)?;
        let text = format!(
            "this computer's clock is behind: it is {now:.0} by it, and the session began on {begun}, so its logs will seem older"
        );
        Some(Finding::loss(FindingKind::Identity, text, "set the clock"))
    }

    /// Returns when the session began, if that was after a time.
    fn begun_after(&self, time: Timestamp) -> Option<Timestamp> {
        self.created.parse().ok().filter(|begun: &Timestamp| begun.duration_since(time) > CLOCK_STEP)
    }
}

/// Describes a log that is older than its session. The computer's clock may have been behind.
fn older(session: &Session, name: &str, known: &Known) -> Option<String> {
    let created = known.created()?;
    let begun = session.begun_after(created)?;
    Some(format!(
        "{name} is of {created}, and the session began on {begun}: the computer's clock was wrong, or it is a log of an earlier session"
    ))
}

/// Returns the findings about a log that follow from the session in its folder.
pub(super) fn of_log(log: &Path) -> Vec<Finding> {
    let folder = biflag_log::atomic_file::folder_of(log);
    let Some(name) = log.file_name().and_then(|name| name.to_str()) else { return Vec::new() };
    // A folder that is not a session, or has unreadable logs, gives no findings about this log.
    let Ok(session) = Session::open(folder) else { return Vec::new() };
    let sorted = log_names(folder).and_then(|names| sort(&session, &names));
    sorted.map_or_else(|_| Vec::new(), |mut sorted| sorted.findings.remove(name).into_iter().collect())
}
