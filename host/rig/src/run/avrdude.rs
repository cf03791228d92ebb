//! Writes a firmware image with avrdude through the bootloader.

use miette::Diagnostic;
use std::io;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use thiserror::Error;

/// Speeds of the Nano's bootloaders, bit/s: optiboot, and the old one that is still common on clones.
const BOOTLOADER_BAUDS: [u32; 2] = [115_200, 57_600];

/// Limits the wait at a wrong speed to 15 s instead of 60 s; avrdude before 7.0 does not support it.
const FEW_ATTEMPTS: [&str; 2] = ["-x", "attempts=3"];

/// Why the image could not be written.
#[derive(Debug, Error, Diagnostic)]
pub enum FlashError {
    /// avrdude is not installed.
    #[error("avrdude is not installed")]
    #[diagnostic(help("install it with `sudo apt install avrdude`"))]
    NotInstalled,
    /// avrdude could not be run.
    #[error("avrdude could not be run: {0}")]
    NotRun(io::Error),
    /// No bootloader answered.
    #[error("no bootloader accepted the image on {port}, at 115200 or 57600 bit/s; output of avrdude:\n{said}")]
    #[diagnostic(help("check the cable, unplug and replug the board, and try again"))]
    NoBootloader {
        /// The port.
        port: String,
        /// The last output of avrdude.
        said: String,
    },
}

/// Writes the image, trying the speed of each bootloader; `progress` is called with the speed of each attempt. Returns
/// the speed that worked.
///
/// # Errors
/// [`FlashError`].
pub fn flash(port: &str, elf: &Path, mut progress: impl FnMut(u32)) -> Result<u32, FlashError> {
    let mut said = String::new();
    let mut options: &[&str] = &FEW_ATTEMPTS;
    let mut bauds = BOOTLOADER_BAUDS.into_iter().peekable();
    while let Some(baud) = bauds.peek().copied() {
        progress(baud);
        let output = run(port, elf, baud, options)?;
        if output.status.success() {
            return Ok(baud);
        }
        said = String::from_utf8_lossy(&output.stderr).into_owned();
        if !options.is_empty() && said.contains("extended parameter") {
            options = &[];
        } else {
            bauds.next();
        }
    }
    Err(FlashError::NoBootloader { port: port.to_owned(), said: said.trim().to_owned() })
}

fn run(port: &str, elf: &Path, baud: u32, options: &[&str]) -> Result<Output, FlashError> {
    let avrdude = Command::new("avrdude")
        .args(["-c", "arduino", "-p", "m328p", "-D", "-P", port, "-b", &baud.to_string()])
        .args(options)
        .arg("-U")
        .arg(format!("flash:w:{}:e", elf.display()))
        .stdin(Stdio::null())
        .output();
    avrdude.map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => FlashError::NotInstalled,
        _ => FlashError::NotRun(error),
    })
}
