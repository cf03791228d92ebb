//! Errors of trials on the rig.

use super::refusal::PreflightError;
use super::virtual_nano::VirtualError;
use crate::link::LinkError;
use biflag_log::LogError;
use miette::Diagnostic;
use protocol::{Fault, ResetCause};
use study::plan::line::OffTheLine;
use study::steer::SteerError;
use thiserror::Error;

/// Remedy for a bad encoder cable.
const CABLE_CURE: &str = "mend the encoder's cable: keep its leads away from the motor's, put 1 kOhm and 4.7 nF at each input, \
                          and check its ground and supply";

/// Why a trial did not complete.
#[derive(Debug, Error, Diagnostic)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum RecordError {
    /// The user interrupted the trial.
    #[error("interrupted")]
    Interrupted,
    /// The board latched a fault and stopped the motors.
    #[error("the board stopped: {}", fault_text(*.0))]
    #[diagnostic(help("{}; then continue with --resume", fault_cure(*.0)))]
    Faulted(Fault),
    /// The board's clock jumped during the trial.
    #[error("the board's clock jumped during the trial{}", restart_text(.0))]
    #[diagnostic(help("{}; then continue with --resume", jump_cure(*.0)))]
    ClockJumped(Option<ResetCause>),
    /// The board lost its settings before the trial.
    #[error("the board lost its settings before the trial{}", restart_text(&Some(*.0)))]
    #[diagnostic(help("{}; then continue with --resume", silence_cure(Some(*.0))))]
    Restarted(ResetCause),
    /// The board stopped sending telemetry.
    #[error("the board stopped sending{}", silence_text(.cause, *.bytes))]
    #[diagnostic(help("{}; then continue with --resume", silence_cure(*.cause)))]
    Silent { cause: Option<ResetCause>, bytes: usize },
    /// The board left the schedule of the trial.
    #[error("the board left the schedule of the trial")]
    #[diagnostic(help("please report this and attach the log"))]
    OffSchedule,
    /// The encoders' lines are disturbed.
    #[error("the encoders' lines had {0:.0} edges a second that are not motion")]
    #[diagnostic(help("{CABLE_CURE}; then continue with --resume"))]
    Disturbed(f64),
    /// A reading at the end of the range while the sensor is followed.
    #[error("a reading was at the end of the sensor's range")]
    #[diagnostic(help("move the sensor more slowly, without a knock; its range is {range_dps} °/s (gyro_range_dps)"))]
    Clipped { range_dps: u16 },
    /// Frames are missing while the sensor is followed.
    #[error("{gap_s:.1} s of readings are missing")]
    #[diagnostic(help("check the cable and close programs that load the computer, then start again"))]
    Gap { gap_s: f64 },
    /// The swing of the robot does not show the speed of a motor.
    #[error("the robot does not swing as with motor {motor} alone at a duty of {duty} of 255: {reason}")]
    #[diagnostic(help(
        "is the robot in its liquid, with both flagella on it? See that flagellum {motor} turns at each step; if it does not, check \
         the motors' supply and the wires of its bridge"
    ))]
    NoSwing { motor: usize, duty: u8, reason: &'static str },
    /// A motor without encoder stands.
    #[error("motor {0} stands, or is far off its speed: the robot does not swing once a turn of flagellum {0}")]
    #[diagnostic(help(
        "see what holds flagellum {0}, and check the leads of its motor and its supply; if it turns, measure the lines of the motors \
         again with `biflag doctor --motors`; then continue with --resume"
    ))]
    Standing(usize),
    /// A speed of the trial is outside the range of a motor's line.
    #[error(transparent)]
    #[diagnostic(transparent)]
    OffTheLine(#[from] OffTheLine),
    /// The lines of the motors were measured with another wiring.
    #[error("the lines of the motors were measured with another bridge or other senses: {0}")]
    #[diagnostic(help("measure them again, with the robot in its liquid, by `biflag doctor --motors`"))]
    OtherLines(String),
    /// No lines of the motors are known.
    #[error("how fast these motors turn at which duty is not known, and they have no encoders (speed_from = \"duty\")")]
    #[diagnostic(help(
        "measure it, with the robot in its liquid, by `biflag doctor --motors`; it takes nine to thirteen minutes"
    ))]
    NoLines,
    /// The link failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Link(#[from] LinkError),
    /// The log could not be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
    /// A check before the motors turn failed.
    #[error("{0}")]
    #[diagnostic(help("{}", preflight_cure(.0)))]
    Preflight(#[from] PreflightError),
    /// Steering ended early.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Steer(#[from] SteerError),
    /// The emulated board, or the simulated robot behind it, failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Virtual(#[from] VirtualError),
}

