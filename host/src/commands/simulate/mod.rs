//! `biflag simulate`: simulates trials.

mod args;
mod output;
mod planned;
mod replay;

pub use args::Args;

use super::answer::Answer;

pub fn run(args: &Args) -> miette::Result<Answer> {
    match &args.from {
        Some(from) => replay::run(args, from),
        None => planned::run(args),
    }
}
