//! A sweep's plan: the TOML file that defines what varies, and how each point is computed.
//!
//! A plan for trials is a sweep over its speeds. Of its trial's phases, only the run affects the steady state; the
//! others have no effect.
//!
//! ```
//! let plan = study::sweep::SweepPlan::parse(
//!     "[vary]\n\"group.stiffness\" = [0.5, 1, 2]\n[speeds]\npairs = [[50, 10], [0, 45]]",
//!     "plan.toml",
//!     &|name| Ok(study::plan::RobotFile::built_in(name)),
//! )?;
//! assert_eq!(plan.points(), 6);
//! # Ok::<(), study::plan::PlanError>(())
//! ```

use super::axis::Axis;
use super::design::{Design, MAX_POINTS};
use super::key::Key;
use super::vary::{DESIGN, VALUES, vary};
use crate::plan::expand::{SpeedsTable, pairs};
use crate::plan::file::{self, SessionTable, TrialTable, count_of_phases};
use crate::plan::source::{FileKind, Source, number};
use crate::plan::{BoardSettings, MAX_PHASE_S, MIN_RUN_S, PHYSICAL, PlanError, RobotFile, robot};
use biflag_log::Method;
use protocol::units::CentiRpm;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use toml::{Spanned, Value};

/// An example of a plan.
pub const EXAMPLE: &str = include_str!("example.toml");

/// A sweep's plan, checked.
#[derive(Clone, PartialEq, Debug)]
pub struct SweepPlan {
    /// `[session] name`; the name of the sweep's folder unless the user says otherwise.
    pub name: String,
    /// The robot that varies.
    pub robot: RobotFile,
    /// Duration of a trial, s; with the method `steady`, the longest simulation if no repeating motion is found.
    pub run_s: f64,
    /// How each point is computed.
    pub method: Method,
    /// Number of starting phases at speeds where they matter.
    pub phases: usize,
    /// Pairs of speeds at which every robot runs, rpm; empty if the axes contain the speeds.
    pub speeds_rpm: Vec<[f64; 2]>,
    /// The axes, in alphabetical order.
    pub axes: Vec<Axis>,
    /// How the values of the axes are combined.
    pub design: Design,
    /// The content of the file.
    pub text: String,
}

const KIND: FileKind = FileKind {
    noun: "plan",
    example: "`biflag sweep --help` shows one",
    tables: &["session", "trial", "speeds", "board", "vary", "grid"],
    help,
};

fn help(key: &str) -> Option<&'static str> {
    Some(match key {
        "method" => "give \"steady\" or \"trial\"",
        "phases" => "give a whole number from 1 to 360: at how many starting phases a point runs where they matter",
        "run" => "give seconds as a plain number, such as run = 120",
        "vary" => "write it as a table: [vary]",
        "design" => DESIGN,
        "sobol" => "give the number of robots as a whole number from 1 to 10000000",
        "from" | "to" | "count" | "scale" => VALUES,
        _ => return (file::KIND.help)(key),
    })
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SweepFile {
    #[serde(default)]
    session: SessionTable,
    #[serde(default)]
    trial: TrialTable,
    speeds: Option<Spanned<SpeedsTable>>,
    #[serde(default)]
    vary: BTreeMap<String, Spanned<Value>>,
    #[serde(default, rename = "board")]
    _board: BoardSettings,
}

impl SweepPlan {
    /// Reads and checks a plan and the robot file that it names.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn load(path: &Path) -> Result<Self, PlanError> {
        let text = KIND.read(path)?;
        Self::parse(&text, &path.display().to_string(), &|name| robot::of_plan(path, name))
    }

    /// Reads a plan from its text; errors call the file `name`. `robot` returns the robot for a name in the plan.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn parse(
        text: &str,
        name: &str,
        robot: &dyn Fn(&str) -> Result<RobotFile, PlanError>,
    ) -> Result<Self, PlanError> {
        let source = Source { kind: &KIND, text, name };
        let file: SweepFile = source.read()?;
        let session = file.session;
        let session_name = source.session_name(session.name, "sweep")?;
        let robot_file = robot(session.robot.as_ref().map_or(PHYSICAL, |robot| robot.get_ref()))?;
        check_constant(&file.trial, &source)?;
        let run_s = run_s(&file.trial, &source)?;
        let phases = count_of_phases(&file.trial.phases, &source)?.unwrap_or(1);
        let (design, axes) = vary(&file.vary, &robot_file, &source)?;
        let in_axes = axes.iter().any(|axis| matches!(axis.key, Key::Speed(_)));
        let speeds_rpm = match &file.speeds {
            Some(table) if in_axes => {
                let what = "the speeds stand in [speeds] and in [vary]";
                return Err(source.error(table.span(), what, "leave one of them out"));
            }
            None if in_axes => Vec::new(),
            table => {
                let pairs = pairs(table.as_ref(), 1, None, &source)?;
                pairs.into_iter().map(|pair| pair.map(CentiRpm::rpm)).collect()
            }
        };
        let plan = Self {
            name: session_name,
            robot: robot_file,
            run_s,
            method: file.trial.method.map_or(Method::Steady, Spanned::into_inner),
            phases,
            speeds_rpm,
            axes,
            design,
            text: text.to_owned(),
        };
        let points = plan.design.count(&plan.axes) * plan.speeds_rpm.len().max(1) as f64;
        if points > MAX_POINTS as f64 {
            let first = file.vary.values().next().map_or(0..0, Spanned::span);
            let what = format!("the plan has {} points, more than {MAX_POINTS}", number(points));
            return Err(source.error(first, what, "give fewer values, or take a Sobol design: { sobol = 10000 }"));
        }
        Ok(plan)
    }

    /// Returns the number of points.
    pub fn points(&self) -> u64 {
        // At most MAX_POINTS.
        self.design.count(&self.axes) as u64 * self.speeds_rpm.len().max(1) as u64
    }
}

/// Refuses settings that would change the steady state of a trial but that a sweep does not support.
fn check_constant(table: &TrialTable, source: &Source) -> Result<(), PlanError> {
    let count = "give the number of starting phases instead, such as phases = 4";
    for (key, span, cure) in [
        ("reverse", table.reverse.as_ref().map(Spanned::span), "leave it out: a point has constant speeds"),
        ("hand_turn", table.hand_turn.as_ref().map(Spanned::span), "leave it out: a point has no hand"),
        ("phase_deg", table.phase_deg.as_ref().map(Spanned::span), count),
    ] {
        if let Some(span) = span {
            return Err(source.error(span, format!("a sweep has no {key}"), cure));
        }
    }
    Ok(())
}

fn run_s(table: &TrialTable, source: &Source) -> Result<f64, PlanError> {
    match &table.run {
        None => Ok(120.0),
        Some(run) if (MIN_RUN_S..=MAX_PHASE_S).contains(run.get_ref()) => Ok(*run.get_ref()),
        Some(run) => Err(source.out_of_range(run.span(), "run", number(*run.get_ref()))),
    }
}
