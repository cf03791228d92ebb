//! A pilot in another program, which reads a line of JSON with the observation and writes a line with two speeds.
//!
//! ```text
//! {"time_s":12.35,"wanted_yaw_deg":-67.0,"wanted_pitch_deg":-4.0,"yaw_deg":-61.2,"pitch_deg":-3.1,"roll_deg":-4.0,
//!  "rates_dps":[0.1,-2.0,-3.4],"speeds_rpm":[49.8,10.1],"turns":[10.2,2.0],"mean_yaw_deg":-60.8,"mean_pitch_deg":-3.9}
//! {"speeds_rpm":[50,10]}
//! ```
//!
//! The line `{"end":true}` ends the run early. Each message is a single line; the first is broken here for reading. The
//! program starts before the trial and receives its first observation when the run begins. Its standard input ends with
//! the run. Its standard error is shown.
//!
//! A program that starts `biflag` itself can be its policy ([`Policy::own`]): it reads the observations from the standard
//! output of `biflag` and writes the speeds to its standard input.

use super::{Observation, SteerError};
use crate::text::printable;
use protocol::units::CentiRpm;
use serde::Deserialize;
use std::io::{Write, stdin, stdout};
use std::process::Stdio;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use system::children::{Family, lines};
use system::shell;

/// Longest line that is read, bytes; a longer line is an error.
const LONGEST_LINE: u64 = 4096;

/// Characters of a wrong line that an error shows.
const SHOWN: usize = 80;

/// Time that a policy has to exit after the end of its standard input.
const END_TIMEOUT: Duration = Duration::from_millis(500);

/// Limit for a policy's first line: it may have to load a network.
const FIRST: Duration = Duration::from_secs(60);

/// Limit for each further line on a rig, where the motors turn meanwhile: shorter than the board's own deadline.
pub const PATIENCE_OF_RIG: Duration = Duration::from_millis(400);

/// Limit for each further line in the model, which waits meanwhile.
pub const PATIENCE_OF_MODEL: Duration = Duration::from_secs(60);

/// A policy's line.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Reply {
    #[serde(default)]
    speeds_rpm: Option<[f64; 2]>,
    #[serde(default)]
    end: bool,
}

/// A program that gives the speeds. Dropping it ends the program.
pub struct Policy {
    /// `None` for the program that started this one.
    program: Option<Family>,
    /// Takes the observations; `None` once the program has ended.
    input: Option<Box<dyn Write + Send>>,
    /// Its lines, read by a separate thread: a program that hangs must not block this one.
    lines: Receiver<String>,
    patience: Duration,
    /// When the unanswered observation was sent.
    asked: Option<Instant>,
    has_answered: bool,
}

impl Policy {
    /// Starts the command in a shell.
    ///
    /// # Errors
    /// [`SteerError::NotStarted`].
    pub fn start(command: &str, patience: Duration) -> Result<Self, SteerError> {
        // Ctrl-C must only reach this program, which then stops the motors.
        let mut program = Family::start(shell::command(command).stdin(Stdio::piped()).stdout(Stdio::piped()))
            .map_err(|source| SteerError::NotStarted { command: command.to_owned(), source })?;
        let input = program.child.stdin.take().map(|input| Box::new(input) as _);
        let lines = program.child.stdout.take().map_or_else(|| channel().1, |output| lines(output, LONGEST_LINE));
        Ok(Self { program: Some(program), input, lines, patience, asked: None, has_answered: false })
    }

    /// Returns the program that started this one as a policy: it gets the observations from the standard output of this
    /// program and writes the speeds to its standard input.
    pub fn own(patience: Duration) -> Self {
        let input: Option<Box<dyn Write + Send>> = Some(Box::new(stdout()));
        Self { program: None, input, lines: lines(stdin(), LONGEST_LINE), patience, asked: None, has_answered: false }
    }

    /// Sends an observation.
    ///
    /// # Errors
    /// [`SteerError::Unasked`] if a line has already arrived, [`SteerError::Ended`].
    pub fn ask(&mut self, observation: &Observation) -> Result<(), SteerError> {
        if let Ok(line) = self.lines.try_recv() {
            return Err(SteerError::Unasked { line: beginning(&line) });
        }
        let line = serde_json::to_string(observation).unwrap_or_default();
        let sent = self.input.as_mut().map(|input| writeln!(input, "{line}").and_then(|()| input.flush()));
        if !matches!(sent, Some(Ok(()))) {
            return Err(self.ended());
        }
        self.asked = Some(Instant::now());
        Ok(())
    }

    /// Returns the speeds (rpm) for the last observation; `None` if they do not arrive within this time.
    ///
    /// # Errors
    /// [`SteerError::Silent`] after the time limit, and the errors of its line.
    pub fn answer(&mut self, within: Duration) -> Result<Option<[f64; 2]>, SteerError> {
        let Some(asked) = self.asked else { return Ok(None) };
        let allowed = if self.has_answered { self.patience } else { FIRST };
        let left = allowed.saturating_sub(asked.elapsed());
        match self.lines.recv_timeout(within.min(left)) {
            Ok(line) => {
                (self.asked, self.has_answered) = (None, true);
                parse(&line).map(Some)
            }
            Err(RecvTimeoutError::Timeout) if asked.elapsed() >= allowed => {
                Err(SteerError::Silent { waited_s: allowed.as_secs_f64() })
            }
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(self.ended()),
        }
    }

