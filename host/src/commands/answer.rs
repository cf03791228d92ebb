//! The result of a command, and its output: stdout, stderr and the exit code.
//!
//! A terminal that Ctrl-S has stopped takes no output, nor does a pipe that nobody reads. A command waits for them, until the
//! user interrupts it.

use super::usage;
use crate::colour;
use crate::signals::{INTERRUPTED, is_interrupted};
use crate::text::{json_without, printable, with_causes};
use crate::trial::{Finding, LogFinding};
use miette::{Diagnostic, Report};
use serde::Serialize;
use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// Longest wait of an interrupted command for its last output.
const PATIENCE: Duration = Duration::from_secs(1);

/// How a command without an error ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Outcome {
    /// Everything was done. Exit code 0.
    Done,
    /// Done, and something failed or was found broken. Exit code 1.
    Failed,
    /// Done, with losses or important warnings. Exit code 3.
    WithLoss,
    /// The user interrupted it, and all files are closed. Exit code 130.
    Interrupted,
}

impl Outcome {
    /// Returns the outcome of a command that has done everything. `is_sound`: whether nothing was lost and there are no warnings.
    pub fn of(is_sound: bool) -> Self {
        if is_sound { Self::Done } else { Self::WithLoss }
    }
}

pub use study::WRONG_USE;

/// Returns the error of a wrong use: what is wrong, and what to do.
pub fn wrong_use(what: impl Display, help: &str) -> Report {
    miette::miette!(code = WRONG_USE, help = help, "{what}")
}

/// The result of a command.
#[derive(Debug)]
pub struct Answer {
    /// How it ended.
    pub outcome: Outcome,
    /// Output with `--json`.
    pub json: serde_json::Value,
    /// Output without `--json`.
    pub text: String,
}

impl Answer {
    /// Creates an answer whose JSON is `body`.
    ///
    /// # Errors
    /// If `body` cannot be represented in JSON.
    pub fn new(outcome: Outcome, body: &impl Serialize, text: impl Into<String>) -> miette::Result<Self> {
        let json = serde_json::to_value(body)
            .map_err(|error| miette::miette!("the answer cannot be written as JSON: {error}"))?;
        Ok(Self { outcome, json, text: text.into() })
    }

    /// Adds a value to the JSON.
    pub fn with(mut self, key: &str, value: impl Serialize) -> Self {
        self.json[key] = serde_json::json!(value);
        self
    }

    /// Creates an answer with the part that was done before the error `report`, which is printed and added to the JSON.
    ///
    /// # Errors
    /// If `body` cannot be represented in JSON.
    pub fn failed(body: &impl Serialize, report: &Report) -> miette::Result<Self> {
        let answer = Self::new(Outcome::Failed, body, "")?;
        eprint(describe(report.as_ref()));
        let error = error_json(report);
        Ok(answer.with("error", &error["error"]).with("help", &error["help"]))
    }
}

/// Prints `result` and returns the exit code.
pub(super) fn finish(result: miette::Result<Answer>, json: bool) -> ExitCode {
    let code = exit_code(&result);
    let output = match &result {
        Ok(answer) if json => escaped(&answer.json),
        Ok(answer) => printable(&answer.text),
        Err(report) => {
            eprint(describe(report.as_ref()));
            if json { escaped(&error_json(report)) } else { String::new() }
        }
    };
    print(&output, code)
}

/// Prints the help, or why the command line is wrong, and returns the exit code.
pub(super) fn not_parsed(error: clap::Error, json: bool) -> ExitCode {
    let error = usage::with_hint(error);
    // 2 on wrong use, and 0 after --help and --version.
    let code = if error.use_stderr() { 2 } else { 0 };
    let printed = error.print();
    if code == 0 {
        return end(printed, code);
    }
    print(&if json { escaped(&usage::json(&error.render().to_string())) } else { String::new() }, code)
}

/// Prints the output on stdout, unless there is none, and returns the exit code.
fn print(output: &str, code: u8) -> ExitCode {
    match output.trim_end() {
        "" => ExitCode::from(code),
        output => {
            let output = format!("{output}\n");
            end(patiently(move || colour::print(&output)).unwrap_or(Ok(())), code)
        }
    }
}

