//! Measures the lines of motors without encoders: each motor turns alone at some duties in both senses, and the swing of the
//! robot shows its speed.

use super::error::RecordError;
use super::{schedule, stream};
use crate::link::Link;
use protocol::units::{CentiRpm, Micros};
use protocol::{Command, Fault, SetPoint, Settings, TICK_HZ, Telemetry};
use std::sync::atomic::AtomicBool;
use study::attitude::{Columns, Unwrap, rotation};
use study::plan::line::{Line, LinePoint, Lines};
use study::swing::{NO_LINE, speed_alone};

/// The first duties.
const DUTIES: [u8; 5] = [60, 75, 95, 130, 200];
/// Number of these duties that are tried together first. A motor that stands at all of them is not driven at the last one, which
/// would overheat its winding.
const SAFE: usize = 4;

/// Bisections between the highest duty at which a motor stands and the lowest one at which it turns, because the line is steep at
/// its start: their least number, and the largest one, while the slowest measured speed is above a limit, rpm.
const HALVINGS: u32 = 2;
const MOST_HALVINGS: u32 = 5;
const SLOW_RPM: f64 = 12.0;

/// Number of further attempts at a duty if the motion is not a swing.
const MORE_ATTEMPTS: usize = 2;

/// Time until the motion at a duty has settled, and the time that is measured, s.
const SETTLING_S: u32 = 6;
const MEASURED_S: u32 = 13;

/// Time for the request that starts a schedule, µs.
const LEAD_US: u32 = 200_000;

/// Nominal speed at full duty for the speeds in set-points, rpm. The board uses only their sense, reports them, and applies the
/// duty.
const AT_FULL_RPM: f64 = 130.0;

/// The lines of a board, and the motors with reversed leads, which a positive duty turns clockwise.
#[derive(Clone, PartialEq, Debug)]
pub struct MeasuredLines {
    /// The lines, in the right senses.
    pub lines: Lines,
    /// Whether motors 1 and 2 turn backwards at a positive duty.
    pub turns_back: [bool; 2],
}

impl MeasuredLines {
    /// Returns settings with which a positive speed turns each motor forwards.
    pub fn corrected(&self, mut settings: Settings) -> Settings {
        for (reversed, turns_back) in settings.motor_reversed.iter_mut().zip(self.turns_back) {
            *reversed ^= turns_back;
        }
        settings
    }
}

/// Measures the lines of both motors; `progress` receives a description of each step before it starts.
///
/// # Errors
/// [`RecordError`]: [`RecordError::NoSwing`] if the swing does not show a speed.
pub fn measure(
    link: &Link,
    interrupted: &AtomicBool,
    mut progress: impl FnMut(&str),
) -> Result<MeasuredLines, RecordError> {
    let mut half = |motor: usize, sense: i16| {
        let which = if sense > 0 { "forwards" } else { "backwards" };
        let done = 2 * motor as u32 + u32::from(sense < 0);
        let left_s = (4 - done) * (DUTIES.len() as u32 + MOST_HALVINGS) * (SETTLING_S + MEASURED_S);
        progress(&format!("measuring motor {} {which}; at most {} minutes left", motor + 1, left_s.div_ceil(60)));
        Half { link, interrupted, motor, sense }.measure()
    };
    stream::with_motors(link, || {
        let mut result = MeasuredLines { lines: Lines::default(), turns_back: [false; 2] };
        for motor in 0..2 {
            let (forwards, backwards) = (half(motor, 1)?, half(motor, -1)?);
            result.turns_back[motor] = senses(motor, &forwards, &backwards)?;
            // A motor that turns backwards winds the flagella about each other. They would stay so, and hide the swing of the next one.
            if !result.turns_back[motor] {
                Half { link, interrupted, motor, sense: 1 }.turn(&[DUTIES[SAFE - 1]])?;
            }
            let [mut forwards, mut backwards] = [forwards, backwards].map(|points| {
                points.iter().map(|&(duty, rpm)| LinePoint { duty, speed_rpm: rpm.abs() }).collect::<Vec<_>>()
            });
            if result.turns_back[motor] {
                std::mem::swap(&mut forwards, &mut backwards);
            }
            result.lines.motor[motor] = Line { forwards, backwards, ..Line::default() };
        }
        Ok(result)
    })
}

/// Speed at which the supply is checked, rpm.
const CHECKED_RPM: f64 = 50.0;

