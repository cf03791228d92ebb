//! `biflag recover`

use super::Answer;
use std::path::PathBuf;

/// Make a clean log of one that was cut off or damaged.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag recover glycerin/001_w1+50_w2+10.mcap")]
pub struct Args {
    /// The log.
    log: PathBuf,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    Err(miette::miette!("not yet: {}", args.log.display()))
}
