//! `biflag completions`: scripts that complete commands and options in a shell.

use super::answer::{Answer, Outcome};
use clap_complete::Shell;
use serde_json::json;

/// Print a script that completes the commands and options of biflag in a shell.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag completions bash > ~/.local/share/bash-completion/completions/biflag\n  \
    biflag completions zsh > ~/.zfunc/_biflag\n  \
    biflag completions fish > ~/.config/fish/completions/biflag.fish")]
pub struct Args {
    /// The shell.
    shell: Shell,
}

pub fn run(args: &Args, mut program: clap::Command) -> miette::Result<Answer> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program, "biflag", &mut script);
    let script = String::from_utf8_lossy(&script);
    Answer::new(Outcome::Done, &json!({ "shell": args.shell.to_string(), "script": script }), script)
}
