//! Why a check before the motors turn refuses a trial, and what helps.

use miette::Diagnostic;
use protocol::units::Millivolts;
use std::path::PathBuf;
use study::attitude::LARGEST_OFFSET_G;
use thiserror::Error;

/// Lowest supply of the board with which a trial begins, with a margin above the 4.3 V at which the board stops the
/// motors.
pub const LEAST_SUPPLY: Millivolts = Millivolts(4500);

/// Reserve of free disk space, bytes.
pub(super) const RESERVE_BYTES: f64 = 50e6;

/// Why the motors may not turn.
#[derive(Debug, Error, Diagnostic, PartialEq)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum PreflightError {
    /// The settings are not in the board's EEPROM.
    #[error("the board on {port} has no settings in its EEPROM, so it does not know how its motors are wired")]
    #[diagnostic(help("{}", settings_cure(.port, .copies)))]
    NoSettings { port: String, copies: Vec<(u16, PathBuf)> },
    /// The disk is too small for the plan.
    #[error(
        "{} has room for {} of logs besides a reserve of {}, and the rest of the plan needs up to {}",
        .folder.display(), size(*.free_bytes), size(RESERVE_BYTES), size(*.needed_bytes)
    )]
    #[diagnostic(help("delete files on that disk, or choose another one with --out"))]
    DiskFull { folder: PathBuf, free_bytes: f64, needed_bytes: f64 },
    /// The board's supply is too low, or not measured.
    #[error("the board's supply is {:.2} V, and at least {:.1} V are needed", .0.volts(), LEAST_SUPPLY.volts())]
    #[diagnostic(help(
        "use a shorter USB cable or another port, and check that the motors have a supply of their own; if a meter at the \
         board's 5V pin reads more, `biflag settings --supply VOLTS` with its reading makes the board measure right"
    ))]
    SupplyLow(Millivolts),
    /// The board moved during the calibration.
    #[error("the board moved during the calibration of the gyroscope")]
    #[diagnostic(help("let the robot come to rest, or make the decay before it longer"))]
    Moved,
    /// The sensor was silent for most of the calibration.
    #[error("the sensor gave {readings} readings in the calibration of the gyroscope instead of {planned}")]
    #[diagnostic(help("check the sensor's cable and its pull-ups; `biflag doctor` tests them"))]
    FewReadings { readings: u16, planned: u16 },
    /// The acceleration at rest is not gravity.
    #[error("the accelerometer reads {force_g:.2} g at rest instead of 1 g")]
    #[diagnostic(help("{}", force_cure(*.force_g)))]
    NotGravity { force_g: f64 },
    /// The sensor's axes differ from the settings.
    #[error("the sensor is tilted by {tilt_deg:.1} degrees at rest, too much for a robot that hangs upright")]
    #[diagnostic(help(
        "let the robot hang freely and continue with --resume; or set accel_axes and gyro_axes in [board] of the plan to the \
         mounting of the sensor, and record into another folder with --out"
    ))]
    MountedAskew { tilt_deg: f64 },
    /// Readings at the end of the sensor's range.
    #[error("the sensor was at the end of its range in {count} readings of the calibration")]
    #[diagnostic(help(
        "check gyro_range_dps and accel_range_g in the board's settings, and that nothing shakes the robot"
    ))]
    Clipped { count: u16 },
    /// The plan sets starting angles, but the board does not know its angles.
    #[error(
        "the board on {port} does not know the angles of its flagella, and the plan sets the angles at which they start"
    )]
    #[diagnostic(help("bring both flagella to their marks with `biflag align --port {port}`"))]
    AnglesUnknown { port: String },
    /// A flagellum did not come to its starting angle.
    #[error("flagellum {flagellum} stopped {off_deg:+.1} degrees from its starting angle")]
    #[diagnostic(help("check that it turns freely and that its motor's 6 V supply is on"))]
    NotParked { flagellum: usize, off_deg: f64 },
    /// The board's clock or this computer's is wrong.
    #[error("the board's clock runs {:+.1} % against this computer's", *.drift_ppm * 1e-4)]
    #[diagnostic(help(
        "close programs that load this computer; if it stays so, the board's resonator is defective: use another board"
    ))]
    ClockDrift { drift_ppm: f64 },
}

fn settings_cure(port: &str, copies: &[(u16, PathBuf)]) -> String {
    if copies.is_empty() {
        return format!("run `biflag doctor --motors --port {port}`, which tests the wiring and saves the settings");
    }
    let restore: Vec<_> = copies
        .iter()
        .map(|(id, path)| format!("`biflag settings --restore {id} --port {port}` for board {id} ({})", path.display()))
        .collect();
    format!(
        "give it back the settings that this computer has kept: {}; for a new board, `biflag settings --new --port \
         {port}` saves the defaults",
        restore.join(", ")
    )
}

/// Returns whether an offset of the accelerometer may give this reading at rest.
pub(super) fn is_offset(force_g: f64) -> bool {
    (force_g - 1.0).abs() < LARGEST_OFFSET_G
}

fn force_cure(force_g: f64) -> &'static str {
    if is_offset(force_g) {
        "the accelerometer may have an offset: measure it with `biflag sensor poses`, name the file that it writes as `sensor` \
         under [session] of the plan, and record into another folder with --out; or check the sensor's supply and continue with \
         --resume"
    } else {
        "check accel_range_g in the board's settings and the sensor's supply; a damaged sensor must be replaced"
    }
}

/// Returns a size on the disk as text.
fn size(bytes: f64) -> String {
    if bytes < 1e9 { format!("{:.0} MB", bytes * 1e-6) } else { format!("{:.1} GB", bytes * 1e-9) }
}
