//! `biflag sensor`: measures the sensor of a board, with the operator's hand as the reference.

mod bench;
mod poses;
mod still;
mod turn;

pub(super) use bench::percent;

use super::answer::Answer;
use clap::Subcommand;

/// Measure the sensor: its scales, axes, sensitivity to gravity and noise. Start with `poses`, then turn about each axis.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag sensor poses; biflag sensor turn z; biflag sensor still 600")]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Debug)]
enum What {
    Turn(turn::Args),
    Poses(poses::Args),
    Still(still::Args),
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let answer = match &args.what {
        What::Turn(args) => turn::run(args),
        What::Poses(args) => poses::run(args),
        What::Still(args) => still::run(args),
    };
    answer.or_else(bench::ended)
}
