//! The emulated board: a program of its own (`vnano`), started and led over its standard input and output.

use miette::Diagnostic;
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use thiserror::Error;

/// Why there is no emulated board.
#[derive(Debug, Error, Diagnostic)]
pub enum VirtualError {
    /// The program is not there.
    #[error("the emulated board is not built: there is no {0}")]
    #[diagnostic(help("build it with `make build` in Biflag's repository"))]
    NotBuilt(PathBuf),
    /// The program does not start.
    #[error("the emulated board did not start: {0}")]
    NotStarted(String),
    /// The program ended or does not answer.
    #[error("the emulated board does not answer `{0}` any more")]
    Gone(String),
    /// The program refused.
    #[error("the emulated board refused `{command}`: {reason}")]
    Refused {
        /// What was asked.
        command: String,
        /// Why not.
        reason: String,
    },
}

/// A running emulated board; dropping it ends its program.
#[derive(Debug)]
pub struct VirtualNano {
    child: Child,
    control: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
    port: String,
}

impl VirtualNano {
    /// Starts the board's program with its own arguments (`vnano --help` lists them).
    ///
    /// # Errors
    /// [`VirtualError::NotStarted`] with what the program said.
    pub fn start<I, S>(program: &Path, arguments: I) -> Result<Self, VirtualError>
    where
        I: IntoIterator<Item = S>,
        S: AsRef<std::ffi::OsStr>,
    {
        let not_started = |reason: String| VirtualError::NotStarted(reason);
        let mut child = Command::new(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| not_started(format!("{}: {error}", program.display())))?;
        let control = child.stdin.take();
        let stdout = child.stdout.take().ok_or_else(|| not_started("it has no output".into()))?;
        let mut nano = Self { child, control, answers: BufReader::new(stdout), port: String::new() };
        match nano.hear().as_ref().and_then(|ready| ready["port"].as_str()) {
            Some(port) => nano.port = port.to_owned(),
            None => {
                let _ = nano.child.kill();
                let mut said = String::new();
                if let Some(mut stderr) = nano.child.stderr.take() {
                    let _ = std::io::Read::read_to_string(&mut stderr, &mut said);
                }
                return Err(not_started(said.trim().to_owned()));
            }
        }
        // The program's later warnings belong on our own standard error, not in a pipe that fills up.
        if let Some(stderr) = nano.child.stderr.take() {
            std::thread::spawn(move || {
                BufReader::new(stderr).lines().map_while(Result::ok).for_each(|line| {
                    let _ = writeln!(std::io::stderr(), "{line}");
                })
            });
        }
        Ok(nano)
    }

    /// The pseudo-terminal that stands for the board's serial port.
    pub fn port(&self) -> &str {
        &self.port
    }

    /// Sends one control command, and answers what the program says to it.
    ///
    /// # Errors
    /// [`VirtualError::Gone`] or [`VirtualError::Refused`].
    pub fn control(&mut self, command: &str) -> Result<Value, VirtualError> {
        let gone = || VirtualError::Gone(command.to_owned());
        let control = self.control.as_mut().ok_or_else(gone)?;
        writeln!(control, "{command}").and_then(|()| control.flush()).map_err(|_| gone())?;
        let answer = self.hear().ok_or_else(gone)?;
        match answer["error"].as_str() {
            Some(reason) => Err(VirtualError::Refused { command: command.to_owned(), reason: reason.to_owned() }),
            None => Ok(answer),
        }
    }

    /// The board's program, beside this one.
    ///
    /// # Errors
    /// [`VirtualError::NotBuilt`].
    pub fn program() -> Result<PathBuf, VirtualError> {
        let path = std::env::current_exe().unwrap_or_default().with_file_name("vnano");
        if path.is_file() { Ok(path) } else { Err(VirtualError::NotBuilt(path)) }
    }

    fn hear(&mut self) -> Option<Value> {
        let mut line = String::new();
        self.answers.read_line(&mut line).ok().filter(|read| *read > 0)?;
        serde_json::from_str(&line).ok()
    }
}

impl Drop for VirtualNano {
    fn drop(&mut self) {
        // The program ends with its standard input.
        self.control = None;
        let _ = self.child.wait();
    }
}
