//! `biflag info`

use super::Answer;
use std::path::PathBuf;

/// What a log or a session holds.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag info glycerin")]
pub struct Args {
    /// The log.
    log: PathBuf,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    Err(miette::miette!("not yet: {}", args.log.display()))
}
