//! `biflag steer`: reaches an attitude and holds it.

mod course;
mod in_model;
mod output;
mod rig;

use super::answer::{Answer, Outcome, wrong_use};
use super::options::{duration, within};
use super::virtual_board::{self, SensorArgs};
use crate::link::LinkError;
use crate::plan::{MAX_PHASE_S, robot};
use crate::session::{self, SessionError};
use crate::signals::interruption;
use crate::trial::{Judged, Want};
use biflag_log::SteerMeta;
use course::Course;
use output::Steered;
use std::path::PathBuf;
use study::steer::{Held, RATE_HZ, Steering};

/// Reach an attitude and hold it, on the rig, on the emulated board or in the model, and write a log.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag steer --yaw=-67 --pitch=-4 --model\n  \
    biflag steer --yaw=-67 --pitch=-4 --port /dev/ttyUSB0 --for 300 --out hold\n  \
    biflag steer --yaw 40 --pitch 3 --virtual --policy 'python3 policy.py'\n\
    The attitude is the mean over some turns of the flagella; yaw is counted from the start of the run, modulo 360 degrees. \
    It comes from the gyroscope, which drifts: the terminal says how far it may be off. A policy reads a line of JSON with \
    the observation from its standard input, twenty times a second, and writes one such as {\"speeds_rpm\": [50, 10]}. The \
    motors stop at the end, with Ctrl-C, and if the policy ends, is silent for 0.4 s or asks for what the board cannot do.")]
pub struct Args {
    /// Mean yaw to hold, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    yaw: f64,
    /// Mean pitch to hold, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pitch: f64,
    /// The serial port of the board; not needed if only one board is plugged in.
    #[arg(long, conflicts_with_all = ["virtual", "model"])]
    port: Option<String>,
    /// Steer the emulated board with the simulated robot.
    #[arg(long = "virtual", conflicts_with = "model")]
    r#virtual: bool,
    /// Steer the model, with the delay of a rig and the ramp of its motors.
    #[arg(long)]
    model: bool,
    /// Longest time of the run, seconds; then the motors stop.
    #[arg(long = "for", value_name = "S", value_parser = duration, default_value = "120")]
    run_s: f64,
    /// Duration of the rest before the run, seconds, which shows the drift of the yaw. With 0 the run begins at once, without
    /// a calibration of the gyroscope, and no angle has a ±. The model needs no rest.
    #[arg(long, value_name = "S", value_parser = within("seconds", 0.0..=MAX_PHASE_S), default_value = "20", conflicts_with = "model")]
    rest: f64,
    /// A command that gives the speeds instead of the built-in controller; `-` is the program that started biflag, which
    /// reads the observations from its standard output and writes the speeds to its standard input. The answer of --json is
    /// then the last line.
    #[arg(long, value_name = "COMMAND")]
    policy: Option<String>,
    /// The robot that is steered: a robot file, `physical` or `published`.
    #[arg(long, value_name = "FILE|NAME", default_value = robot::PHYSICAL)]
    robot: PathBuf,
    /// The table of a sweep of this robot (CSV or Parquet), from which the controller knows it; by default the map of the
    /// robot `physical`.
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// Speed of the emulated board relative to real time: a factor, or `max`.
    #[arg(long, default_value = "1", requires = "virtual", conflicts_with = "lock_step")]
    speed: String,
    /// Let the emulated board wait for this program and its policy: two runs then agree bit for bit, at any load of the
    /// computer.
    #[arg(long, requires = "virtual")]
    lock_step: bool,
    #[command(flatten)]
    sensor: SensorArgs,
    /// Simulate a fault of the emulated board, from its start or from a second of its clock, such as `blocked=2@30`;
    /// may be repeated. `help` lists the faults.
    #[arg(long = "fault", value_name = "NAME[=VALUE][@SECONDS]", requires = "virtual")]
    faults: Vec<String>,
    /// The session folder; by default named after the attitude.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    if let Some(answer) = virtual_board::help(&args.faults, Some(&args.sensor)) {
        return answer;
    }
    let interrupted = interruption()?;
    let Course { wanted, pilot, plan, expected } = Course::new(args, robot::load(&args.robot)?)?;
    let policy = args.policy.clone().unwrap_or_default();
    let meta = SteerMeta { yaw_deg: wanted.yaw_deg, pitch_deg: wanted.pitch_deg, rate_hz: RATE_HZ, policy };
    let mut steering = Steering::new(wanted, pilot);
    let folder = args.out.clone().unwrap_or_else(|| session::folder_named(&plan.name));
    let to_steer = (&mut steering, &meta);
    let ran = if args.model {
        in_model::steer(&plan, &folder, to_steer, &expected, &interrupted)
    } else {
        rig::steer(args, &plan, &folder, to_steer, &expected, &interrupted)
    };
    let (log, ran) = match ran {
        Err(report) if matches!(report.downcast_ref(), Some(LinkError::Interrupted)) => {
            return Answer::new(Outcome::Interrupted, &serde_json::json!({ "log": null }), "interrupted");
        }
        Err(report) if matches!(report.downcast_ref(), Some(SessionError::Exists { .. })) => {
            let help = "name another folder with --out: a run that is steered begins anew";
            return Err(wrong_use(report, help));
        }
        ran => ran?,
    };
    let trial = Judged::read(&log, Want::default())?;
    let steered = Steered {
        log,
        origin: trial.data.origin().name(),
        wanted,
        held: Held::of(&trial),
        reached_s: steering.reached_s,
        steps: ran.tally.steps,
        late_steps: ran.tally.late,
        latency_p50_s: ran.tally.latency_s(0.5),
        latency_p99_s: ran.tally.latency_s(0.99),
        budget: trial.steady_angles().map(|angles| angles.budget).unwrap_or_default(),
        findings: trial.findings,
        notes: expected.note().into_iter().chain(ran.notes).collect(),
    };
    if let Some(report) = &ran.error {
        return Answer::failed(&steered, report);
    }
    let is_sound = steered.reached_s.is_some() && !steered.findings.iter().any(|finding| finding.grave);
    let outcome = if ran.interrupted { Outcome::Interrupted } else { Outcome::of(is_sound) };
    Answer::new(outcome, &steered, steered.to_string())
}
