//! Computes one point: its steady state, averaged over the starting phases, or the reason of its failure.

use super::SweepPlan;
use super::point::Point;
use biflag_log::Method;
use serde::{Deserialize, Serialize};
use sim::body::closure::Closure;
use sim::periodic::{self, Kind, Problem, SolveError};
use sim::phase::{self, Ratio};
use sim::profile::{Phases, SpeedProfile};
use sim::trial::{Options, Summary, Trial};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The steady state of a point: means over its starting phases.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct Steady {
    /// The least steady kind of all phases.
    pub kind: Kind,
    /// Number of starting phases.
    pub phases: u32,
    /// Yaw, pitch, roll and tilt, degrees.
    pub angles_deg: [f64; 4],
    /// Largest minus smallest value of each over the phases.
    pub spread_deg: [f64; 4],
    /// Force of flagellum 1 and 2 on the base, body axes, N; z is the thrust.
    pub force_n: [[f64; 3]; 2],
    /// Reaction torques on the base about the shafts, N m.
    pub torque_nm: [f64; 2],
    /// Share of the run with contact.
    pub contact_share: f64,
    /// Smallest gap between the surfaces, negative if they overlap, m.
    pub min_gap_m: f64,
}

/// The result of a point.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub enum Outcome {
    /// It was computed.
    Ok(Steady),
    /// It cannot be computed, for this reason.
    Failed(String),
}

/// Longest reason that is kept, bytes.
const LONGEST_REASON: usize = 400;

impl Outcome {
    /// Returns the steady state; `None` if the point cannot be computed.
    pub fn steady(&self) -> Option<&Steady> {
        match self {
            Self::Ok(steady) => Some(steady),
            Self::Failed(_) => None,
        }
    }

    /// Returns whether the point cannot be computed.
    pub fn is_failed(&self) -> bool {
        self.steady().is_none()
    }

    /// Returns the outcome of a failure.
    pub fn failed(reason: &str) -> Self {
        let end = reason.floor_char_boundary(LONGEST_REASON);
        Self::Failed(reason[..end].replace(['\n', '\r', '\t'], " "))
    }

    /// Computes a point as a plan says. Returns `None` as soon as `goes_on` returns `false`.
    ///
    /// A panic of the solver is caught, so that other points are still computed; the reason names it.
    pub fn of(point: &Point, plan: &SweepPlan, goes_on: &dyn Fn() -> bool) -> Option<Self> {
        let caught = catch_unwind(AssertUnwindSafe(|| compute(point, plan, goes_on)));
        match caught {
            Ok(Ok(steady)) => steady.map(Self::Ok),
            Ok(Err(reason)) => Some(Self::failed(&reason)),
            Err(panic) => {
                let text = panic.downcast_ref::<String>().map(String::as_str);
                let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
                Some(Self::failed(&format!("the solver panicked, which is a fault of the program: {text}")))
            }
        }
    }
}

fn compute(point: &Point, plan: &SweepPlan, goes_on: &dyn Fn() -> bool) -> Result<Option<Steady>, String> {
    let robot = point.robot.as_ref().map_err(String::clone)?;
    robot.validate().map_err(|error| error.to_string())?;
    let rpm = point.speeds_rpm;
    let starts = phase::starts(rpm, if Ratio::of(rpm).is_some() { plan.phases } else { 1 });
    let mut states = Vec::new();
    for start in &starts {
        let start_rad = start.map(f64::to_radians);
        let problem = Problem { robot, closure: Closure::Full, rpm, start_rad, longest_s: plan.run_s, output: None };
        let state = match plan.method {
            Method::Steady => solved(&problem, goes_on),
            Method::Trial => tried(&problem, goes_on),
        };
        match state {
            Ok(state) => states.push(state),
            Err(SolveError::Interrupted) => return Ok(None),
            Err(error) if starts.len() == 1 => return Err(error.to_string()),
            Err(error) => return Err(format!("starting at {} and {} degrees: {error}", start[0], start[1])),
        }
    }
    let steady = mean(&states);
    if !steady.is_finite() {
        return Err("the steady state is not a finite number".to_owned());
    }
    Ok(Some(steady))
}

/// Solves for the steady state.
fn solved(problem: &Problem, goes_on: &dyn Fn() -> bool) -> Result<Steady, SolveError> {
    let found = periodic::solve(problem, &|_| goes_on())?;
    Ok(Steady::new(found.kind, &found.summary))
}

/// Runs a trial from rest to its end, as long as a solution would take at most.
fn tried(problem: &Problem, goes_on: &dyn Fn() -> bool) -> Result<Steady, SolveError> {
    let phases = Phases { run: problem.longest_s, ..Phases::default() };
    let profile = SpeedProfile::phases(&phases, problem.rpm)?.from_angles(problem.start_rad);
    // The steady state needs no samples; a few a second are enough to ask whether to go on.
    let options = Options { rate_hz: 2.0, shapes: false };
    let mut trial = Trial::new(problem.robot, problem.closure, profile, options)?;
    for sample in trial.by_ref() {
        sample?;
        if !goes_on() {
            return Err(SolveError::Interrupted);
        }
    }
    // The last sample may be before the end.
    let summary = trial.finish()?;
    Ok(Steady::new(Kind::of_trial(summary.steady.settled), &summary))
}

