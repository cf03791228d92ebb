//! `biflag aim`: finds the speeds of an attitude.

use super::{Answer, Outcome};
use crate::aim::{self, AimError, Aimed, Attitude, Doubt, Known, Model, Quantity, Solution, Target};
use crate::output;
use crate::plan::robot;
use crate::progress::Progress;
use crate::signals::interruption;
use crate::text::{count, decimal, word};
use serde::Serialize;
use sim::step::InversesAtRest;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Find motor speeds for a wanted attitude, verified by the model.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag aim --yaw=-67 --pitch=-4\n  \
    biflag aim --yaw=-100 --tilt 5 --robot fitted.toml -o plan.toml && biflag record plan.toml\n\
    Two speeds determine two quantities: give two, or more if they are consistent. Yaw is matched modulo 360 degrees.\n\
    If no speeds are found, the nearest attitude is printed, with exit code 3; other speeds may still reach it.")]
pub struct Args {
    /// Steady yaw, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    yaw: Option<f64>,
    /// Steady pitch, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pitch: Option<f64>,
    /// Steady roll, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    roll: Option<f64>,
    /// Angle between the robot's axis and the vertical, degrees.
    #[arg(long, value_name = "DEG")]
    tilt: Option<f64>,
    /// Thrust of both flagella along the robot's axis, N.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    thrust: Option<f64>,
    /// The robot: a robot file, `physical` or `published`. 95 % intervals need a file from `calibrate`, which has the
    /// covariance of its fit.
    #[arg(long, value_name = "FILE|NAME", default_value = robot::PHYSICAL)]
    robot: PathBuf,
    /// The table of a sweep (CSV or Parquet) with the initial speeds; by default the map of the robot `physical`.
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// The plan to write, with a trial at each pair of speeds; it must not exist yet.
    #[arg(short, long, value_name = "PLAN")]
    out: Option<PathBuf>,
}

#[derive(Serialize)]
struct Printed<'a> {
    robot: &'a str,
    wanted: Vec<Wanted>,
    #[serde(flatten)]
    aimed: &'a Aimed,
    #[serde(skip_serializing_if = "Option::is_none")]
    plan: Option<String>,
}

#[derive(Serialize)]
struct Wanted {
    quantity: Quantity,
    value: f64,
}

/// Number of steady states of a typical answer, to estimate the remaining time.
const USUAL_STATES: usize = 20;

pub fn run(args: &Args) -> miette::Result<Answer> {
    let target = target(args)?;
    if let Some(out) = &args.out {
        output::check_new(out)?;
    }
    let file = robot::load(&args.robot)?;
    let robot = file.parse()?;
    let table = args.table.as_deref().map_or_else(aim::shipped, |path| aim::load(path, &robot))?;
    let known = Known::new(&robot, file.fit()?);

    let interrupted = interruption()?;
    let progress = Progress::new(USUAL_STATES as f64);
    progress.phase(&target.to_string(), "asking the model");
    let done = AtomicUsize::new(0);
    let goes_on = || !interrupted.load(Ordering::Relaxed);
    let solved = || {
        let count = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress.within(count.min(USUAL_STATES - 1) as f64);
    };
    let model = Model { robot: &robot, at_rest: &InversesAtRest::default(), goes_on: &goes_on, solved: &solved };
    let aimed = aim::aim(&model, &known, &table, &target);
    progress.finish();
    let aimed = match aimed {
        Err(AimError::Interrupted) => {
            return Answer::new(Outcome::Interrupted, &serde_json::json!({ "interrupted": true }), "interrupted");
        }
        aimed => aimed?,
    };
    let mut text = describe(&file.name, &target, &aimed);
    let plan = match &args.out {
        Some(out) if aimed.reachable => {
            output::write_new(out, &aim::plan(out, &args.robot, &target, &aimed.solutions))?;
            let _ = write!(text, "\nplan {}", out.display());
            Some(out.display().to_string())
        }
        _ => None,
    };
    let is_sound = aimed.reachable && !aimed.doubts.iter().any(|doubt| doubt.is_grave);
    let outcome = if is_sound { Outcome::Done } else { Outcome::WithLoss };
    let wanted = target.wanted.iter().map(|&(quantity, value)| Wanted { quantity, value }).collect();
    Answer::new(outcome, &Printed { robot: &file.name, wanted, aimed: &aimed, plan }, text)
}

