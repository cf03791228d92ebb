//! Computes one point: its steady state, averaged over the starting phases, or the reason for its failure.

use super::SweepPlan;
use super::point::{Name, Point, phases};
use crate::program;
use serde::{Deserialize, Serialize};
use sim::body::closure::Closure;
use sim::steady::{Kind, Phases, Problem, SolveError, SteadyState, phase};
use sim::step::InversesAtRest;
use sim::trial::quantity::{FLAGELLA, Values, columns};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The steady state of a point over its starting phases.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct Steady {
    /// The kind of the least steady phase.
    pub kind: Kind,
    /// Number of starting phases.
    pub phases: u32,
    /// The quantities, in the order of [`sim::trial::quantity::columns`].
    pub values: Vec<f64>,
    /// Largest minus smallest value of each over the phases.
    pub spreads: Vec<f64>,
    /// Standard error of each.
    pub standard_errors: Vec<Option<f64>>,
}

/// The result of a point: its steady state, or why it cannot be computed.
pub type Outcome = Result<Box<Steady>, String>;

/// The beginning of the reason after a panic.
const PANIC: &str = "the solver panicked, which is a fault of the program";

/// Longest stored reason, bytes.
const LONGEST_REASON: usize = 400;

/// Returns whether the solver panicked.
pub fn is_panic(outcome: &Outcome) -> bool {
    outcome.as_ref().is_err_and(|reason| reason.starts_with(PANIC))
}

/// Returns the outcome of a failure.
pub fn failed(reason: &str) -> Outcome {
    let end = reason.floor_char_boundary(LONGEST_REASON);
    Err(reason[..end].replace(['\n', '\r', '\t'], " "))
}

/// Computes a point of a plan, and returns its result with the number of the solver's sweeps. Returns `None` as
/// soon as `goes_on` returns `false`. `at_rest`: inverses shared by the points of a table.
///
/// A panic of the solver is caught, so that other points are still computed; the reason names it.
pub fn compute(
    point: &Point,
    plan: &SweepPlan,
    at_rest: &InversesAtRest,
    goes_on: &dyn Fn() -> bool,
) -> Option<(Outcome, u64)> {
    let caught = catch_unwind(AssertUnwindSafe(|| steady(point, plan, at_rest, goes_on)));
    let reason = match caught {
        Ok(Ok(steady)) => return steady.map(|(steady, sweeps)| (Ok(Box::new(steady)), sweeps)),
        Ok(Err(reason)) => reason,
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
            format!("{PANIC}: {text}")
        }
    };
    Some((failed(&reason), 0))
}

fn steady(
    point: &Point,
    plan: &SweepPlan,
    at_rest: &InversesAtRest,
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<(Steady, u64)>, String> {
    let robot = point.robot.as_ref().map_err(String::clone)?;
    robot.validate().map_err(|error| error.to_string())?;
    let rpm = point.speeds_rpm;
    let starts = phase::starts(rpm, phases(plan, rpm));
    let mut states = Vec::new();
    for start in &starts {
        let start_rad = start.map(f64::to_radians);
        let at_rest = Some(at_rest);
        let problem =
            Problem { robot, closure: Closure::Full, rpm, start_rad, longest_s: plan.run_s, output: None, at_rest };
        let state = SteadyState::by(plan.method, &problem, &|_| goes_on());
        match state {
            Ok(state) => states.push(state),
            Err(SolveError::Interrupted) => return Ok(None),
            Err(error) if starts.len() == 1 => return Err(error.to_string()),
            Err(error) => return Err(format!("starting at {} and {} degrees: {error}", start[0], start[1])),
        }
    }
    let phases = Phases::new(states);
    let steady = phases.map(|phases| (Steady::of(&phases), phases.sweeps())).filter(|(steady, _)| steady.is_finite());
    steady.map(Some).ok_or_else(|| "the steady state is not a finite number".to_owned())
}

impl Steady {
    fn of(phases: &Phases) -> Self {
        let all = phases.values();
        let values = Values::over_phases(&all);
        // NaN has the same bits on every processor.
        let of = |value: &f64| if value.is_nan() { f64::NAN } else { *value };
        Self {
            kind: phases.kind(),
            phases: phases.count() as u32,
            values: values.numbers.iter().map(of).collect(),
            spreads: Values::spreads(&all),
            standard_errors: values.errors.to_vec(),
        }
    }

    /// Returns whether every quantity has its value, its spread and its error.
    pub fn is_whole(&self) -> bool {
        let columns = columns(FLAGELLA).count();
        [self.values.len(), self.spreads.len(), self.standard_errors.len()] == [columns; 3]
    }

    /// Returns whether all values are numbers, but for the angles of a robot that overturned.
    fn is_finite(&self) -> bool {
        let is_overturned = self.kind == Kind::Overturned;
        self.values.iter().chain(&self.spreads).all(|v| v.is_finite() || is_overturned && v.is_nan())
    }
}

/// The result of a point.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct Record {
    /// Its index in the plan.
    pub index: u64,
    /// Its name.
    pub name: Name,
    /// Its result.
    pub outcome: Outcome,
    /// Its cost.
    pub cost: Cost,
}

/// The cost of a point. It is not part of the result.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub struct Cost {
    /// Processor time, s.
    pub processor_s: f64,
    /// Sweeps of the solver over all starting phases, including unsuccessful searches; 0 for a failed point.
    pub sweeps: u64,
}

/// The computer and the program that computed points.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Hash, Debug, Default)]
pub struct Origin {
    /// Name of the computer.
    pub host: String,
    /// Version and commit of the program.
    pub program: String,
}

impl Origin {
    /// Returns the origin of points computed by this program.
    pub fn here() -> Self {
        Self { host: system::network::name(), program: format!("{} {}", program::VERSION, program::GIT_HASH) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use biflag_log::Method;

    #[test]
    fn a_panic_is_the_reason_of_its_point_alone() {
        let text = "[trial]\nrun = 1\n[speeds]\npairs = [[50, 10]]";
        let plan = SweepPlan::parse(text, "plan.toml", &|name| Ok(crate::plan::RobotFile::built_in(name))).unwrap();
        let point = crate::sweep::Sweep::new(plan.clone(), 1).unwrap().point(0);
        let at_rest = InversesAtRest::default();
        for method in [Method::Steady, Method::Trial] {
            let plan = SweepPlan { method, ..plan.clone() };
            let (outcome, _) = compute(&point, &plan, &at_rest, &|| panic!("index {}", 7)).unwrap();
            let wanted = "the solver panicked, which is a fault of the program: index 7";
            assert!(is_panic(&outcome));
            assert_eq!(outcome, Err(wanted.to_owned()));
            assert_eq!(compute(&point, &plan, &at_rest, &|| false), None, "interrupted");
            let (outcome, sweeps) = compute(&point, &plan, &at_rest, &|| true).unwrap();
            assert!(
                outcome.as_ref().is_ok_and(|steady| steady.is_finite()) && sweeps > 10,
                "{outcome:?}, {sweeps} sweeps"
            );
        }
    }

    #[test]
    fn reasons_are_one_short_line() {
        let Err(reason) = failed(&"ä\n".repeat(400)) else { panic!() };
        assert!(reason.len() <= LONGEST_REASON && reason.starts_with("ä ä"));
    }
}
