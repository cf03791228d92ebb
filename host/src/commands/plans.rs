//! `biflag plans`: the plans and robot files inside the program.

use super::answer::{Answer, Outcome, wrong_use};
use crate::plan::Shipped;
use biflag_log::similar::suggest;
use serde_json::json;
use std::fmt::Write;
use std::path::Path;

/// List the plans and robot files inside biflag, or print one of them.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag plans\n  \
    biflag plans published-points > my-plan.toml\n  \
    biflag simulate published-points --robot robot-tank\n\
    Commands that take a plan or a robot file also take one of these names. A file of the same name takes precedence.")]
pub struct Args {
    /// The plan or robot file to print.
    name: Option<String>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    if let Some(name) = &args.name {
        let file = Shipped::find(Path::new(name)).ok_or_else(|| {
            let help = suggest(name, Shipped::all().map(|file| file.name), "`biflag plans` lists them");
            wrong_use(format!("no plan or robot file is called {name:?}"), &help)
        })?;
        return Answer::new(Outcome::Done, &json!({ "name": file.name, "text": file.text }), file.text);
    }
    let (robots, plans): (Vec<Shipped>, Vec<Shipped>) = Shipped::all().partition(Shipped::is_robot);
    let width = Shipped::all().map(|file| file.name.len()).max().unwrap_or_default();
    let mut text = String::new();
    for (title, files) in [("Plans", &plans), ("Robot files", &robots)] {
        let _ = writeln!(text, "{title}:");
        text.extend(files.iter().map(|file| format!("  {:width$}  {}\n", file.name, file.about())));
    }
    let list = |files: &[Shipped]| -> Vec<_> {
        files.iter().map(|file| json!({ "name": file.name, "about": file.about() })).collect()
    };
    Answer::new(Outcome::Done, &json!({ "plans": list(&plans), "robots": list(&robots) }), text)
}
