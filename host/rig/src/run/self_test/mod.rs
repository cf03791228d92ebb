//! The self-test of motors and encoders: drives each motor open-loop in both directions, at low duty first, and
//! compares the encoder readings with the expected ones.
//!
//! From the encoders alone, swapped leads of a motor look the same as swapped channels of its encoder. The user, who
//! sees the flagella, distinguishes the two ([`correction`]).

mod drive;

pub use drive::{Board, Drive, Driven, Response, Travel};

use super::error::RecordError;
use protocol::units::Duty;
use protocol::{Fault, Settings};

/// Duties of the ramp, lowest first.
const RAMP: [i16; 15] = [10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 120, 150, 180, 215, 255];

/// Duration of a step of the ramp, ms.
const STEP_MS: u16 = 400;

/// Duration of the drive at full duty, ms.
const FULL_MS: u16 = 800;

/// A duty at which no motor turns, and the time for which it is tried, ms. If the bridge has other inputs than the settings
/// state, it acts as nearly full duty.
pub const IDLE_DUTY: i16 = 8;
const IDLE_MS: u16 = 400;

/// Largest number of such times for the robot to come to rest first.
const MOST_WAITS: usize = 60;

/// Turns of a flagellum in that time above which it does not just tremble.
const IDLE_TURNS: f64 = 0.05;

/// Smallest gyroscope difference between both directions that shows that the motor turns, degrees per second.
const GYRO_EVIDENCE_DPS: f64 = 0.5;

/// Finding about a motor and its encoder.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[expect(missing_docs, reason = "the variants say what their fields are")]
pub enum Finding {
    /// The encoder counts in the direction of the duty.
    Agrees,
    /// The encoder counts against the duty.
    Opposes,
    /// The motor turns in one direction only: forwards, or backwards.
    OneWay { forwards: bool },
    /// The encoder counts in one direction for any duty.
    SameWay,
    /// The direction of the encoder changes from edge to edge: its channel C2 is dead.
    DirectionDead,
    /// The other encoder counts instead.
    OtherEncoder,
    /// Both encoders count.
    BothEncoders,
    /// The encoder has no edges, though the gyroscope shows that the motor turns: its channel C1 is dead.
    EdgesDead,
    /// Nothing moves.
    Still,
    /// The board stopped the test due to a fault, possibly of the other motor ([`motor_of`]).
    Faulted(Fault),
}

impl Finding {
    /// Returns whether motor and encoder work, once the settings have the right directions.
    pub fn is_usable(self) -> bool {
        matches!(self, Self::Agrees | Self::Opposes)
    }
}

/// The result for one motor. Arrays contain forwards, then backwards.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct MotorTest {
    /// The finding.
    pub finding: Finding,
    /// The lowest duty of the ramp at which the motor turns steadily.
    pub moving_duty: [Option<u8>; 2],
    /// Speed at full duty without its sign, rpm.
    pub full_rpm: [f64; 2],
    /// Number of edges of both encoders too close together to be motion.
    pub glitches: u32,
}

impl MotorTest {
    fn of(finding: Finding) -> Self {
        Self { finding, moving_duty: [None; 2], full_rpm: [0.0; 2], glitches: 0 }
    }

    /// Returns the duty for [`Settings::moving_duty`]: the measured one plus 50 %, and at least plus 20, so that a
    /// motor in a more viscous fluid is not taken for stalled.
    pub fn moving_setting(&self) -> Option<u8> {
        let measured = u16::from(self.moving_duty[0]?.max(self.moving_duty[1]?));
        Some((measured * 3 / 2).max(measured + 20).min(255) as u8)
    }
}

/// Tests both motors; `progress` receives a description of each step before it starts.
///
/// # Errors
/// [`RecordError`] if the board cannot be driven.
pub fn run(
    board: &mut impl Drive,
    settings: &Settings,
    mut progress: impl FnMut(&str),
) -> Result<[MotorTest; 2], RecordError> {
    let mut test = |motor| {
        progress(&format!("testing motor {}: it turns in both directions, at up to full duty", motor + 1));
        match test_motor(board, motor, settings) {
            Err(RecordError::Faulted(fault)) if motor_of(fault).is_some() => Ok(MotorTest::of(Finding::Faulted(fault))),
            result => result,
        }
    };
    Ok([test(0)?, test(1)?])
}

/// Returns the motor (0 or 1) that turns at [`IDLE_DUTY`], if one does.
///
/// # Errors
/// [`RecordError`] if the board cannot be driven.
pub fn turns_at_idle(board: &mut impl Drive, settings: &Settings) -> Result<Option<usize>, RecordError> {
    let per_dps = f64::from(settings.gyro_range.counts_per_dps());
    let change_dps = |response: &Response| response.gyro.iter().map(|axis| axis * axis).sum::<f64>().sqrt() / per_dps;
    // A robot that still moves would look like a driven one.
    for _ in 0..MOST_WAITS {
        if change_dps(&respond(board, 0, 0, IDLE_MS)?) < 0.5 * GYRO_EVIDENCE_DPS {
            break;
        }
    }
    for motor in 0..2 {
        for duty in [IDLE_DUTY, -IDLE_DUTY] {
            let response = respond(board, motor, duty, IDLE_MS)?;
            let counts = f64::from(response.encoders[motor].counts.unsigned_abs());
            if counts > IDLE_TURNS * f64::from(settings.counts_per_turn) || change_dps(&response) > GYRO_EVIDENCE_DPS {
                return Ok(Some(motor));
            }
        }
    }
    Ok(None)
}