impl Steady {
    fn new(kind: Kind, summary: &Summary) -> Self {
        let steady = &summary.steady;
        let [yaw, pitch, roll] = steady.attitude.map(|level| level.mean);
        let tilt = (pitch.cos() * roll.cos()).clamp(-1.0, 1.0).acos();
        Self {
            kind,
            phases: 1,
            angles_deg: [yaw, pitch, roll, tilt].map(f64::to_degrees),
            spread_deg: [0.0; 4],
            force_n: steady.force.map(|force| force.map(|level| level.mean)),
            torque_nm: steady.axial_torque.map(|level| level.mean),
            contact_share: summary.contact_share,
            min_gap_m: summary.min_gap_m,
        }
    }

    fn is_finite(&self) -> bool {
        let more = [self.contact_share, self.min_gap_m];
        let forces = self.force_n.as_flattened();
        [&self.angles_deg[..], &self.spread_deg, forces, &self.torque_nm, &more]
            .into_iter()
            .flatten()
            .all(|v| v.is_finite())
    }
}

/// Returns the means over the starting phases, of which there is at least one. The gap is the smallest of all, the kind
/// that of the least steady phase.
fn mean(states: &[Steady]) -> Steady {
    let mean = |value: &dyn Fn(&Steady) -> f64| states.iter().map(value).sum::<f64>() / states.len() as f64;
    let spread = |value: &dyn Fn(&Steady) -> f64| {
        let values = || states.iter().map(value);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    Steady {
        kind: states.iter().map(|state| state.kind).max().unwrap_or(Kind::NotFound),
        phases: states.len() as u32,
        angles_deg: [0, 1, 2, 3].map(|i| mean(&|state| state.angles_deg[i])),
        spread_deg: [0, 1, 2, 3].map(|i| spread(&|state| state.angles_deg[i])),
        force_n: [0, 1].map(|k| [0, 1, 2].map(|i| mean(&|state| state.force_n[k][i]))),
        torque_nm: [0, 1].map(|k| mean(&|state| state.torque_nm[k])),
        contact_share: mean(&|state| state.contact_share),
        min_gap_m: states.iter().map(|state| state.min_gap_m).fold(f64::INFINITY, f64::min),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(kind: Kind, yaw: f64, gap: f64) -> Steady {
        Steady {
            kind,
            phases: 1,
            angles_deg: [yaw, 1.0, 2.0, 3.0],
            spread_deg: [0.0; 4],
            force_n: [[1.0; 3]; 2],
            torque_nm: [0.5; 2],
            contact_share: 0.25,
            min_gap_m: gap,
        }
    }

    #[test]
    fn phases_are_averaged() {
        let mean = mean(&[state(Kind::NotFound, 10.0, 1e-3), state(Kind::Steady, 16.0, -1e-4)]);
        assert_eq!((mean.kind, mean.phases), (Kind::NotFound, 2));
        assert_eq!((mean.angles_deg, mean.spread_deg), ([13.0, 1.0, 2.0, 3.0], [6.0, 0.0, 0.0, 0.0]));
        assert_eq!((mean.contact_share, mean.min_gap_m), (0.25, -1e-4));
        let nan = state(Kind::Steady, f64::NAN, 1.0);
        assert!(mean.is_finite() && !nan.is_finite());
    }

    #[test]
    fn a_panic_is_the_reason_of_its_point_alone() {
        let text = "[trial]\nrun = 1\n[speeds]\npairs = [[50, 10]]";
        let plan = SweepPlan::parse(text, "plan.toml", &|name| Ok(crate::plan::RobotFile::built_in(name))).unwrap();
        let point = crate::sweep::Sweep::new(plan.clone(), String::new()).unwrap().point(0);
        for method in [Method::Steady, Method::Trial] {
            let plan = SweepPlan { method, ..plan.clone() };
            let outcome = Outcome::of(&point, &plan, &|| panic!("index {}", 7)).unwrap();
            let wanted = "the solver panicked, which is a fault of the program: index 7";
            assert_eq!(outcome, Outcome::Failed(wanted.to_owned()));
            assert_eq!(Outcome::of(&point, &plan, &|| false), None, "interrupted");
            assert!(matches!(Outcome::of(&point, &plan, &|| true), Some(Outcome::Ok(steady)) if steady.is_finite()));
        }
    }

    #[test]
    fn reasons_are_one_short_line() {
        let Outcome::Failed(reason) = Outcome::failed(&"ä\n".repeat(400)) else { panic!() };
        assert!(reason.len() <= LONGEST_REASON && reason.starts_with("ä ä"));
    }
}