/// Returns a description of a fault.
pub fn fault_text(fault: Fault) -> &'static str {
    match fault {
        Fault::None => "no fault",
        Fault::LinkLost => "it received nothing from the host for longer than the motors' deadline",
        Fault::Hang => "its firmware hung, or a reset cut it off with a motor on, and it was restarted",
        Fault::Panic => "its firmware failed an internal check and was restarted",
        Fault::ImuSilent => "the IMU does not respond",
        Fault::ImuBusStuck => "the IMU's bus is stuck",
        Fault::ImuFrozen => "the IMU has no new data",
        Fault::ImuLostConfig => "the IMU loses its configuration repeatedly",
        Fault::SupplyLow => "the board's supply is below 4.3 V",
        Fault::Motor1Stalled => "motor 1 is stalled: it is driven but hardly turns",
        Fault::Motor2Stalled => "motor 2 is stalled: it is driven but hardly turns",
        Fault::Motor1Runaway => "motor 1 turns against its duty",
        Fault::Motor2Runaway => "motor 2 turns against its duty",
        Fault::Motor1Overloaded => "motor 1 is overloaded: it is driven hard but turns slowly",
        Fault::Motor2Overloaded => "motor 2 is overloaded: it is driven hard but turns slowly",
        Fault::Encoder1Failed => {
            "encoder 1 counts forwards and backwards in turn, or not at all while its motor is driven"
        }
        Fault::Encoder2Failed => {
            "encoder 2 counts forwards and backwards in turn, or not at all while its motor is driven"
        }
        Fault::Encoder1Noisy => "encoder 1 has more edges than its motor can cause",
        Fault::Encoder2Noisy => "encoder 2 has more edges than its motor can cause",
    }
}

/// Returns the remedy for a fault.
pub fn fault_cure(fault: Fault) -> &'static str {
    match fault {
        Fault::None => "nothing is wrong",
        Fault::LinkLost => "close programs that load this computer, or increase the board's deadline_ms",
        Fault::Hang => {
            "check its supply and the USB cable, and leave its button and port alone during a run; otherwise please report this \
             and attach the log"
        }
        Fault::Panic => "please report this and attach the log",
        Fault::ImuSilent | Fault::ImuBusStuck => {
            "check the MPU6050's wiring (SCL on A5, SDA on A4), and keep it away from the motors' leads"
        }
        Fault::ImuFrozen => "switch the MPU6050's power off and on",
        Fault::ImuLostConfig => "check the MPU6050's power supply",
        Fault::SupplyLow => {
            "check the USB cable, that the motors have a supply of their own, and the setting bandgap_mv"
        }
        Fault::Motor1Stalled | Fault::Motor2Stalled => {
            "check that the motors' 6 V supply is on, that the flagellum turns freely, and the encoder's wiring"
        }
        Fault::Motor1Runaway | Fault::Motor2Runaway => {
            "the leads of a motor or an encoder are swapped: `biflag doctor --motors` finds which"
        }
        Fault::Motor1Overloaded | Fault::Motor2Overloaded => {
            "check that nothing holds the flagellum and that the motors' 6 V supply is strong enough, and let the winding \
             cool for half a minute"
        }
        Fault::Encoder1Failed | Fault::Encoder2Failed => {
            "check that the motors' 6 V supply is on, that the flagellum turns freely, and the encoder's wiring: \
             `biflag doctor --motors` finds a disconnected channel"
        }
        Fault::Encoder1Noisy | Fault::Encoder2Noisy => CABLE_CURE,
    }
}

fn preflight_cure(error: &PreflightError) -> String {
    let cure = error.help().map(|help| help.to_string()).unwrap_or_default();
    if error.changes_plan() { cure } else { format!("{cure}; then continue with --resume") }
}

fn silence_cure(cause: Option<ResetCause>) -> &'static str {
    match cause {
        Some(ResetCause::Hang) => fault_cure(Fault::Hang),
        Some(ResetCause::Panic) => fault_cure(Fault::Panic),
        _ => "check the power supply of board and motors, and the cable",
    }
}

fn jump_cure(cause: Option<ResetCause>) -> &'static str {
    match cause {
        Some(_) => silence_cure(cause),
        None => "keep this computer from sleeping while recording",
    }
}

fn silence_text(cause: &Option<ResetCause>, bytes: usize) -> String {
    match (cause, bytes) {
        (None, 1..) => format!(": in one second it sent {bytes} bytes and no telemetry"),
        _ => restart_text(cause),
    }
}

fn restart_text(cause: &Option<ResetCause>) -> String {
    match cause {
        Some(ResetCause::BrownOut) => ": it restarted because its supply voltage dropped".into(),
        Some(cause) => format!(": it restarted ({cause:?})"),
        None => String::new(),
    }
}
