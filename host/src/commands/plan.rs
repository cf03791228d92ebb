//! `biflag plan`: what a plan will do, before it runs.

use super::answer::{Answer, Outcome, finding_line};
use crate::plan::Plan;
use crate::preview::{Preview, end_after};
use clap::Subcommand;
use std::path::PathBuf;

/// Check a plan without a board.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag plan check plan.toml\n\
    `biflag new` writes a plan to begin with, `biflag plans` lists those inside biflag.")]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand, Debug)]
enum Action {
    /// Read a plan with its robot and sensor files, and print its trials, their duration, and what may be wrong.
    Check {
        /// The plan: a TOML file, or the name of one inside biflag (`biflag plans`).
        plan: PathBuf,
    },
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let Action::Check { plan } = &args.action;
    preview(&Plan::load(plan)?)
}

/// Returns what a plan will do as an answer.
pub(super) fn preview(plan: &Plan) -> miette::Result<Answer> {
    let preview = Preview::of(plan, false);
    let mut text = preview.to_string();
    if preview.duration_s > 0.0 {
        text += &format!("\nwould end at {} if it began now", end_after(preview.duration_s));
    }
    preview.findings.iter().for_each(|finding| text += &format!("\n{}", finding_line(None, finding)));
    let is_sound = !preview.findings.iter().any(|finding| finding.grave);
    Answer::new(Outcome::of(is_sound), &preview, text)
}
