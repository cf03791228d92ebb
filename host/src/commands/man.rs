//! `biflag man`: the manual pages, from the definition of the command line.

use super::answer::{Answer, Outcome};
use miette::{IntoDiagnostic, WrapErr};
use serde_json::json;
use std::path::PathBuf;

/// Write the manual pages of biflag and of each command into a folder.
#[derive(clap::Args, Debug)]
#[command(hide = true, after_help = "Example: biflag man ~/.local/share/man/man1")]
pub struct Args {
    /// The folder, which is created if it does not exist.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub fn run(args: &Args, program: clap::Command) -> miette::Result<Answer> {
    let folder = &args.folder;
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(program.disable_help_subcommand(true), folder))
        .into_diagnostic()
        .wrap_err_with(|| format!("{}: the manual pages cannot be written", folder.display()))?;
    let text = format!("manual pages in {}", folder.display());
    Answer::new(Outcome::Done, &json!({ "folder": folder.to_string_lossy() }), text)
}
