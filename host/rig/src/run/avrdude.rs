//! Writes a firmware image with avrdude through the bootloader.

use miette::Diagnostic;
use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use system::avrdude::{self, PACKAGE};
use system::children::lines;
use system::shell::INSTALL;
use thiserror::Error;

/// Speeds of the Nano's bootloaders, bit/s: optiboot, and the old one that is still common on clones.
const BOOTLOADER_BAUDS: [u32; 2] = [115_200, 57_600];

/// The chip of the image, and one that also runs it, because it has the same registers where the firmware uses them. Each with
/// avrdude's name and its signature (data sheets, section "Signature Bytes").
const CHIPS: [(&str, u32); 2] = [("m328p", 0x1E_950F), ("m328pb", 0x1E_9516)];

/// Limits the wait at a wrong speed to 15 s instead of 60 s; avrdude before 7.0 does not support it.
const FEW_ATTEMPTS: [&str; 2] = ["-x", "attempts=3"];

/// Time limit of a run of avrdude. A write takes 5 s to 15 s, and a wrong speed 60 s at most ([`FEW_ATTEMPTS`]).
const LIMIT: Duration = Duration::from_secs(90);

/// Interval of the checks for the end of avrdude.
const CHECK_EVERY: Duration = Duration::from_millis(20);

/// Longest wait for the rest of the output after the end.
const LAST_LINES: Duration = Duration::from_secs(1);

/// Why the image could not be written.
#[derive(Debug, Error, Diagnostic)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum FlashError {
    /// avrdude is not installed.
    #[error("avrdude is not installed")]
    #[diagnostic(help("install it with `{INSTALL} {PACKAGE}`"))]
    NotInstalled,
    /// avrdude could not be run.
    #[error("avrdude could not be run: {0}")]
    NotRun(io::Error),
    /// No bootloader answered.
    #[error("no bootloader accepted the image on {port}, at 115200 or 57600 bit/s; output of avrdude:\n{said}")]
    #[diagnostic(help("check the cable, unplug and replug the board, and try again"))]
    NoBootloader { port: String, said: String },
    /// Another chip than the image's answered.
    #[error("{} answered on {port}, and the image is for an ATmega328P; output of avrdude:\n{said}", named(*.signature).0)]
    #[diagnostic(help("{}", named(*.signature).1))]
    OtherChip { port: String, signature: u32, said: String },
    /// The bootloader fell silent in each attempt.
    #[error(
        "the bootloader on {port} stopped answering during the write, in two attempts at {baud} bit/s; output of \
         avrdude:\n{said}"
    )]
    #[diagnostic(help(
        "the board has no complete firmware now: flash it again. A bootloader waits one second for a busy computer: \
         end programs that compute. If that does not help, check the cable, and unplug and replug the board"
    ))]
    Interrupted { port: String, baud: u32, said: String },
}

/// Returns the description of a chip that is not the image's, and the remedy.
fn named(signature: u32) -> (String, &'static str) {
    match signature {
        0x1E_9516 => {
            ("an ATmega328PB".into(), "a newer avrdude may write to this chip; or use a Nano with an ATmega328P")
        }
        0x1E_9406 => ("an ATmega168".into(), "the image does not fit into this chip: buy a Nano with an ATmega328P"),
        _ => (format!("a chip with the signature {signature:#08x}"), "use a Nano with an ATmega328P"),
    }
}

/// Returns the signature in avrdude's output, if a chip answered with one that is not the image's: `0x1e9516 (probably
/// m328pb)` before version 8, `1E 95 16 (ATmega328PB)` since.
fn other_chip(said: &str) -> Option<u32> {
    let said = said.to_ascii_lowercase();
    let (_, signature) = said.rsplit_once("device signature = ")?;
    let digits = signature.trim_start_matches("0x").chars().filter(|digit| *digit != ' ').take(6).collect::<String>();
    // A disturbed line reads as all zeros or all ones.
    let is_other = |signature: &u32| ![CHIPS[0].1, 0, 0xFF_FFFF].contains(signature);
    u32::from_str_radix(&digits, 16).ok().filter(is_other)
}

