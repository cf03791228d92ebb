//! Writing an image with avrdude through the bootloader.

use miette::Diagnostic;
use std::io::{self, Read};
use std::path::Path;
use std::process::{Command, Stdio};
use thiserror::Error;

/// Speeds of the Nano's bootloaders, bit/s: optiboot, and the old one that many clones still carry.
pub const BOOTLOADER_BAUDS: [u32; 2] = [115_200, 57_600];

/// A wrong speed is given up after a quarter of a minute and not after a whole one; avrdude before 7.0 does not know it.
const FEW_ATTEMPTS: [&str; 2] = ["-x", "attempts=3"];

/// Why the image is not on the board.
#[derive(Debug, Error, Diagnostic)]
pub enum FlashError {
    /// No avrdude.
    #[error("avrdude is not installed")]
    #[diagnostic(help("install it with `sudo apt install avrdude`"))]
    NotInstalled,
    /// It could not be run.
    #[error("avrdude could not be run: {0}")]
    NotRun(io::Error),
    /// No bootloader answered.
    #[error("no bootloader took the image on {port}, neither at 115200 nor at 57600 bit/s; avrdude said:\n{said}")]
    #[diagnostic(help("check the cable, unplug and replug the board, and try again"))]
    NoBootloader {
        /// The port.
        port: String,
        /// What avrdude said last.
        said: String,
    },
}

/// Writes the image through whichever bootloader answers; `progress` hears of each attempt, with each piece of what
/// avrdude says. Answers the speed that worked.
///
/// # Errors
/// [`FlashError`].
pub fn flash(port: &str, elf: &Path, mut progress: impl FnMut(u32, &str)) -> Result<u32, FlashError> {
    let mut said = String::new();
    let mut options: &[&str] = &FEW_ATTEMPTS;
    let mut bauds = BOOTLOADER_BAUDS.into_iter().peekable();
    while let Some(baud) = bauds.peek().copied() {
        said.clear();
        if run(port, elf, baud, options, |text| {
            said.push_str(text);
            progress(baud, text);
        })? {
            return Ok(baud);
        }
        if !options.is_empty() && said.contains("extended parameter") {
            options = &[];
        } else {
            bauds.next();
        }
    }
    Err(FlashError::NoBootloader { port: port.to_owned(), said: said.trim().to_owned() })
}

fn run(port: &str, elf: &Path, baud: u32, options: &[&str], mut hear: impl FnMut(&str)) -> Result<bool, FlashError> {
    let mut child = Command::new("avrdude")
        .args(["-c", "arduino", "-p", "m328p", "-D", "-P", port, "-b", &baud.to_string()])
        .args(options)
        .arg("-U")
        .arg(format!("flash:w:{}:e", elf.display()))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => FlashError::NotInstalled,
            _ => FlashError::NotRun(error),
        })?;
    if let Some(mut stderr) = child.stderr.take() {
        let mut buffer = [0; 256];
        while let Ok(read @ 1..) = stderr.read(&mut buffer) {
            hear(&String::from_utf8_lossy(&buffer[..read]));
        }
    }
    Ok(child.wait().map_err(FlashError::NotRun)?.success())
}