/// Returns the motor (0 or 1) to which a fault, or the fault's encoder, belongs; `None` for other faults, which end the
/// whole test.
pub fn motor_of(fault: Fault) -> Option<usize> {
    match fault {
        Fault::Motor1Stalled
        | Fault::Motor1Runaway
        | Fault::Motor1Overloaded
        | Fault::Encoder1Failed
        | Fault::Encoder1Noisy => Some(0),
        Fault::Motor2Stalled
        | Fault::Motor2Runaway
        | Fault::Motor2Overloaded
        | Fault::Encoder2Failed
        | Fault::Encoder2Noisy => Some(1),
        Fault::None
        | Fault::LinkLost
        | Fault::Hang
        | Fault::Panic
        | Fault::ImuSilent
        | Fault::ImuBusStuck
        | Fault::ImuFrozen
        | Fault::ImuLostConfig
        | Fault::SupplyLow => None,
    }
}

fn test_motor(board: &mut impl Drive, motor: usize, settings: &Settings) -> Result<MotorTest, RecordError> {
    let mut result = MotorTest::of(Finding::Still);
    let mut full = [Response::default(); 2];
    let mut ramp = RAMP.as_slice();
    for (way, sign) in [1, -1].into_iter().enumerate() {
        let mut response = Response::default();
        for duty in ramp {
            response = respond(board, motor, sign * duty, STEP_MS)?;
            result.glitches += u32::from(response.glitches);
            if response.encoders.iter().any(Travel::is_alive) {
                result.moving_duty[way] = response.encoders[motor].is_steady.then_some(duty.unsigned_abs() as u8);
                break;
            }
        }
        if response.encoders.iter().any(Travel::is_alive) {
            response = respond(board, motor, sign * Duty::FULL.0, FULL_MS)?;
            result.glitches += u32::from(response.glitches);
        } else {
            // The ramp ended with full duty. More would heat a blocked winding beyond what the board allows.
            ramp = &RAMP[RAMP.len() - 1..];
        }
        full[way] = response;
        let rpm = response.encoders[motor].rate / f64::from(settings.counts_per_turn) * 60.0;
        result.full_rpm[way] = rpm.abs();
    }
    result.finding = judge(motor, &full, settings.gyro_range.counts_per_dps().into());
    Ok(result)
}

fn respond(board: &mut impl Drive, motor: usize, duty: i16, duration_ms: u16) -> Result<Response, RecordError> {
    Ok(Response::of(&board.drive(motor, duty, duration_ms)?))
}

/// Judges the responses to full duty, forwards and backwards.
fn judge(motor: usize, full: &[Response; 2], counts_per_dps: f64) -> Finding {
    let own = full.map(|response| response.encoders[motor]);
    let other = full.map(|response| response.encoders[1 - motor]);
    let any = |travels: &[Travel; 2]| travels.iter().any(Travel::is_alive);
    match (any(&own), any(&other)) {
        (true, true) => Finding::BothEncoders,
        (false, true) => Finding::OtherEncoder,
        (false, false) if gyro_change_dps(full, counts_per_dps) > GYRO_EVIDENCE_DPS => Finding::EdgesDead,
        (false, false) => Finding::Still,
        (true, false) if own.iter().any(Travel::alternates) => Finding::DirectionDead,
        (true, false) => match own.map(|travel| travel.is_steady.then_some(travel.counts > 0)) {
            [Some(true), Some(false)] => Finding::Agrees,
            [Some(false), Some(true)] => Finding::Opposes,
            [Some(_), Some(_)] => Finding::SameWay,
            [forwards, _] => Finding::OneWay { forwards: forwards.is_some() },
        },
    }
}

/// Returns half the difference between the angular rates in both directions: the reaction to a motor changes sign with
/// the duty, but a slow motion of the robot does not.
fn gyro_change_dps(full: &[Response; 2], counts_per_dps: f64) -> f64 {
    let [forwards, backwards] = full;
    let square: f64 = (0..3).map(|axis| (forwards.gyro[axis] - backwards.gyro[axis]).powi(2)).sum();
    0.5 * square.sqrt() / counts_per_dps
}

/// Returns the settings that correct the directions of a motor. `turns_forwards`: whether the user saw a positive duty
/// turn the flagellum counter-clockwise, seen from above. With `None`, the motor is assumed to turn the right way.
pub fn correction(settings: Settings, motor: usize, finding: Finding, turns_forwards: Option<bool>) -> Settings {
    let mut corrected = settings;
    let turns_forwards = turns_forwards.unwrap_or(true);
    if finding.is_usable() {
        corrected.motor_reversed[motor] ^= !turns_forwards;
        corrected.encoder_reversed[motor] ^= (finding == Finding::Agrees) != turns_forwards;
    }
    corrected
}

#[cfg(test)]
mod tests;