/// Writes the image, trying the speed of each bootloader; `progress` is called with the speed of each attempt. Returns
/// the speed that worked, and avrdude's name of the chip that answered.
///
/// # Errors
/// [`FlashError`].
pub fn flash(port: &str, elf: &Path, progress: impl FnMut(u32)) -> Result<(u32, &'static str), FlashError> {
    flash_with(&avrdude::command, LIMIT, port, elf, progress)
}

fn flash_with(
    avrdude: &dyn Fn() -> Command,
    limit: Duration,
    port: &str,
    elf: &Path,
    mut progress: impl FnMut(u32),
) -> Result<(u32, &'static str), FlashError> {
    let [(mut chip, _), (other, its_signature)] = CHIPS;
    let mut last = String::new();
    let mut options: &[&str] = &FEW_ATTEMPTS;
    for baud in BOOTLOADER_BAUDS {
        let mut stuck = 0;
        loop {
            progress(baud);
            let Attempt { end, said } = run(avrdude(), limit, port, elf, baud, chip, options)?;
            last = said.trim().to_owned();
            match end {
                End::Exit(status) if status.success() => return Ok((baud, chip)),
                End::Exit(_) if !options.is_empty() && said.contains("extended parameter") => options = &[],
                End::Exit(_) => match other_chip(&said) {
                    Some(signature) if signature == its_signature && chip != other => chip = other,
                    Some(signature) => {
                        return Err(FlashError::OtherChip { port: port.to_owned(), signature, said: last });
                    }
                    None => break,
                },
                // The board was reset too late or the computer was busy; the next attempt resets it again.
                End::Silent | End::TimeLimit if stuck == 0 => stuck += 1,
                // A write only begins at the bootloader's own speed.
                End::Silent => return Err(FlashError::Interrupted { port: port.to_owned(), baud, said: last }),
                End::TimeLimit => break,
            }
        }
    }
    Err(FlashError::NoBootloader { port: port.to_owned(), said: last })
}

/// A run of avrdude.
struct Attempt {
    end: End,
    /// Its output on standard error.
    said: String,
}

enum End {
    /// It exited.
    Exit(ExitStatus),
    /// It was killed because the bootloader had stopped answering during the write. avrdude itself would continue with
    /// every page, at 5 s each.
    Silent,
    /// It was killed at the time limit.
    TimeLimit,
}

fn run(
    mut avrdude: Command,
    limit: Duration,
    port: &str,
    elf: &Path,
    baud: u32,
    chip: &str,
    options: &[&str],
) -> Result<Attempt, FlashError> {
    let mut child = avrdude
        .args(["-c", "arduino", "-p", chip, "-D", "-P", port, "-b", &baud.to_string()])
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
    let attempt = watch(&mut child, limit);
    if !matches!(attempt, Ok(Attempt { end: End::Exit(_), .. })) {
        // Fails if it has just ended by itself.
        let _ = child.kill();
        child.wait().map_err(FlashError::NotRun)?;
    }
    attempt.map_err(FlashError::NotRun)
}

/// Waits until avrdude has exited, or must be killed.
fn watch(child: &mut Child, limit: Duration) -> io::Result<Attempt> {
    let until = Instant::now() + limit;
    // The thread that reads the lines ends by itself, and is not joined.
    let lines = child.stderr.take().map_or_else(|| channel().1, |stderr| lines(stderr, u64::MAX));
    let mut said = String::new();
    loop {
        match lines.recv_timeout(CHECK_EVERY) {
            Ok(line) => {
                said.extend([line.as_str(), "\n"]);
                if is_silent(&line, &said) {
                    return Ok(Attempt { end: End::Silent, said });
                }
            }
            Err(error) => {
                if let Some(status) = child.try_wait()? {
                    // The pipe has closed with the child, unless another program has inherited it.
                    while let Ok(line) = lines.recv_timeout(LAST_LINES) {
                        said.extend([line.as_str(), "\n"]);
                    }
                    return Ok(Attempt { end: End::Exit(status), said });
                }
                if error == RecvTimeoutError::Disconnected {
                    std::thread::sleep(CHECK_EVERY);
                }
            }
        }
        if Instant::now() >= until {
            said.push_str(&format!("\n(ended after {} s)\n", limit.as_secs_f64()));
            return Ok(Attempt { end: End::TimeLimit, said });
        }
    }
}