/// Returns what the user asks for.
fn target(args: &Args) -> Result<Target, AimError> {
    Target::new([
        (Quantity::Yaw, args.yaw),
        (Quantity::Pitch, args.pitch),
        (Quantity::Roll, args.roll),
        (Quantity::Tilt, args.tilt),
        (Quantity::Thrust, args.thrust),
    ])
}

fn describe(robot: &str, target: &Target, aimed: &Aimed) -> String {
    let mut text = match &aimed.nearest {
        None => format!("{target}: {}, robot {robot}\n", count(aimed.solutions.len(), "solution")),
        Some(_) => {
            format!("{target}: not found with the robot {robot} within ±90 rpm; the nearest attitude found\n")
        }
    };
    for solution in aimed.solutions.iter().chain(&aimed.nearest) {
        text += &describe_solution(solution, aimed.confidence);
    }
    for Doubt { reason, is_grave } in &aimed.doubts {
        let label = if *is_grave { "warning" } else { "note" };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{label}: these are no 95 % intervals: {reason}");
    }
    text.truncate(text.trim_end().len());
    text
}

fn describe_solution(solution: &Solution, confidence: Option<f64>) -> String {
    let within = confidence.map_or("within".to_owned(), |confidence| format!("{:.0} %", 100.0 * confidence));
    let Solution { state, interval, .. } = solution;
    let Attitude { yaw_deg, pitch_deg, roll_deg, thrust_n } = state.attitude;
    let mut text = format!("\nw1 {}, w2 {} rpm\n", decimal(state.w1_rpm, 2), decimal(state.w2_rpm, 2));
    let angles = [
        ("yaw", yaw_deg, interval.yaw_ci_deg, 0),
        ("pitch", pitch_deg, interval.pitch_ci_deg, 1),
        ("roll", roll_deg, interval.roll_ci_deg, 2),
    ];
    // Writing to a string cannot fail.
    for (name, value, [low, high], axis) in angles {
        let _ =
            write!(text, "  {name:<6} {:>8}°  {within} {} to {}", decimal(value, 2), decimal(low, 2), decimal(high, 2));
        let model = interval.model_error_deg.map_or(0.0, |error| error[axis]);
        let parts =
            [(interval.phase_spread_deg[axis], "", "the starting phase"), (model, "± ", "the error of the model")];
        let parts = parts.iter().filter(|(deg, ..)| *deg > 0.005);
        let parts: Vec<_> = parts.map(|(deg, sign, of)| format!("{sign}{}° by {of}", decimal(*deg, 2))).collect();
        text += &if parts.is_empty() { "\n".to_owned() } else { format!(", with {}\n", parts.join(" and ")) };
    }
    let error = decimal(solution.error_deg, 2);
    let _ = writeln!(
        text,
        "  tilt   {:>8}°  thrust {} mN, misses by {error}°",
        decimal(solution.tilt_deg, 2),
        decimal(1e3 * thrust_n, 2)
    );
    let some = if interval.contact_by_phase { " (not at all starting phases)" } else { "" };
    let change = solution.contact_change.map_or("no change of contact found".to_owned(), |change| {
        format!(
            "contact changes {} rpm away, at ({}, {}) rpm",
            decimal(change.rpm, 0),
            decimal(change.at_rpm[0], 0),
            decimal(change.at_rpm[1], 0)
        )
    });
    let _ = writeln!(
        text,
        "  flagella {}{some}, smallest gap {} mm; {change}",
        word(&state.contact),
        decimal(1e3 * state.min_gap_m, 1)
    );
    text
}