    /// Returns the error for a program that has ended, or has closed its output.
    fn ended(&mut self) -> SteerError {
        self.input = None;
        let status = self.program.as_mut().and_then(|program| program.wait(END_TIMEOUT));
        SteerError::Ended { status: status.map(|status| status.to_string()) }
    }
}

impl Drop for Policy {
    fn drop(&mut self) {
        self.input = None;
        if let Some(program) = &mut self.program {
            program.end(END_TIMEOUT);
        }
    }
}

fn parse(line: &str) -> Result<[f64; 2], SteerError> {
    let nonsense = |reason: String| SteerError::Nonsense { line: beginning(line), reason };
    let Reply { speeds_rpm, end } = serde_json::from_str(line).map_err(|error| nonsense(error.to_string()))?;
    if end {
        return Err(SteerError::Over);
    }
    let Some(rpm) = speeds_rpm else { return Err(nonsense("it has no speeds_rpm".to_owned())) };
    if rpm.iter().any(|rpm| !rpm.is_finite()) {
        return Err(nonsense("a speed is not finite".to_owned()));
    }
    if rpm.iter().any(|rpm| rpm.abs() > CentiRpm::LIMIT.rpm()) {
        return Err(SteerError::OffTheLine { rpm });
    }
    Ok(rpm)
}

/// Returns the beginning of a line, without characters that control a terminal.
fn beginning(line: &str) -> String {
    printable(&line.chars().take(SHOWN).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::super::{Measured, Wanted};
    use super::*;

    const PATIENCE: Duration = Duration::from_secs(2);

    fn observation(time_s: f64) -> Observation {
        let wanted = Wanted { yaw_deg: -67.0, pitch_deg: -4.0 };
        let measured = Measured { yaw_deg: -1.5, rates_dps: [0.0, 0.0, -3.0], ..Measured::default() };
        Observation { time_s, wanted, measured, mean_yaw_deg: -0.5, mean_pitch_deg: 0.0 }
    }

    /// Asks a policy `count` times, and returns the answer to the last observation.
    fn answer(command: &str, count: u32) -> Result<[f64; 2], SteerError> {
        let mut policy = Policy::start(command, PATIENCE)?;
        let mut last = [f64::NAN; 2];
        for i in 0..count {
            policy.ask(&observation(f64::from(i)))?;
            last = loop {
                if let Some(rpm) = policy.answer(Duration::from_millis(50))? {
                    break rpm;
                }
            };
        }
        Ok(last)
    }

    #[test]
    fn keys_of_an_observation_have_units() {
        let line = serde_json::to_string(&observation(2.0)).unwrap();
        assert_eq!(
            line,
            "{\"time_s\":2.0,\"wanted_yaw_deg\":-67.0,\"wanted_pitch_deg\":-4.0,\"yaw_deg\":-1.5,\"pitch_deg\":0.0,\
             \"roll_deg\":0.0,\"rates_dps\":[0.0,0.0,-3.0],\"speeds_rpm\":[0.0,0.0],\"turns\":[0.0,0.0],\
             \"mean_yaw_deg\":-0.5,\"mean_pitch_deg\":0.0}"
        );
    }

    #[test]
    fn shell_script_can_steer() {
        assert_eq!(answer("while read line; do echo '{\"speeds_rpm\": [50, -10.5]}'; done", 3).unwrap(), [50.0, -10.5]);
    }

    #[test]
    fn each_wrong_answer_is_an_error_that_names_it() {
        let once = |line: &str| format!("read line; echo '{line}'; sleep 60");
        let failed = |command: &str, count| answer(command, count).unwrap_err().to_string();
        assert!(failed("exit 3", 1).contains("exit status: 3"));
        assert!(failed("read line; kill -9 $$", 1).contains("signal: 9"));
        assert_eq!(failed(&once("{\"speeds_rpm\": [5, 5]}"), 2), "the policy gave no speeds within 2 s");
        for (line, word) in [
            ("hello", "hello"),
            ("{}", "no speeds_rpm"),
            ("{\"end\": true}", "ended the run"),
            ("{\"speeds_rpm\": [NaN, 1]}", "NaN"),
            ("{\"speeds_rpm\": [1e999, 1]}", "1e999"),
            ("{\"speeds_rpm\": [1]}", "length"),
            ("{\"speeds_rpm\": [1, 2, 3]}", "trailing"),
            ("{\"speed\": [1, 2]}", "unknown field"),
            ("{\"speeds_rpm\": [90.1, 0]}", "at most at 90 rpm"),
        ] {
            let error = failed(&once(line), 1);
            assert!(error.contains(word), "{line}: {error}");
        }
        let twice =
            "while read line; do echo '{\"speeds_rpm\": [1, 1]}'; echo '{\"speeds_rpm\": [2, 2]}'; sleep 0.1; done";
        // On a busy computer, the second line may arrive after the next observation and be taken for its answer.
        assert!(failed(twice, 60).contains("more than one line"));
    }

    #[test]
    fn endless_output_without_a_line_is_nonsense() {
        let error = answer("read line; yes | tr -d '\\n'", 1).unwrap_err();
        assert!(matches!(error, SteerError::Nonsense { .. }), "{error}");
    }

    #[test]
    fn program_ends_with_its_children() {
        let begun = Instant::now();
        let mut policy = Policy::start("sleep 1000 & wait", PATIENCE).unwrap();
        let output = std::mem::replace(&mut policy.lines, channel().1);
        drop(policy);
        assert!(begun.elapsed() < Duration::from_secs(10));
        // The output ends when no program has it open any more.
        assert_eq!(output.recv_timeout(Duration::from_secs(10)), Err(RecvTimeoutError::Disconnected));
    }
}