/// Returns whether `line`, the last line of avrdude's output `said`, reports that the bootloader stopped answering
/// during the write. Before the write, avrdude itself gives up; after the verification, the image is complete.
fn is_silent(line: &str, said: &str) -> bool {
    let said = said.to_ascii_lowercase();
    line.contains("not responding") && said.contains("writing") && !said.contains("verified")
}

#[cfg(test)]
mod tests {
    use super::*;

    const SILENT: &str = "echo 'avrdude: stk500_recv(): programmer is not responding' >&2";

    /// Runs a shell script in place of avrdude and returns the speed of success, the speeds tried, and the time taken. In
    /// the script, `$try` counts the runs from 1, `$part` is the chip, `$baud` the speed, and `$few` states whether few
    /// attempts were requested.
    fn flashed(limit: Duration, script: &str) -> (Result<u32, FlashError>, Vec<u32>, Duration) {
        let folder = tempfile::tempdir().unwrap();
        let port = folder.path().join("port");
        let script = format!(
            "part=$4; baud=$9; few=no; [ \"${{10}}\" = -x ] && few=yes; echo >> \"$7\"; try=$(wc -l < \"$7\")\n{script}"
        );
        let avrdude = || {
            let mut shell = Command::new("sh");
            shell.args(["-c", &script, "avrdude"]);
            shell
        };
        let (mut bauds, begun) = (Vec::new(), Instant::now());
        let result =
            flash_with(&avrdude, limit, port.to_str().unwrap(), Path::new("image.elf"), |baud| bauds.push(baud));
        (result.map(|(baud, _)| baud), bauds, begun.elapsed())
    }

    const LONG: Duration = Duration::from_secs(50);

    #[test]
    fn speeds_are_tried_one_after_the_other() {
        let (result, bauds, _) = flashed(LONG, "[ $baud = 57600 ]");
        assert_eq!((result.unwrap(), bauds), (57_600, vec![115_200, 57_600]));
        let (result, bauds, _) = flashed(LONG, "echo 'not in sync' >&2; exit 1");
        assert_eq!(bauds, [115_200, 57_600]);
        assert!(matches!(&result, Err(FlashError::NoBootloader { said, .. }) if said == "not in sync"), "{result:?}");
    }

    #[test]
    fn old_avrdude_is_run_without_the_option() {
        let script = "[ $few = yes ] && { echo 'invalid extended parameter' >&2; exit 1; }; exit 0";
        let (result, bauds, _) = flashed(LONG, script);
        assert_eq!((result.unwrap(), bauds), (115_200, vec![115_200, 115_200]));
    }

    /// A chip that also runs the image is written under its own name, and other chips are named. Both formats of avrdude.
    #[test]
    fn another_chip_is_written_or_named() {
        let says = |signature: &str| format!("echo 'avrdude: device signature = {signature}' >&2; exit 1");
        let old = says("0x1e9516 (probably m328pb)");
        let (result, bauds, _) = flashed(LONG, &format!("[ $part = m328pb ] && exit 0; {old}"));
        assert_eq!((result.unwrap(), bauds), (115_200, vec![115_200, 115_200]));
        for (signature, words, cure, tries) in [
            ("0x1e9516 (probably m328pb)", "an ATmega328PB answered", "newer avrdude", 2),
            ("1E 94 06 (ATmega168)", "an ATmega168 answered", "does not fit into this chip: buy a Nano", 1),
            ("0x1e930b", "a chip with the signature 0x1e930b answered", "use a Nano with an ATmega328P", 1),
        ] {
            let (result, bauds, _) = flashed(LONG, &says(signature));
            let error = result.unwrap_err();
            assert!(error.to_string().starts_with(words) && bauds.len() == tries, "{error} after {bauds:?}");
            assert!(error.help().unwrap().to_string().contains(cure), "{:?}", error.help().unwrap().to_string());
        }
        for own in ["0x1e950f (probably m328p)", "1E 95 0F (ATmega328P)", "0x000000 (retrying)"] {
            assert!(matches!(flashed(LONG, &says(own)).0, Err(FlashError::NoBootloader { .. })), "{own}");
        }
    }