/// Corrects lines for the present supply, as a battery sags while they are measured and from day to day: each motor turns alone at 50
/// rpm. Where the line does not reach that, or the swing does not tell the speed, the line stays. A motor that stands, or is slower
/// than half of it, is an error: a trial would find it after its first minutes.
///
/// # Errors
/// [`RecordError`].
pub fn follow_supply(link: &Link, interrupted: &AtomicBool, lines: &mut Lines) -> Result<(), RecordError> {
    stream::with_motors(link, || {
        (0..2).try_for_each(|motor| {
            let speeds = [0, 1].map(|k| CentiRpm::from_rpm(if k == motor { CHECKED_RPM } else { 0.0 }));
            let Ok(duties) = lines.duties(speeds) else { return Ok(()) };
            let half = Half { link, interrupted, motor, sense: 1 };
            match half.told(&half.turn(&duties[motor..=motor])?, 1, duties[motor]) {
                Ok(Some(rpm)) if rpm.abs() > CHECKED_RPM / 2.0 => lines.follow(speeds, [rpm; 2]),
                Ok(_) => return Err(half.no_swing(duties[motor], "it stands, or is far off its speed")),
                Err(RecordError::NoSwing { .. }) => {}
                Err(error) => return Err(error),
            }
            Ok(())
        })
    })
}

/// A motor that turns alone in one sense.
struct Half<'a> {
    link: &'a Link,
    interrupted: &'a AtomicBool,
    motor: usize,
    sense: i16,
}

impl Half<'_> {
    /// Returns duties and their speeds (rpm) in ascending order, starting with the highest duty at which the motor stands.
    fn measure(&self) -> Result<Vec<(u8, f64)>, RecordError> {
        let (mut stands, mut slow) = (0, 0);
        let mut points: Vec<(u8, f64)> = Vec::new();
        for duties in [&DUTIES[..SAFE], &DUTIES[SAFE..]] {
            let frames = self.turn(duties)?;
            for (number, &duty) in (1..).zip(duties) {
                match self.told(&frames, number, duty) {
                    Ok(Some(rpm)) => points.push((duty, rpm)),
                    Ok(None) if points.is_empty() => (stands, slow) = (duty, duty),
                    Err(RecordError::NoSwing { .. }) if points.is_empty() => slow = duty,
                    Ok(None) => return Err(self.no_swing(duty, "it stands, though it turns at a lower duty")),
                    Err(error) => return Err(error),
                }
            }
            if points.is_empty() {
                return Err(self.no_swing(slow, "it hardly swings"));
            }
        }
        let points = with_start(points, stands, slow, |duty| self.told(&self.turn(&[duty])?, 1, duty))?;
        if let Some(pair) = points.windows(2).find(|pair| pair[1].1.abs() <= pair[0].1.abs()) {
            return Err(self.no_swing(pair[1].0, "it is not faster than at a lower duty"));
        }
        Ok(points)
    }

    /// Returns the speed in a phase of these frames, as [`Self::speed`]. If the motor wanders too much for a measurement, it is
    /// tried again.
    fn told(&self, frames: &[Telemetry], phase: u8, duty: u8) -> Result<Option<f64>, RecordError> {
        let mut told = self.speed(frames, phase, duty);
        for _ in 0..MORE_ATTEMPTS {
            if let Err(RecordError::NoSwing { .. }) = told {
                told = self.speed(&self.turn(&[duty])?, 1, duty);
            }
        }
        told
    }

    /// Turns the motor at these duties in a schedule of the board. Returns the frames meanwhile.
    fn turn(&self, duties: &[u8]) -> Result<Vec<Telemetry>, RecordError> {
        let step = (SETTLING_S + MEASURED_S) * u32::from(TICK_HZ);
        let mut points = Vec::new();
        for (number, &duty) in (1..).zip(duties) {
            let mut point = SetPoint { tick: (u32::from(number) - 1) * step, phase: number, ..SetPoint::default() };
            let rpm = (AT_FULL_RPM * f64::from(duty) / 255.0).min(CentiRpm::LIMIT.rpm());
            point.speeds[self.motor] = CentiRpm::from_rpm(rpm * f64::from(self.sense));
            point.duties[self.motor] = duty;
            points.push(point);
        }
        let last = duties.len() as u8;
        points.push(SetPoint { tick: u32::from(last) * step, phase: last + 1, ..SetPoint::default() });
        for (index, point) in (0..).zip(&points) {
            self.link.command(Command::SetPoint { index, point: *point })?;
        }
        schedule::in_time(LEAD_US, |lead_us| {
            let at = Micros(self.link.now()?.0.wrapping_add(lead_us));
            Ok(self.link.command(Command::StartSchedule { count: last + 1, at })?)
        })?;
        let mut frames: Vec<Telemetry> = Vec::new();
        loop {
            let frame = stream::next_frame(self.link, self.interrupted)?;
            match frame.phase {
                _ if frame.fault != Fault::None => return Err(RecordError::Faulted(frame.fault)),
                // Before the schedule begins, the board reports the last phase of the previous one.
                phase if phase != 1 && frames.is_empty() => {}
                phase if (1..=last).contains(&phase) => frames.push(frame),
                _ => return Ok(frames),
            }
        }
    }

    /// Returns the speed in a phase of these frames, rpm; `None` if the motor stands.
    fn speed(&self, frames: &[Telemetry], phase: u8, duty: u8) -> Result<Option<f64>, RecordError> {
        let mut angles = Columns::<3>::default();
        let mut unwrap = Unwrap::default();
        let mut began = None;
        for frame in frames.iter().filter(|frame| frame.phase == phase) {
            let time_s = f64::from(frame.time.since(*began.get_or_insert(frame.time))) * 1e-6;
            angles.push(time_s, unwrap.angles_deg(&rotation(frame.attitude.to_f64())));
        }
        let end_s = angles.time_s.last().copied().unwrap_or_default();
        match speed_alone(&angles, f64::from(SETTLING_S)..end_s) {
            Ok((rpm, _)) => Ok(Some(rpm)),
            Err(NO_LINE) => Ok(None),
            Err(reason) => Err(self.no_swing(duty, reason)),
        }
    }

    fn no_swing(&self, duty: u8, reason: &'static str) -> RecordError {
        RecordError::NoSwing { motor: self.motor + 1, duty, reason }
    }
}

