//! `biflag new`: a plan to begin with.

use super::answer::{Answer, Outcome, wrong_use};
use super::options::written_as;
use crate::output::{self, OutputError};
use crate::plan::{EXAMPLE, Plan};
use crate::preview::Preview;
use std::path::PathBuf;

/// Write a commented plan to begin with.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag new glycerin.toml\nAn existing file is never replaced.")]
pub struct Args {
    /// The file to write.
    #[arg(default_value = "plan.toml", value_parser = written_as(&["toml"]))]
    file: PathBuf,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let path = args.file.display();
    match output::write_new(&args.file, EXAMPLE) {
        Err(OutputError::Exists { .. }) => {
            let check = format!("`biflag plan check {path}` reads this one");
            let help = format!("name another file, such as `biflag new my-plan.toml`; {check}");
            return Err(wrong_use(format!("{path} exists already"), &help));
        }
        written => written?,
    }
    let preview = Preview::of(&Plan::load(&args.file)?, false);
    let text = format!("{path}: {}\nchange it, then: biflag plan check {path}; biflag record {path}", preview.amount());
    Ok(Answer::new(Outcome::Done, &preview, text)?.with("file", args.file.to_string_lossy()))
}