fn eprint(text: String) {
    patiently(move || colour::eprint(&text));
}

/// Writes the rest of an output on a separate thread; returns `None` if an interruption ended the wait for it.
fn patiently<T: Send + 'static>(write: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    let (sender, written) = channel();
    thread::spawn(move || sender.send(write()));
    loop {
        match written.recv_timeout(PATIENCE) {
            Ok(result) => return Some(result),
            Err(RecvTimeoutError::Timeout) if !is_interrupted() => {}
            Err(_) => return None,
        }
    }
}

/// Returns the exit code after the output was printed.
fn end(printed: io::Result<()>, code: u8) -> ExitCode {
    match printed {
        // A reader such as `head` may close the pipe early.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            let _ = writeln!(io::stderr(), "error: stdout: {error}");
            // An interrupted command stays interrupted: its terminal may have closed.
            ExitCode::from(if [0, 3].contains(&code) { 1 } else { code })
        }
        _ => ExitCode::from(code),
    }
}

/// Formats JSON without characters that control a terminal.
fn escaped(value: &serde_json::Value) -> String {
    json_without(value, &[])
}

fn exit_code(result: &miette::Result<Answer>) -> u8 {
    match result {
        Ok(answer) => match answer.outcome {
            Outcome::Done => 0,
            Outcome::Failed => 1,
            Outcome::WithLoss => 3,
            Outcome::Interrupted => INTERRUPTED,
        },
        Err(report) if report.code().is_some_and(|code| code.to_string() == WRONG_USE) => 2,
        Err(_) => 1,
    }
}

fn error_json(report: &Report) -> serde_json::Value {
    serde_json::json!({
        "error": with_causes(report.as_ref()).join(": "),
        "help": report.help().map(|help| help.to_string()),
    })
}

/// Describes an error, its causes, and its fix.
fn describe(error: &dyn Diagnostic) -> String {
    // A message of several lines, perhaps of a file's text, is indented, so that it cannot pass for another error.
    let indented = |text: &str| text.trim_end().replace('\n', "\n    ");
    let messages: Vec<_> = with_causes(error).iter().map(|message| indented(message)).collect();
    let mut text = format!("error: {}\n", messages.join("\n  because: "));
    if let Some(help) = error.help() {
        text += &format!("  help: {}\n", indented(&help.to_string()));
    }
    printable(&text)
}

/// Returns a finding as a line, with its log if the command names several.
pub fn finding_line(log: Option<&str>, finding: &Finding) -> String {
    let label = if finding.grave { "warning" } else { "note" };
    let log = log.map_or_else(String::new, |log| format!("{log}: "));
    format!("{label}: {log}{finding}")
}

/// Returns findings about several logs as lines that begin with a line end.
pub fn lines_of_logs(findings: &[LogFinding]) -> String {
    findings.iter().map(|of_log| format!("\n{}", finding_line(Some(&of_log.log), &of_log.finding))).collect()
}

/// Returns whether none of the findings is grave.
pub fn are_slight(findings: &[LogFinding]) -> bool {
    !findings.iter().any(|of_log| of_log.finding.grave)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error, Diagnostic)]
    #[error("plan.toml:3: no such speed")]
    #[diagnostic(code(wrong_use), help("give a speed"))]
    struct Wrong {
        #[source]
        cause: std::io::Error,
    }

    #[test]
    fn exit_codes_follow_the_convention() {
        let answer = |outcome| Answer::new(outcome, &(), "");
        assert_eq!(exit_code(&answer(Outcome::Done)), 0);
        assert_eq!(exit_code(&answer(Outcome::WithLoss)), 3);
        assert_eq!(exit_code(&answer(Outcome::Interrupted)), 130);
        assert_eq!(exit_code(&Err(miette::miette!("it broke"))), 1);
        assert_eq!(exit_code(&Err(miette::miette!(code = WRONG_USE, "not so"))), 2);
    }

    #[test]
    fn error_text_has_cause_and_help() {
        let report: Report = Wrong { cause: std::io::Error::other("it is gone") }.into();
        assert_eq!(
            describe(report.as_ref()),
            "error: plan.toml:3: no such speed\n  because: it is gone\n  help: give a speed\n"
        );
        assert_eq!(exit_code(&Err(report)), 2);
    }
}
