//! A check and its result.

use crate::commands::answer::{Answer, Outcome};
use miette::Diagnostic;
use serde::Serialize;
use serde_json::json;
use std::fmt::Write;

/// A check, its result, and the fix of a problem.
#[derive(Debug, Serialize)]
pub struct Check {
    pub name: String,
    pub ok: bool,
    pub detail: String,
    pub cure: String,
}

/// What was found, or the problem and its fix.
pub type Finding = Result<String, (String, String)>;

/// Returns the checks as text and JSON.
pub fn answer(checks: Vec<Check>, on_problem: Outcome) -> miette::Result<Answer> {
    let mut text = String::new();
    for Check { name, ok, detail, cure } in &checks {
        let mark = if *ok { "ok     " } else { "PROBLEM" };
        let _ = writeln!(text, "{mark} {name}: {}", detail.replace('\n', "\n          "));
        if !ok {
            let _ = writeln!(text, "        fix: {cure}");
        }
    }
    let outcome = if checks.iter().all(|check| check.ok) { Outcome::Done } else { on_problem };
    Answer::new(outcome, &json!({ "checks": checks }), text)
}

/// Returns a check of this name.
pub fn check(name: String, finding: Finding) -> Check {
    match finding {
        Ok(detail) => Check { name, ok: true, detail, cure: String::new() },
        Err((detail, cure)) => Check { name, ok: false, detail, cure },
    }
}

/// Returns an error as a problem.
pub fn problem(error: impl Diagnostic) -> (String, String) {
    let cure = error.help().map_or_else(|| "unplug and replug the board".to_owned(), |help| help.to_string());
    (error.to_string(), cure)
}
