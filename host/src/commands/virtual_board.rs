//! Starts the emulated board for a command.

use super::answer::WRONG_USE;
use super::{Answer, Outcome};
use crate::image;
use crate::run::rig::{VirtualError, VirtualNano};
use std::ffi::OsString;

/// What the board's program says first when an option has a wrong value.
const INVALID_VALUE: &str = "error: invalid value";

/// Starts the emulated board with the firmware that belongs to this program, these arguments and these faults.
pub(super) fn start(mut arguments: Vec<OsString>, faults: &[String]) -> miette::Result<VirtualNano> {
    let image = image::of_program()?;
    arguments.extend(["--firmware".into(), image.elf.clone().into_os_string()]);
    for fault in faults {
        arguments.extend(["--fault".into(), fault.into()]);
    }
    VirtualNano::start(&VirtualNano::program()?, arguments).map_err(|error| match error {
        // The board's program checks the values of its own options.
        VirtualError::NotStarted(reason) if reason.starts_with(INVALID_VALUE) => {
            let problem = reason.lines().next().unwrap_or_default().trim_start_matches("error: ");
            miette::miette!(code = WRONG_USE, "{problem}")
        }
        other => other.into(),
    })
}

/// Lists the faults that the emulated board knows.
pub(super) fn list_faults() -> miette::Result<Answer> {
    let output = std::process::Command::new(VirtualNano::program()?)
        .args(["--fault", "help"])
        .output()
        .map_err(|error| VirtualError::NotStarted(error.to_string()))?;
    let text = String::from_utf8_lossy(&output.stdout).trim_end().to_owned();
    Answer::new(Outcome::Done, &serde_json::json!({ "faults": text }), text)
}
