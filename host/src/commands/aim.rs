//! `biflag aim`: finds the speeds of an attitude.

use super::answer::{Answer, Outcome};
use super::options::{within, written_as};
use crate::aim::{self, AimError, Aimed, Attitude, Doubt, Known, Model, Proposal, Solution, Target, Unknown};
use crate::output;
use crate::plan::robot;
use crate::progress::Progress;
use crate::signals::interruption;
use crate::text::{count, decimal, word};
use serde_json::json;
use sim::steady::Kind;
use sim::steady::phase::Ratio;
use sim::step::InversesAtRest;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Find motor speeds for a wanted attitude, verified by the model.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag aim --yaw=-67 --pitch=-4\n  \
    biflag aim --yaw=-100 --tilt 5 --robot fitted.toml -o plan.toml && biflag record plan.toml\n\
    Two speeds determine two quantities: give two, or more if they are consistent. Yaw is matched modulo 360 degrees.\n\
    If no speeds are found, the nearest attitude is printed, with exit code 3; other speeds may still reach it.\n\
    Where the flagella touch a trial takes long: what was not computed in the time of --for is named, with exit code 3.")]
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
    /// Longest time, seconds; an answer that is not complete by then is partial.
    #[arg(long = "for", value_name = "SECONDS", default_value_t = 60.0, value_parser = within("seconds", 0.001..=86_400.0))]
    longest_s: f64,
    /// The plan to write, with a trial at each pair of speeds; it must not exist yet.
    #[arg(short, long, value_name = "PLAN", value_parser = written_as(&["toml"]))]
    out: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let target = Target::of([args.yaw, args.pitch, args.roll, args.tilt, args.thrust])?;
    if let Some(out) = &args.out {
        output::check_new(out)?;
    }
    let file = robot::load(&args.robot)?;
    let robot = file.parse()?;
    let table = args.table.as_deref().map_or_else(aim::shipped, |path| aim::load(path, &robot))?;
    let known = Known::new(&robot, file.fit()?);

    let interrupted = interruption()?;
    let progress = Progress::new(args.longest_s);
    progress.phase(&target.to_string(), &format!("asking the model, for {} s at most", decimal(args.longest_s, 0)));
    let begun = Instant::now();
    let done = AtomicUsize::new(0);
    let goes_on = || {
        progress.within(begun.elapsed().as_secs_f64());
        !interrupted.load(Ordering::Relaxed)
    };
    let solved = || progress.figures(&count(done.fetch_add(1, Ordering::Relaxed) + 1, "steady state"));
    let at_rest = InversesAtRest::default();
    let model = Model { robot: &robot, at_rest: &at_rest, goes_on: &goes_on, until: None, solved: &solved };
    let aimed = aim::aim(&model, &known, &table, &target, Duration::from_secs_f64(args.longest_s));
    progress.finish();
    let aimed = match aimed {
        Err(AimError::Interrupted) => {
            return Answer::new(Outcome::Interrupted, &json!({ "interrupted": true }), "interrupted");
        }
        aimed => aimed?,
    };
    let mut text = describe(&file.name, &target, &aimed, args.longest_s);
    let plan = args.out.as_deref().filter(|_| aimed.reachable);
    if let Some(out) = plan {
        output::write_new(out, &aim::plan(out, &args.robot, &target, &aimed.solutions))?;
        let _ = write!(text, "\nplan {}", out.display());
    }
    let is_sound = aimed.reachable && aimed.is_complete() && !aimed.doubts.iter().any(|doubt| doubt.is_grave);
    let wanted = target.wanted.iter().map(|(quantity, value)| json!({ "quantity": quantity, "value": value }));
    let answer = Answer::new(Outcome::of(is_sound), &aimed, text)?
        .with("robot", &file.name)
        .with("wanted", wanted.collect::<Vec<_>>());
    Ok(match plan {
        Some(out) => answer.with("plan", out.display().to_string()),
        None => answer,
    })
}

