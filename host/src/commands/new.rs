//! `biflag new`: a plan to begin with.

use super::answer::{Answer, Outcome, WRONG_USE};
use super::options::written_as;
use crate::output::{self, OutputError};
use crate::plan::{EXAMPLE, Plan};
use crate::preview::Preview;
use miette::IntoDiagnostic;
use serde_json::json;
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
            return Err(miette::miette!(
                code = WRONG_USE,
                help = format!(
                    "name another file, such as `biflag new my-plan.toml`; `biflag plan check {path}` reads this one"
                ),
                "{path} exists already"
            ));
        }
        written => written?,
    }
    let preview = Preview::of(&Plan::load(&args.file)?, false);
    let mut body = serde_json::to_value(&preview).into_diagnostic()?;
    if let Some(body) = body.as_object_mut() {
        body.insert("file".to_owned(), json!(args.file.to_string_lossy()));
    }
    let text = format!("{path}: {}\nchange it, then: biflag plan check {path}; biflag record {path}", preview.amount());
    Answer::new(Outcome::Done, &body, text)
}
