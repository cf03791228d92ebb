//! The emulated board: a separate program (`vnano`), controlled over its standard input and output.

use biflag_log::SensorMeta;
use miette::Diagnostic;
use serde::Deserialize;
use serde_json::Value;
use sim::trial::sample::Sample;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{ChildStdin, Command, Stdio};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};
use study::text::{hex, printable};
use system::children::{Family, lines};
use thiserror::Error;

/// Name of the board's program.
const PROGRAM: &str = "vnano";

/// Longest wait for a response. The program answers within milliseconds, unless it is stopped or the computer is busy.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Longest wait for a response while the program waits for a processor or the disk.
const BUSY_TIMEOUT: Duration = Duration::from_secs(60);

/// Longest waits for the program to start, which includes reading the image, and to end.
const START_TIMEOUT: Duration = Duration::from_secs(30);
const END_TIMEOUT: Duration = Duration::from_secs(5);

/// Errors of the emulated board.
#[derive(Debug, Error, Diagnostic)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum VirtualError {
    /// The emulated board does not run on this system.
    #[error("the emulated board runs on Linux only")]
    #[diagnostic(code(wrong_use), help("run this on Linux, such as WSL, the Linux inside Windows"))]
    NotHere,
    /// The program does not exist.
    #[error("the program of the emulated board is missing: neither {0} nor a vnano on the PATH")]
    #[diagnostic(help("build it with `make build` in the repository, or copy vnano beside biflag"))]
    NotBuilt(PathBuf),
    /// The program could not be started.
    #[error("the emulated board did not start: {0}")]
    NotStarted(String),
    /// The program ended or does not respond.
    #[error("the emulated board no longer responds to `{0}`")]
    Gone(String),
    /// The program refused a command.
    #[error("the emulated board refused `{command}`: {reason}")]
    Refused { command: String, reason: String },
    /// The simulated robot behind it failed.
    #[error("{0}")]
    #[diagnostic(help("the log ends there; change the robot's file as suggested, and start another session with it"))]
    Robot(String),
}

/// The state of the simulated robot at a time.
#[derive(Clone, Deserialize, PartialEq, Debug)]
pub struct TruthSample {
    /// The board's clock, µs modulo 2^32; `None` before the board has started.
    pub board_us: Option<u32>,
    /// The state. Its time is counted from the board's power-on.
    pub sample: Sample,
}

/// A movement of the emulated hand that holds the sensor. Times are the board's, from its power-on.
#[derive(Clone, Copy, Deserialize, PartialEq, Debug)]
pub struct HandMovement {
    /// Start of the movement, after all earlier ones.
    pub begin_s: f64,
    /// End of the movement.
    pub end_s: f64,
    /// Error of the stop: the rotation vector from the nominal attitude to the real one, body axes. Errors of
    /// successive movements do not add up.
    pub off_deg: [f64; 3],
}

/// A running emulated board. Dropping it ends its program.
#[derive(Debug)]
pub struct VirtualNano {
    program: Family,
    control: Option<ChildStdin>,
    /// The lines that the program prints, read by a separate thread: a stopped program must not block this one.
    answers: Receiver<String>,
    port: String,
    /// The errors of its sensor.
    pub sensor: SensorMeta,
}