    /// The output is kept even if a program started by avrdude keeps the pipe open.
    #[test]
    fn hanging_avrdude_is_ended_and_run_again() {
        let limit = Duration::from_millis(500);
        let script = "echo begun $try at $baud >&2; [ $try -ge 3 ] && exit 0; sleep 25; exit 0";
        let (result, bauds, took) = flashed(limit, script);
        assert_eq!((result.unwrap(), bauds), (57_600, vec![115_200, 115_200, 57_600]));
        assert!(took < Duration::from_secs(20), "{took:?}");
        let (result, bauds, took) = flashed(limit, "echo begun $try at $baud >&2; exec 2>&-; sleep 25");
        assert_eq!(bauds, [115_200, 115_200, 57_600, 57_600]);
        let said = match result {
            Err(FlashError::NoBootloader { said, .. }) => said,
            other => panic!("{other:?}"),
        };
        assert!(said.starts_with("begun 4 at 57600") && said.ends_with("(ended after 0.5 s)"), "{said}");
        assert!(took < Duration::from_secs(20), "{took:?}");
    }

    #[test]
    fn silent_bootloader_is_written_again_at_its_speed() {
        let silent = format!("printf 'avrdude: writing 9000 bytes flash ...\\nWriting | ###' >&2; {SILENT}; sleep 25");
        let (result, bauds, took) = flashed(LONG, &format!("[ $try = 2 ] && exit 0; {silent}"));
        assert_eq!((result.unwrap(), bauds), (115_200, vec![115_200, 115_200]));
        assert!(took < Duration::from_secs(20), "{took:?}");
        let (result, bauds, took) = flashed(LONG, &format!("[ $baud = 115200 ] && exit 1; {silent}"));
        assert_eq!(bauds, [115_200, 57_600, 57_600]);
        let error = result.unwrap_err();
        assert!(matches!(error, FlashError::Interrupted { baud: 57_600, .. }), "{error:?}");
        assert!(error.to_string().contains("stopped answering during the write"), "{error}");
        assert!(error.to_string().ends_with("programmer is not responding"), "{error}");
        assert!(took < Duration::from_secs(20), "{took:?}");
    }

    /// avrdude itself gives up at a wrong speed, and after the verification silence does no harm.
    #[test]
    fn silence_outside_of_the_write_is_not_an_interruption() {
        let (result, bauds, _) = flashed(LONG, &format!("[ $baud = 57600 ] && exit 0; {SILENT}; exit 1"));
        assert_eq!((result.unwrap(), bauds), (57_600, vec![115_200, 57_600]));
        let verified = "echo 'avrdude: writing 9000 bytes flash ...\n9000 bytes of flash verified' >&2";
        let (result, bauds, _) = flashed(LONG, &format!("{verified}; {SILENT}; exit 0"));
        assert_eq!((result.unwrap(), bauds), (115_200, vec![115_200]));
    }

    #[test]
    fn missing_avrdude_is_reported() {
        let missing = || Command::new("/nowhere/avrdude");
        let result = flash_with(&missing, LONG, "port", Path::new("image.elf"), |_| {});
        assert!(matches!(result, Err(FlashError::NotInstalled)), "{result:?}");
    }
}
