//! Stands for `biflag pack` in a program that was built without archives, as `make demo` does.

use super::Answer;
use std::ffi::OsString;

/// Pack a session into one archive. This program was built without it.
#[derive(clap::Args, Debug)]
#[command(after_help = "Build it with `make build`: then `biflag pack SESSION` works.")]
pub struct Args {
    /// Ignored.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    _arguments: Vec<OsString>,
}

pub fn run(_: &Args) -> miette::Result<Answer> {
    Err(miette::miette!(
        help = "build it with `make build`",
        "this biflag was built without archives, as `make demo` does"
    ))
}