/// Adds slow points to a line, and the duty `stands` at which the motor stands. Between it and the first point, `slow` is a duty
/// whose motion is no swing: a motor that hardly turns sticks now and then, and a flagellum that touches the standing one winds.
fn with_start(
    mut points: Vec<(u8, f64)>,
    mut stands: u8,
    mut slow: u8,
    mut told: impl FnMut(u8) -> Result<Option<f64>, RecordError>,
) -> Result<Vec<(u8, f64)>, RecordError> {
    let mut turns = points[0].0;
    for halved in 0..MOST_HALVINGS {
        if turns - slow < 2 || halved >= HALVINGS && points[0].1.abs() < SLOW_RPM {
            break;
        }
        let duty = slow.midpoint(turns);
        match told(duty) {
            Ok(Some(rpm)) => {
                turns = duty;
                points.insert(0, (duty, rpm));
            }
            Ok(None) => (stands, slow) = (duty, duty),
            Err(RecordError::NoSwing { .. }) => slow = duty,
            Err(error) => return Err(error),
        }
    }
    points.insert(0, (stands, 0.0));
    Ok(points)
}

/// Returns whether a motor turns backwards at a positive duty, according to most of its points.
fn senses(motor: usize, forwards: &[(u8, f64)], backwards: &[(u8, f64)]) -> Result<bool, RecordError> {
    let sum = |points: &[(u8, f64)]| points.iter().skip(1).map(|(_, rpm)| rpm.signum()).sum::<f64>();
    let most = (forwards.len() + backwards.len()) as f64 / 2.0 - 1.0;
    match sum(forwards) - sum(backwards) {
        ahead if ahead >= most => Ok(false),
        ahead if ahead <= -most => Ok(true),
        _ => {
            let reason = "it does not turn in opposite senses at opposite duties";
            Err(RecordError::NoSwing { motor: motor + 1, duty: DUTIES[DUTIES.len() - 1], reason })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The emulated rig `duty`, motor 2 backwards: it turns from 68 on, and below 75 its flagellum winds about the other one.
    #[test]
    fn a_motion_that_is_no_swing_is_not_a_motor_that_stands() {
        let told = |duty: u8| match duty {
            0..=67 => Ok(None),
            68..75 => Err(RecordError::NoSwing { motor: 2, duty, reason: "" }),
            _ => Ok(Some(-23.9)),
        };
        let points = with_start(vec![(75, -23.9), (95, -56.3)], 60, 60, told).unwrap();
        assert_eq!(points, [(67, 0.0), (75, -23.9), (95, -56.3)]);
    }
}
