//! Why steering ends early.

use crate::aim::AimError;
use miette::Diagnostic;
use protocol::units::CentiRpm;
use thiserror::Error;

const REPLY: &str = "the policy reads one line of JSON from its standard input and writes one line such as \
                     {\"speeds_rpm\": [50, 10]} for it, at once and unbuffered";

/// Why steering ends early. The motors are stopped and the log is kept.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum SteerError {
    /// The policy could not be started.
    #[error("the policy `{command}` does not start")]
    #[diagnostic(code(wrong_use), help("give a command that a shell can run"))]
    NotStarted { command: String, source: std::io::Error },
    /// The policy ended.
    #[error("the policy ended{}", status.as_ref().map_or_else(String::new, |status| format!(": {status}")))]
    #[diagnostic(help("its own messages are above; it must read observations until its standard input ends"))]
    Ended { status: Option<String> },
    /// The policy has ended the run. This is not a failure.
    #[error("the policy ended the run")]
    Over,
    /// The policy does not answer.
    #[error("the policy gave no speeds within {waited_s} s")]
    #[diagnostic(help("{REPLY}"))]
    Silent { waited_s: f64 },
    /// The policy wrote a line that is not its speeds.
    #[error("the policy wrote {line:?}, which is not a line of speeds: {reason}")]
    #[diagnostic(help("{REPLY}"))]
    Nonsense { line: String, reason: String },
    /// The policy wrote a line without an observation.
    #[error("the policy wrote more than one line for an observation: {line:?}")]
    #[diagnostic(help("{REPLY}; its own messages belong on its standard error"))]
    Unasked { line: String },
    /// The speeds exceed the board's limit.
    #[error("the policy asked for {} and {} rpm, and the board turns at most at {} rpm", rpm[0], rpm[1], CentiRpm::LIMIT.rpm())]
    #[diagnostic(help("limit the speeds in the policy"))]
    OffTheLine { rpm: [f64; 2] },
    /// The table has no speeds near the attitude.
    #[error(
        "yaw {yaw_deg}° and pitch {pitch_deg}° are out of reach: the table comes within {error_deg:.1}° at best, at {} and \
         {} rpm",
        rpm[0], rpm[1]
    )]
    #[diagnostic(code(wrong_use), help("`biflag aim --yaw={yaw_deg} --pitch={pitch_deg}` shows the nearest attitude"))]
    OutOfReach { yaw_deg: f64, pitch_deg: f64, error_deg: f64, rpm: [f64; 2] },
    /// The table cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Aim(#[from] AimError),
}
