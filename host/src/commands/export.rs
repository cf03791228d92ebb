//! `biflag export`

use super::Answer;
use std::path::PathBuf;

/// Write a log in another format.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag export glycerin/001_w1+50_w2+10.mcap --format csv")]
pub struct Args {
    /// The log.
    log: PathBuf,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    Err(miette::miette!("not yet: {}", args.log.display()))
}