fn describe(robot: &str, target: &Target, aimed: &Aimed, longest_s: f64) -> String {
    let time = format!("{} s", decimal(longest_s, 0));
    let mut text = match &aimed.nearest {
        _ if aimed.reachable => format!("{target}: {}, robot {robot}\n", count(aimed.solutions.len(), "solution")),
        Some(_) => {
            let time = if aimed.unfinished.is_empty() { String::new() } else { format!(" in {time}") };
            format!("{target}: not found with the robot {robot} within ±90 rpm{time}; the nearest attitude found\n")
        }
        None => format!("{target}: no trial of the robot {robot} has ended within {time}\n"),
    };
    let described = |solution| describe_solution(solution, aimed.confidence);
    text.extend(aimed.solutions.iter().chain(&aimed.nearest).map(described));
    // Writing to a string cannot fail.
    if !aimed.is_complete() {
        let over = format!("the {time} were over before the model had answered everything");
        let _ = writeln!(text, "\nwarning: {over}; --for gives it longer");
    }
    for Proposal { w1_rpm, w2_rpm, attitude } in &aimed.unfinished {
        let [w1, w2] = [w1_rpm, w2_rpm].map(|rpm| decimal(*rpm, 2));
        let [yaw, pitch, roll] = attitude.angles_deg().map(|angle| decimal(angle, 2));
        let there = format!("yaw {yaw}°, pitch {pitch}°, roll {roll}° there");
        let _ = writeln!(text, "  not finished: w1 {w1}, w2 {w2} rpm, which the table gives ({there})");
    }
    for Doubt { reason, is_grave } in &aimed.doubts {
        let label = if *is_grave { "warning" } else { "note" };
        let _ = writeln!(text, "{label}: these are no 95 % intervals: {reason}");
    }
    text.truncate(text.trim_end().len());
    text
}

fn describe_solution(solution: &Solution, confidence: Option<f64>) -> String {
    let within = confidence.map_or("within".to_owned(), |confidence| format!("{:.0} %", 100.0 * confidence));
    let Solution { state, interval, .. } = solution;
    let Attitude { yaw_deg, pitch_deg, roll_deg, thrust_n } = state.attitude;
    let unsettled = if state.kind < Kind::NotFound { "" } else { ", not settled: means, not steady values" };
    let mut text = format!("\nw1 {}, w2 {} rpm{unsettled}\n", decimal(state.w1_rpm, 2), decimal(state.w2_rpm, 2));
    let angles = [
        ("yaw", yaw_deg, interval.yaw_ci_deg, 0),
        ("pitch", pitch_deg, interval.pitch_ci_deg, 1),
        ("roll", roll_deg, interval.roll_ci_deg, 2),
    ];
    // Writing to a string cannot fail.
    for (name, value, ci, axis) in angles {
        let bounds = ci.map_or("interval unknown: the time was over".to_owned(), |[low, high]| {
            format!("{within} {} to {}", decimal(low, 2), decimal(high, 2))
        });
        let _ = write!(text, "  {name:<6} {:>8}°  {bounds}", decimal(value, 2));
        let [phase, model] =
            [interval.phase_spread_deg, interval.model_error_deg].map(|parts| parts.map_or(0.0, |parts| parts[axis]));
        let parts = [(phase, "", "the starting phase"), (model, "± ", "the error of the model")];
        let parts = parts.iter().filter(|(deg, ..)| *deg > 0.005);
        let parts: Vec<_> = parts.map(|(deg, sign, of)| format!("{sign}{}° by {of}", decimal(*deg, 2))).collect();
        text += &if parts.is_empty() { "\n".to_owned() } else { format!(", with {}\n", parts.join(" and ")) };
    }
    let [tilt, thrust, error] = [solution.tilt_deg, 1e3 * thrust_n, solution.error_deg].map(|value| decimal(value, 2));
    let phase = Ratio::of(state.rpm()).map_or("", |_| "; these hold for one starting phase of the flagella");
    let _ = writeln!(text, "  tilt   {tilt:>8}°  thrust {thrust} mN, misses by {error}°{phase}");
    let some = if interval.contact_by_phase == Some(true) { " (not at all starting phases)" } else { "" };
    let none = if solution.unknown.contains(&Unknown::ContactChange) {
        "change of contact unknown: the time was over"
    } else {
        "no change of contact found"
    };
    let change = solution.contact_change.map_or(none.to_owned(), |change| {
        let [away, w1, w2] = [change.rpm, change.at_rpm[0], change.at_rpm[1]].map(|rpm| decimal(rpm, 0));
        format!("contact changes {away} rpm away, at ({w1}, {w2}) rpm")
    });
    let (contact, gap) = (word(&state.contact), decimal(1e3 * state.min_gap_m, 1));
    let _ = writeln!(text, "  flagella {contact}{some}, smallest gap {gap} mm; {change}");
    text
}
