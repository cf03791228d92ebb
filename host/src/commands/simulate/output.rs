//! The result of `biflag simulate`.

use super::super::answer::Outcome;
use crate::plan::{Plan, Trial};
use crate::run::model::{ModelRun, PhaseMeans};
use crate::text;
use crate::twin::Replayed;
use biflag_log::{Origin, SteadyMeta};
use protocol::units::CentiRpm;
use serde::Serialize;
use sim::contact::bundling::Bundling;
use sim::steady::Kind;
use sim::trial::quantity::{SETTLE, SIMULATED};
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Debug, Serialize)]
pub struct Simulated {
    #[serde(serialize_with = "crate::text::path")]
    pub session: PathBuf,
    /// Ratio of simulated to wall time of the whole command; `null` if all trials were already complete.
    pub real_time_factor: Option<f64>,
    pub trials: Vec<Row>,
    /// Notes that do not follow from the values.
    pub notes: Vec<String>,
}

/// Describes the end of a run since `begun`: its outcome, the ratio of simulated to wall time (`None` if nothing was simulated),
/// and the numbers of trials that were computed and that failed. `is_sound`: whether all else is sound.
pub fn ended(
    verb: &str,
    begun: Instant,
    trials: &[SimulatedTrial],
    interrupted: bool,
    is_sound: bool,
) -> (Outcome, Option<f64>, String) {
    let computed: Vec<_> = trials.iter().filter(|trial| trial.wall_s.is_some()).collect();
    let simulated_s: f64 = computed.iter().filter_map(|one| Some(one.steady.as_ref()?.values.get(&SIMULATED))).sum();
    let factor = (simulated_s > 0.0).then(|| simulated_s / begun.elapsed().as_secs_f64());
    let failed = computed.iter().filter(|trial| trial.error.is_some()).count();
    let mut text = format!("{} {verb}", text::count(computed.len() - failed, "trial"));
    if failed > 0 {
        text += &format!(", {failed} failed");
    }
    text += &factor.map_or(String::new(), |factor| format!(", {factor:.0} times real time"));
    if interrupted {
        text += "; interrupted, continue with --resume";
    }
    let is_settled = |trial: &SimulatedTrial| trial.steady.as_ref().is_none_or(|steady| steady.settled);
    let outcome = match interrupted {
        _ if trials.iter().any(|trial| trial.error.is_some()) => Outcome::Failed,
        true => Outcome::Interrupted,
        false => Outcome::of(is_sound && trials.iter().all(is_settled)),
    };
    (outcome, factor, text)
}

/// A trial, or all trials at a pair of speeds that start at different phases.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Row {
    One(SimulatedTrial),
    Mean(MeanTrial),
}

#[derive(Debug, Serialize)]
pub struct MeanTrial {
    pub origin: &'static str,
    #[serde(flatten)]
    pub means: PhaseMeans,
    /// `null` if a trial was computed by an earlier run.
    pub wall_s: Option<f64>,
    /// The trial of each starting phase.
    pub starts: Vec<SimulatedTrial>,
}

impl Row {
    /// Joins the trials of a plan with `phases`, if all starting phases of a pair of speeds were computed.
    pub fn of(plan: &Plan, trials: Vec<SimulatedTrial>) -> Vec<Self> {
        let planned = |name: &str| plan.trials.iter().find(|trial| trial.name == name);
        let mut rows = Vec::new();
        let mut rest = trials.into_iter().peekable();
        while let Some(first) = rest.next() {
            let Some(trial) = planned(&first.name) else { continue };
            let mut starts = vec![first];
            while let Some(next) =
                rest.next_if(|next| planned(&next.name).is_some_and(|next| trial.is_at_the_phases_of(next)))
            {
                starts.push(next);
            }
            let all = plan.trials.iter().filter(|other| trial.is_at_the_phases_of(other)).count();
            let steady: Vec<_> = starts.iter().filter_map(|start| start.steady.clone()).collect();
            if all > 1 && steady.len() == all {
                let wall_s = starts.iter().map(|start| start.wall_s).sum();
                let means = PhaseMeans::new(trial, &steady);
                rows.push(Self::Mean(MeanTrial { origin: Origin::Model.name(), means, wall_s, starts }));
            } else {
                rows.extend(starts.into_iter().map(Self::One));
            }
        }
        rows
    }

    pub fn mean(&self) -> Option<&PhaseMeans> {
        if let Self::Mean(mean) = self { Some(&mean.means) } else { None }
    }
}

#[derive(Debug, Serialize)]
pub struct SimulatedTrial {
    pub name: String,
    pub w1_rpm: f64,
    pub w2_rpm: f64,
    /// Starting angles of the motors; left out where the plan does not set them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase_deg: Option<[f64; 2]>,
    #[serde(serialize_with = "crate::text::path")]
    pub log: PathBuf,
    pub origin: &'static str,
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
        let (name, phase_deg, log) = (trial.name.clone(), trial.phase_deg, log.to_owned());
        let origin = Origin::Model.name();
        Self { name, w1_rpm, w2_rpm, phase_deg, log, origin, steady: None, wall_s: None, error: None }
    }
}

impl From<&ModelRun> for SimulatedTrial {
    fn from(run: &ModelRun) -> Self {
        let error = run.result.as_ref().err().map(ToString::to_string);
        let steady = run.result.as_ref().ok().cloned();
        Self { steady, wall_s: Some(run.wall_s), error, ..Self::new(&run.trial, &run.log) }
    }
}

impl From<&Replayed> for SimulatedTrial {
    fn from(replay: &Replayed) -> Self {
        let (steady, error) = (replay.result.as_ref().ok().cloned(), replay.result.as_ref().err().cloned());
        Self { steady, wall_s: replay.wall_s, error, ..Self::new(&replay.trial, &replay.log) }
    }
}

impl fmt::Display for SimulatedTrial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(error) = &self.error {
            return write!(f, "error: {error}");
        }
        write!(f, "{}", self.name)?;
        let Some(steady) = &self.steady else { return Ok(()) };
        if steady.is_overturned() {
            return write!(f, ": overturned, so it has no steady attitude{}", bundling(steady));
        }
        let (angles, uncertainties) = (steady.values.angles_deg(), steady.values.angle_uncertainties_deg());
        for (i, name) in ["yaw", "pitch", "roll"].into_iter().enumerate() {
            let uncertainty = uncertainties[i].map_or(String::new(), |deg| format!(" ± {}°", text::decimal(deg, 2)));
            write!(f, "{} {name} {}°{uncertainty}", if i == 0 { ":" } else { "," }, text::decimal(angles[i], 2))?;
        }
        match steady.kind {
            Some(Kind::Steady) => {}
            Some(Kind::Beating) => write!(f, ", beating")?,
            None if steady.settled => write!(f, ", settled after {:.0} s", steady.values.get(&SETTLE))?,
            Some(Kind::NotFound | Kind::Overturned) | None => write!(f, ", not settled")?,
        }
        if let Some(wall_s) = self.wall_s {
            write!(f, "; {:.0} times real time", steady.values.get(&SIMULATED) / wall_s)?;
        }
        write!(f, "{}", bundling(steady))
    }
}

/// Describes when the flagella came together and parted, on a line of its own; empty if they never bundled.
fn bundling(steady: &SteadyMeta) -> String {
    let changes = &steady.bundling_changes;
    if changes.iter().all(|change| change.bundling != Bundling::Bundled) {
        return String::new();
    }
    let parts = changes.iter().map(|change| format!("{} from {:.1} s", text::word(&change.bundling), change.time_s));
    format!("\n  the flagella are {}", parts.collect::<Vec<_>>().join(", "))
}
