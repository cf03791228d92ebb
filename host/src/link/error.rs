//! What can go wrong between the host and the board, each with what to do about it.

use miette::Diagnostic;
use protocol::{Refusal, VERSION};
use std::time::Duration;
use thiserror::Error;

/// A failure of the link.
#[derive(Debug, Error, Diagnostic)]
pub enum LinkError {
    /// No such port.
    #[error("there is no port {path}")]
    #[diagnostic(code(wrong_use), help("{}", present(.available)))]
    NotFound {
        /// The port asked for.
        path: String,
        /// Ports that are there.
        available: Vec<String>,
    },
    /// Something else than a port.
    #[error("{path} is not a serial port")]
    #[diagnostic(code(wrong_use), help("{}", present(.available)))]
    NotSerial {
        /// What was named.
        path: String,
        /// Ports that are there.
        available: Vec<String>,
    },
    /// No port was named, and none or several could be meant.
    #[error("no port was named, and there is not exactly one that could be meant")]
    #[diagnostic(code(wrong_use), help("name one with --port; {}", present(.available)))]
    NotNamed {
        /// Ports that could be meant.
        available: Vec<String>,
    },
    /// Another program uses the port.
    #[error("{path} is busy: another program has it open{}", holder_text(.holder))]
    #[diagnostic(help("close that program and try again"))]
    Busy {
        /// The port.
        path: String,
        /// Its process, if it could be found.
        holder: Option<String>,
    },
    /// The user may not open the port.
    #[error("not permitted to open {path}")]
    #[diagnostic(help("join the port's group with `sudo usermod -aG {group} $USER`, then log in again"))]
    NotPermitted {
        /// The port.
        path: String,
        /// The group that owns the port.
        group: String,
    },
    /// The port does not work.
    #[error("{path}: {source}")]
    #[diagnostic(help("unplug and replug the board and try again; `biflag doctor` looks closer"))]
    Port {
        /// The port.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The port vanished.
    #[error("{path} was unplugged or closed")]
    #[diagnostic(help("check the cable; what came before is kept, and `record --resume` goes on from there"))]
    Closed {
        /// The port.
        path: String,
    },
    /// The port vanished before the board had said who it is.
    #[error("{path} was unplugged or closed before the board had answered")]
    #[diagnostic(help(
        "check the cable and try again; a board that keeps vanishing draws more than the USB port gives"
    ))]
    Vanished {
        /// The port.
        path: String,
    },
    /// Nothing came from the board.
    #[error("the board on {path} does not answer: not a byte in {:.1} s", .waited.as_secs_f64())]
    #[diagnostic(help("check its power and cable, and flash it with `biflag flash --port {path}`"))]
    Silent {
        /// The port.
        path: String,
        /// How long it was asked.
        waited: Duration,
    },
    /// The user wants to stop.
    #[error("interrupted")]
    Interrupted,
    /// The board sends, but does not answer.
    #[error("the board on {path} sends telemetry, but does not hear this computer")]
    #[diagnostic(help(
        "unplug and replug it; if that does not help, the line from the USB converter to its RX is broken"
    ))]
    Deaf {
        /// The port.
        path: String,
    },
    /// Something came that is not our protocol.
    #[error("the board on {path} runs another program: it sent {bytes} bytes and no frame of ours")]
    #[diagnostic(help("flash it with `biflag flash --port {path}`"))]
    OtherProgram {
        /// The port.
        path: String,
        /// Bytes received.
        bytes: usize,
    },
    /// The firmware speaks another version of the protocol.
    #[error("the firmware on {path} speaks protocol version {theirs}, this biflag version {VERSION}")]
    #[diagnostic(help("flash the right one with `biflag flash --port {path}`"))]
    OtherVersion {
        /// The port.
        path: String,
        /// The board's version.
        theirs: u8,
    },
    /// The board stopped answering.
    #[error("the board on {path} did not answer {command} after {attempts} attempts")]
    #[diagnostic(help("check the cable and try again"))]
    NoAnswer {
        /// The port.
        path: String,
        /// What was asked.
        command: String,
        /// How often.
        attempts: u32,
    },
    /// The board refused.
    #[error("the board refused {command}: {}", refusal_text(*.refusal))]
    #[diagnostic(help("{}", refusal_cure(*.refusal)))]
    Refused {
        /// What was asked.
        command: String,
        /// Why not.
        refusal: Refusal,
    },
    /// The board answered with something that is no answer to the question.
    #[error("the board answered {command} with {answer}")]
    #[diagnostic(help("the firmware does not match this biflag: flash it again with `biflag flash`"))]
    WrongAnswer {
        /// What was asked.
        command: String,
        /// What came.
        answer: String,
    },
}

/// A refusal in words.
pub fn refusal_text(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::OutOfRange => "a value is outside of its range",
        Refusal::Faulted => "a fault is latched",
        Refusal::Running => "the motors turn",
        Refusal::Calibrating => "a calibration is going on",
        Refusal::EepromFailed => "its EEPROM does not keep what is written to it",
    }
}

fn refusal_cure(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::OutOfRange => "correct the value; `biflag settings` prints those in force",
        Refusal::Faulted => {
            "the report of its last trial names the fault (`biflag report LOG`); see to its cause, then record again"
        }
        Refusal::Running | Refusal::Calibrating => "wait until it is done, or press the board's reset button",
        Refusal::EepromFailed => "the board's EEPROM is worn out: use another board, or leave the settings in the plan",
    }
}

fn present(available: &[String]) -> String {
    match available {
        [] => "no board is plugged in; `biflag doctor` looks closer".into(),
        ports => format!("these are there: {}", ports.join(", ")),
    }
}

fn holder_text(holder: &Option<String>) -> String {
    holder.as_ref().map(|name| format!(" ({name})")).unwrap_or_default()
}
