//! Starts the emulated board for a command.

use super::answer::{Answer, Outcome, WRONG_USE};
use crate::plan::RobotFile;
use crate::run::rig::{VirtualError, VirtualNano};
use crate::{image, link};
use miette::{IntoDiagnostic, WrapErr};
use std::ffi::OsString;
use std::io::Write;
use tempfile::{NamedTempFile, TempPath};

/// Options of the emulated sensor, for commands with an option `--virtual`.
#[derive(clap::Args, PartialEq, Debug, Default)]
pub(super) struct SensorArgs {
    /// Errors of the emulated sensor and of the board's clock [default: typical]: `typical` draws all that the MPU6050's
    /// data sheet allows; `ideal` has exact scales, axes and clocks, and biases that drift; a file gives each of them.
    /// `help` prints such a file.
    #[arg(long, value_name = "ideal|typical|FILE.toml", requires = "virtual")]
    pub sensor: Option<String>,
    /// Seed of the errors of the emulated sensor: the same seed is the same part, in every trial and command. By default
    /// the plan's seed, or 1.
    #[arg(long, requires = "virtual")]
    seed: Option<u64>,
}

impl SensorArgs {
    /// Returns the seed; `seed_of_plan` is used if none was given.
    pub(super) fn seed(&self, seed_of_plan: Option<u64>) -> u64 {
        self.seed.or(seed_of_plan).unwrap_or(1)
    }

    /// Returns the arguments for the board's program.
    pub(super) fn arguments(&self, seed_of_plan: Option<u64>) -> Vec<OsString> {
        let seed = ["--seed".into(), self.seed(seed_of_plan).to_string().into()];
        let sensor = self.sensor.iter().flat_map(|sensor| ["--sensor".into(), sensor.into()]);
        seed.into_iter().chain(sensor).collect()
    }
}

/// Longest wait of the emulated board's time for this program, s. Its link is never silent (see [`rig::link`]) unless the
/// computer is busy or the program is stopped, and neither should end a trial.
const PATIENCE_S: &str = "60";

/// The beginning of the message of the board's program about a wrong value of an option.
const INVALID_VALUE: &str = "invalid value";

/// Starts the emulated board with the firmware that belongs to this program, these arguments and these faults.
pub(super) fn start(mut arguments: Vec<OsString>, faults: &[String]) -> miette::Result<VirtualNano> {
    let program = VirtualNano::program()?;
    let image = image::of_program()?;
    arguments.extend(["--firmware".into(), image.elf.clone().into_os_string()]);
    arguments.extend(["--patience".into(), PATIENCE_S.into()]);
    arguments.extend(faults.iter().flat_map(|fault| ["--fault".into(), fault.into()]));
    VirtualNano::start(&program, arguments).map_err(|error| match error {
        // The board's program checks the values of its own options.
        VirtualError::NotStarted(reason) if reason.starts_with(INVALID_VALUE) => {
            let problem = reason.lines().next().unwrap_or_default().replace("vnano --fault", "biflag record --fault");
            miette::miette!(code = WRONG_USE, "{problem}")
        }
        other => other.into(),
    })
}

/// Returns the serial port of the emulated board if there is one, otherwise the chosen one.
///
/// # Errors
/// As [`link::choose_port`].
pub(super) fn port(nano: Option<&VirtualNano>, chosen: Option<&str>) -> miette::Result<String> {
    nano.map_or_else(|| Ok(link::choose_port(chosen)?), |nano| Ok(nano.port().to_owned()))
}

/// Returns the argument for the robot behind the board, and the file that it names until it is dropped.
pub(super) fn robot(robot: &RobotFile) -> miette::Result<(OsString, Option<TempPath>)> {
    if robot.text.is_empty() {
        return Ok((robot.name.clone().into(), None));
    }
    let written = NamedTempFile::with_suffix(".toml").and_then(|mut file| {
        file.write_all(robot.text.as_bytes())?;
        Ok(file.into_temp_path())
    });
    let file = written.into_diagnostic().wrap_err("the robot cannot be written to a temporary file")?;
    Ok((file.as_os_str().to_owned(), Some(file)))
}

/// Returns the answer to `--fault help`, the faults that the emulated board knows, or to `--sensor help`, a file with all errors
/// of its sensor, if one of them was asked for.
pub(super) fn help(faults: &[String], sensor: Option<&SensorArgs>) -> Option<miette::Result<Answer>> {
    let is_help = |value: &String| value == "help";
    if faults.iter().any(is_help) {
        return Some(help_of("--fault", "faults"));
    }
    sensor?.sensor.as_ref().is_some_and(is_help).then(|| help_of("--sensor", "sensor"))
}

/// Returns the help of the board's program on the values of an option, under a key.
fn help_of(option: &str, key: &str) -> miette::Result<Answer> {
    let output = std::process::Command::new(VirtualNano::program()?)
        .args([option, "help"])
        .output()
        .map_err(|error| VirtualError::NotStarted(error.to_string()))?;
    let text = String::from_utf8_lossy(&output.stdout).trim_end().to_owned();
    Answer::new(Outcome::Done, &serde_json::json!({ key: text }), text)
}