impl VirtualNano {
    /// Starts the board's program with these arguments (see `vnano --help`).
    ///
    /// # Errors
    /// [`VirtualError::NotStarted`] with the output of the program.
    pub fn start(program: &Path, arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Result<Self, VirtualError> {
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // Ctrl-C on the terminal is for this program, which still needs the board to end the trial.
        let mut program = Family::start(&mut command)
            .map_err(|error| VirtualError::NotStarted(format!("{}: {error}", program.display())))?;
        let control = program.child.stdin.take();
        let stdout = program.child.stdout.take().ok_or_else(|| VirtualError::NotStarted("it has no output".into()))?;
        let answers = lines(stdout, u64::MAX);
        let mut nano = Self { program, control, answers, port: String::new(), sensor: SensorMeta::default() };
        let ready = nano.hear(START_TIMEOUT).unwrap_or_default();
        let Some(port) = ready["port"].as_str() else {
            let _ = nano.program.child.kill();
            let said = nano.program.child.stderr.take().map(std::io::read_to_string);
            let said = said.and_then(Result::ok).unwrap_or_default();
            return Err(VirtualError::NotStarted(said.trim().trim_start_matches("error: ").to_owned()));
        };
        nano.port = port.to_owned();
        nano.sensor = serde_json::from_value(ready["sensor"].clone()).unwrap_or_default();
        // Later warnings of the program go to this program's standard error, so the pipe does not fill up.
        if let Some(stderr) = nano.program.child.stderr.take() {
            std::thread::spawn(move || {
                BufReader::new(stderr).lines().map_while(Result::ok).for_each(|line| {
                    let _ = writeln!(std::io::stderr(), "{}", printable(&line));
                })
            });
        }
        Ok(nano)
    }

    /// Returns the pseudo-terminal that serves as the board's serial port.
    pub fn port(&self) -> &str {
        &self.port
    }

    /// Turns the sensor, as if by hand, about its body axis `x`, `y` or `z`, within `length_s` of the board's time.
    /// Returns immediately. Only a board without robot and recording has a hand.
    ///
    /// # Errors
    /// As [`VirtualNano::control`].
    pub fn turn(&mut self, axis: char, angle_deg: f64, length_s: f64) -> Result<HandMovement, VirtualError> {
        self.move_by_hand(&format!("turn {axis} {angle_deg} {length_s}"))
    }

    /// Turns the sensor, as if by hand, into a pose, within `length_s` of the board's time. `pose` is the body axis to
    /// point up, such as `+x` or `-z`, or the quaternion `W,X,Y,Z` from body axes to the world's. Returns immediately.
    ///
    /// # Errors
    /// As [`VirtualNano::control`].
    pub fn pose(&mut self, pose: &str, length_s: f64) -> Result<HandMovement, VirtualError> {
        self.move_by_hand(&format!("pose {pose} {length_s}"))
    }

    /// Returns whether the hand has movements left.
    ///
    /// # Errors
    /// As [`VirtualNano::control`].
    pub fn is_moving(&mut self) -> Result<bool, VirtualError> {
        Ok(self.control("status")?["moving"].as_bool().unwrap_or_default())
    }

    fn move_by_hand(&mut self, command: &str) -> Result<HandMovement, VirtualError> {
        let answer = self.control(command)?;
        serde_json::from_value(answer).map_err(|error| VirtualError::Refused {
            command: command.to_owned(),
            reason: format!("its answer cannot be read: {error}"),
        })
    }

    /// Returns the samples of the simulated robot since the last call.
    ///
    /// # Errors
    /// [`VirtualError::Robot`] if the simulator failed; otherwise as [`VirtualNano::control`].
    pub fn truth(&mut self) -> Result<Vec<TruthSample>, VirtualError> {
        let mut answer = self.control("truth").map_err(|error| match error {
            VirtualError::Refused { reason, .. } => VirtualError::Robot(reason),
            other => other,
        })?;
        serde_json::from_value(answer["samples"].take())
            .map_err(|error| VirtualError::Robot(format!("the simulated robot's state cannot be read: {error}")))
    }

    /// Sends bytes to a board started with `--speed exchange`, advances it by `time_us`, and returns the bytes that it
    /// sent.
    ///
    /// # Errors
    /// As [`VirtualNano::control`].
    pub fn exchange(&mut self, bytes: &[u8], time_us: u64) -> Result<Vec<u8>, VirtualError> {
        let command = format!("exchange {time_us} {}", hex(bytes));
        let answer = self.control(command.trim_end())?;
        let digits = answer["hex"].as_str().unwrap_or_default().as_bytes();
        let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
        digits.chunks(2).map(byte).collect::<Option<_>>().ok_or(VirtualError::Gone(command))
    }

    /// Sends one control command and returns the program's response.
    ///
    /// # Errors
    /// [`VirtualError::Gone`] or [`VirtualError::Refused`].
    pub fn control(&mut self, command: &str) -> Result<Value, VirtualError> {
        let gone = || VirtualError::Gone(command.to_owned());
        let control = self.control.as_mut().ok_or_else(gone)?;
        writeln!(control, "{command}").and_then(|()| control.flush()).map_err(|_| gone())?;
        let asked = Instant::now();
        let mut answer = self.hear(TIMEOUT);
        while answer.is_none() && self.program.is_held_up() && asked.elapsed() < BUSY_TIMEOUT {
            answer = self.hear(TIMEOUT);
        }
        let Some(answer) = answer else {
            // A late answer would be taken for the answer to the next command.
            self.control = None;
            return Err(gone());
        };
        match answer["error"].as_str() {
            Some(reason) => Err(VirtualError::Refused { command: command.to_owned(), reason: reason.to_owned() }),
            None => Ok(answer),
        }
    }

    /// Returns the path of the board's program, which is in the folder of this program or on the `PATH`.
    ///
    /// # Errors
    /// [`VirtualError::NotHere`] or [`VirtualError::NotBuilt`].
    pub fn program() -> Result<PathBuf, VirtualError> {
        if !system::port::CAN_BE_EMULATED {
            return Err(VirtualError::NotHere);
        }
        let beside = std::env::current_exe().unwrap_or_default().with_file_name(PROGRAM);
        let search = std::env::var_os("PATH").unwrap_or_default();
        let others = std::env::split_paths(&search).map(|folder| folder.join(PROGRAM));
        let found = std::iter::once(beside.clone()).chain(others).find(|path| path.is_file());
        found.ok_or(VirtualError::NotBuilt(beside))
    }

    /// Waits for a response; returns `None` if none arrives in time or the program has ended.
    fn hear(&mut self, timeout: Duration) -> Option<Value> {
        serde_json::from_str(&self.answers.recv_timeout(timeout).ok()?).ok()
    }
}

impl Drop for VirtualNano {
    fn drop(&mut self) {
        // The program ends with its standard input.
        self.control = None;
        // A stopped program does not end by itself.
        self.program.end(END_TIMEOUT);
    }
}
