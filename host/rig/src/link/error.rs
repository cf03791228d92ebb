//! Errors of the link between host and board, each with its remedy.

use miette::Diagnostic;
use protocol::{Refusal, VERSION};
use std::time::Duration;
use system::port::EXAMPLE;
use thiserror::Error;

/// A failure of the link.
#[derive(Debug, Error, Diagnostic)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum LinkError {
    /// No such port.
    #[error("there is no port {path}")]
    #[diagnostic(code(wrong_use), help("{}{}", names(path), present(.available)))]
    NotFound { path: String, available: Vec<String> },
    /// Not a serial port.
    #[error("{path} is not a serial port")]
    #[diagnostic(code(wrong_use), help("{}", present(.available)))]
    NotSerial { path: String, available: Vec<String> },
    /// A board with the chip of another family.
    #[error("the board on {path} is an Arduino {name}, and the firmware is for an ATmega328P")]
    #[diagnostic(help("use a Nano or an Uno R3, with an ATmega328P"))]
    OtherChip { path: String, name: &'static str },
    /// No port was named, and no board is plugged in.
    #[error("No board found. Plug it in or pass --port.")]
    #[diagnostic(code(wrong_use), help("`biflag doctor` checks the cable, the port and the permissions"))]
    NoBoard,
    /// No port was named, and several boards are plugged in.
    #[error("Several boards found: {}. Pass one with --port.", .available.join(", "))]
    #[diagnostic(code(wrong_use), help("`biflag doctor` says which board is on which port"))]
    SeveralBoards { available: Vec<String> },
    /// Another program uses the port.
    #[error("{path} is busy: another program has it open{}", .holder.as_ref().map(|name| format!(" ({name})")).unwrap_or_default())]
    #[diagnostic(help("close that program and try again"))]
    Busy { path: String, holder: Option<String> },
    /// The user may not open the port.
    #[error("not permitted to open {path}")]
    #[diagnostic(help("join the port's group with `sudo usermod -aG {group} $USER`, then log in again"))]
    NotPermitted { path: String, group: String },
    /// The port failed.
    #[error("{path}: {source}")]
    #[diagnostic(help("unplug and replug the board and try again; `biflag doctor` shows more"))]
    Port { path: String, source: std::io::Error },
    /// The port disappeared.
    #[error("{path} was unplugged or closed")]
    #[diagnostic(help("check the cable; the log so far is kept, and `biflag record --resume` continues the session"))]
    Closed { path: String },
    /// The port disappeared during the handshake.
    #[error("{path} was unplugged or closed before the board answered")]
    #[diagnostic(help(
        "check the cable and try again; a board that keeps disconnecting may draw more current than the USB port supplies"
    ))]
    Vanished { path: String },
    /// Nothing came from the board.
    #[error("the board on {path} does not answer: no byte in {:.1} s", .waited.as_secs_f64())]
    #[diagnostic(help("check its power and cable, and flash it with `biflag flash --port {path}`"))]
    Silent { path: String, waited: Duration },
    /// The stream ended.
    #[error("the board on {path} stopped sending")]
    #[diagnostic(help("check its power supply and cable, then start again"))]
    Stopped { path: String },
    /// The user pressed Ctrl-C.
    #[error("interrupted")]
    Interrupted,
    /// The board sends, but does not answer.
    #[error("the board on {path} sends telemetry but answers no request")]
    #[diagnostic(help(
        "unplug and replug it; if that does not help, the line from the USB converter to its RX is broken"
    ))]
    RequestsIgnored { path: String },
    /// The received bytes do not belong to this protocol.
    #[error("the board on {path} runs another program: it sent {bytes} bytes and no valid frame")]
    #[diagnostic(help("flash it with `biflag flash --port {path}`"))]
    OtherProgram { path: String, bytes: usize },
    /// The firmware speaks another version of the protocol.
    #[error("the firmware on {path} speaks protocol version {theirs}, this biflag version {VERSION}")]
    #[diagnostic(help("flash the matching firmware with `biflag flash --port {path}`"))]
    OtherVersion { path: String, theirs: u8 },
    /// The firmware has the same protocol version, but from another state of development.
    #[error("the firmware on {path} was built with other messages than this biflag, under the same protocol version")]
    #[diagnostic(help("flash the matching firmware with `biflag flash --port {path}`"))]
    OtherSchema { path: String },
    /// The board stopped answering.
    #[error("the board on {path} did not answer {command} after {attempts} attempts")]
    #[diagnostic(help("check the cable and try again"))]
    NoAnswer { path: String, command: String, attempts: u32 },
    /// The board refused.
    #[error("the board refused {command}: {}", refusal_text(*.refusal))]
    #[diagnostic(help("{}", refusal_cure(*.refusal)))]
    Refused { command: String, refusal: Refusal },
    /// The answer does not fit the request.
    #[error("the board answered {command} with {answer}")]
    #[diagnostic(help("the firmware does not match this biflag: flash it again with `biflag flash`"))]
    WrongAnswer { command: String, answer: String },
}

fn refusal_text(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::OutOfRange => "a value is outside of its range",
        Refusal::Faulted => "a fault is latched",
        Refusal::Running => "the motors are turning",
        Refusal::Calibrating => "a calibration is running",
        Refusal::EepromFailed => "its EEPROM does not keep its content",
        Refusal::NotASchedule => "the set-points are not a schedule, or it would start in the past",
        Refusal::NoEncoders => "its motors have no encoders",
    }
}

fn refusal_cure(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::OutOfRange => "correct the value; `biflag settings` prints those in force",
        Refusal::Faulted => {
            "the report of its last trial names the fault (`biflag report LOG`); remove the cause, then record again"
        }
        Refusal::Running | Refusal::Calibrating => "wait until it is done, or press the board's reset button",
        Refusal::EepromFailed => "the EEPROM is worn out: use another board, or give the settings in the plan",
        Refusal::NotASchedule => {
            "this computer was too busy to start the trial in time: close other programs and try again"
        }
        Refusal::NoEncoders => {
            "only plans of constant speeds run on such a board; if it has encoders, set speed_from = \"encoders\" with `biflag settings`"
        }
    }
}

/// Returns a hint about port names if `port` is the name of a port of Windows, and this is another system.
fn names(port: &str) -> String {
    let is_of_windows = |name: &str| name.get(..3).is_some_and(|start| start.eq_ignore_ascii_case("COM"));
    let is_foreign = is_of_windows(port) && !is_of_windows(EXAMPLE);
    if is_foreign { format!("ports are called like {EXAMPLE} here; ") } else { String::new() }
}

fn present(available: &[String]) -> String {
    match available {
        [] => "no board is plugged in; `biflag doctor` shows more".into(),
        ports => format!("available: {}", ports.join(", ")),
    }
}
