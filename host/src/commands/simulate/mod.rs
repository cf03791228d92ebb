//! `biflag simulate`: simulates trials.

mod output;
mod planned;
mod replay;

use super::answer::Answer;
use super::options::{closure, duration, method, pair, shard, speeds, within};
use crate::sweep::Shard;
use biflag_log::Method;
use protocol::units::CentiRpm;
use sim::body::closure::Closure;
use std::path::PathBuf;

/// Simulate the trials of a plan, one pair of speeds, or a recorded trial, and write a log of each.
#[derive(clap::Args, Debug)]
#[command(
    override_usage = "biflag simulate [OPTIONS] <PLAN>\n       biflag simulate [OPTIONS] --speeds <W1,W2> --duration <S>\n       biflag simulate [OPTIONS] --from <LOG|SESSION>",
    after_help = "Examples:\n  \
    biflag simulate published-points --out points\n  \
    biflag simulate --speeds=-90,90 --duration 120 --closure lumped\n  \
    biflag simulate --speeds 90,90 --phase 0,90 --duration 120\n  \
    biflag simulate --speeds 37,53 --duration 120 --method steady\n  \
    biflag simulate --from glycerin --robot fitted.toml --out fitted\n\
    The logs do not depend on --jobs, --shard or interruptions."
)]
pub struct Args {
    /// The plan: a TOML file (see `biflag record --help` for an example), or the name of one inside biflag (`biflag plans`).
    #[arg(
        required_unless_present_any = ["speeds", "duration", "from"],
        conflicts_with_all = ["speeds", "duration", "phase", "from"]
    )]
    plan: Option<PathBuf>,
    /// Replay a recorded log or session: its measured speeds drive the model of its robot.
    #[arg(long, value_name = "LOG|SESSION", conflicts_with_all = ["speeds", "duration", "phase", "shard"])]
    from: Option<PathBuf>,
    /// Speeds of flagella 1 and 2 in rpm instead of a plan; write `--speeds=-90,90` if the first is negative.
    #[arg(long, value_name = "W1,W2", value_parser = speeds, allow_hyphen_values = true, requires = "duration")]
    speeds: Option<[CentiRpm; 2]>,
    /// Duration of the run at these speeds, in seconds.
    #[arg(long, value_name = "S", value_parser = duration, requires = "speeds")]
    duration: Option<f64>,
    /// Angles of motors 1 and 2 at the start of the run at these speeds, in degrees, such as `0,90`; by default 0,0.
    #[arg(long, value_name = "DEG,DEG", value_parser = phase, allow_hyphen_values = true, requires = "speeds")]
    phase: Option<[f64; 2]>,
    /// `trial` simulates each trial; `steady` solves for its final motion, about three times faster if that motion
    /// repeats.
    ///
    /// The default is the plan's method, or `trial`. With `steady` the log contains one period of the motion and no
    /// other phases. If no repeating motion is found, the simulation continues until the means over both motor angles
    /// are known or the run ends, and the log contains the last window. `kind` in the output is `steady`,
    /// `beating` (the means are known), `not_found`, or `overturned` (the base turned over: no angles).
    #[arg(long, value_parser = method(), conflicts_with = "from")]
    method: Option<Method>,
    /// Coupling of the flagella to the base: `full`, with forces in both directions; `lumped`, the published couples
    /// with reaction torques; or `paper`, the equations as printed, whose yaw never settles.
    ///
    /// The default is `full`; with `--from`, the closure of the log's model if it has one.
    #[arg(long, value_parser = closure())]
    closure: Option<Closure>,
    /// The robot file, `physical` or `published`, instead of the robot of the plan or the log.
    #[arg(long, value_name = "FILE|NAME")]
    robot: Option<PathBuf>,
    /// Number of parallel trials; by default the number of cores.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Compute every N-th trial, starting with the I-th. Shards may share a folder or use separate ones.
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<Shard>,
    /// Samples per second; the board's rate is 200.
    #[arg(long, value_name = "HZ", default_value = "20", value_parser = within("samples per second", 0.01..=1000.0))]
    rate: f64,
    /// Write the shapes of the flagella into the logs.
    #[arg(long)]
    shapes: bool,
    /// The session folder; by default named after the plan, the speeds, or the replayed session.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Continue a session, skipping the trials that are complete.
    #[arg(long)]
    resume: bool,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    if let Some(from) = &args.from { replay::run(args, from) } else { planned::run(args) }
}

fn phase(text: &str) -> Result<[f64; 2], String> {
    pair(text, "give two angles in degrees, such as 0,90", within("two angles in degrees", -360.0..=360.0))
}
