//! The line of a motor without encoder: how fast it turns at which duty.
//!
//! `biflag doctor --motors` measures some points of it, in both senses. Between two points, and from the lowest one down, the line
//! is straight: a bridge whose motors are free between pulses bends it, so that no straight line through all points holds.

use super::BoardSettings;
use miette::Diagnostic;
use protocol::Settings;
use protocol::units::CentiRpm;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::RangeInclusive;
use thiserror::Error;

/// A point of a line: the duty, out of 255, and the speed without its sign.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
#[serde(deny_unknown_fields)]
pub struct LinePoint {
    /// Duty, out of 255.
    pub duty: u8,
    /// Speed of the flagellum, rpm.
    pub speed_rpm: f64,
}

/// The line of a motor, each half with its duties and speeds in ascending order.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Turning forwards: counter-clockwise, seen from above.
    pub forwards: Vec<LinePoint>,
    /// Turning backwards.
    pub backwards: Vec<LinePoint>,
}

/// The lines of both motors of a board.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub struct Lines {
    /// The board's supply when they were measured, V.
    pub supply_v: f64,
    /// The board's settings for which they hold: `bridge` and `motor_reversed`.
    pub wiring: BoardSettings,
    /// Motors 1 and 2.
    pub motor: [Line; 2],
}

/// A speed that a motor does not keep.
#[derive(Error, Diagnostic, Clone, PartialEq, Debug)]
#[error("motor {motor} turns at {} to {} rpm by its line, and {wanted_rpm} are planned", .from_rpm.ceil(), .to_rpm.floor())]
#[diagnostic(help(
    "plan other speeds: motor 1 turns at {}, motor 2 at {}; or change the supply of the motors and measure them again with `biflag doctor --motors`",
    .ranges[0], .ranges[1]
))]
pub struct OffTheLine {
    /// 1 or 2.
    pub motor: usize,
    /// The planned speed.
    pub wanted_rpm: f64,
    /// The lowest speed in this sense; a slower motor may stand.
    pub from_rpm: f64,
    /// The largest one.
    pub to_rpm: f64,
    /// All speeds of motors 1 and 2.
    pub ranges: [String; 2],
}

/// The shares of its line that a motor is followed to. What a larger one would make of the other speeds is not known: slow motors on
/// the steep part of their lines lose more.
const MOST_SAG: RangeInclusive<f64> = 0.85..=1.15;

/// Share of the lowest measured speed from which on a duty is told.
const LOWEST: f64 = 0.8;

impl Lines {
    /// Returns the duties, without signs, at which both motors turn at these speeds.
    ///
    /// # Errors
    /// [`OffTheLine`].
    pub fn duties(&self, speeds: [CentiRpm; 2]) -> Result<[u8; 2], OffTheLine> {
        let mut duties = [0; 2];
        for (motor, speed) in speeds.into_iter().enumerate() {
            let wanted_rpm = speed.rpm();
            duties[motor] = self.motor[motor].duty(wanted_rpm).map_err(|[from_rpm, to_rpm]| OffTheLine {
                motor: motor + 1,
                wanted_rpm,
                from_rpm,
                to_rpm,
                ranges: self.motor.each_ref().map(Line::to_string),
            })?;
        }
        Ok(duties)
    }

    /// Corrects the lines by the speeds at which motors turned that were to turn at `speeds`: those of a battery sag.
    pub fn follow(&mut self, speeds: [CentiRpm; 2], turned_rpm: [f64; 2]) {
        for (motor, line) in self.motor.iter_mut().enumerate() {
            let share = turned_rpm[motor] / speeds[motor].rpm();
            if MOST_SAG.contains(&share) {
                // A bridge may brake in one sense and coast in the other.
                let points = if speeds[motor].rpm() < 0.0 { &mut line.backwards } else { &mut line.forwards };
                points.iter_mut().for_each(|point| point.speed_rpm *= share);
            }
        }
    }

    /// Returns the settings for which the lines of a board with these settings hold.
    pub fn wiring_of(settings: &Settings) -> BoardSettings {
        let BoardSettings { bridge, motor_reversed, .. } = BoardSettings::all(settings);
        BoardSettings { bridge, motor_reversed, ..BoardSettings::default() }
    }
}

impl Line {
    /// Returns the duty of a speed.
    ///
    /// # Errors
    /// The slowest and the fastest speed that are told.
    fn duty(&self, speed_rpm: f64) -> Result<u8, [f64; 2]> {
        let points = if speed_rpm < 0.0 { &self.backwards } else { &self.forwards };
        let wanted = speed_rpm.abs();
        if wanted == 0.0 {
            return Ok(0);
        }
        let at = points.partition_point(|point| point.speed_rpm < wanted).clamp(1, points.len().max(2) - 1);
        let (Some(low), Some(high)) = (points.get(at - 1), points.get(at)) else { return Err([0.0; 2]) };
        let slope = f64::from(high.duty - low.duty) / (high.speed_rpm - low.speed_rpm);
        let duty = f64::from(low.duty) + (wanted - low.speed_rpm) * slope;
        let range = range_rpm(points);
        if duty > f64::from(u8::MAX) || wanted < range[0] { Err(range) } else { Ok(duty.round().max(1.0) as u8) }
    }
}

/// Returns the slowest and the fastest speed that points of one sense tell, rpm.
fn range_rpm(points: &[LinePoint]) -> [f64; 2] {
    let [.., before, last] = points else { return [0.0; 2] };
    let lowest = LOWEST * points.iter().map(|point| point.speed_rpm).find(|rpm| *rpm > 0.0).unwrap_or_default();
    let rise = (last.speed_rpm - before.speed_rpm) / f64::from(last.duty - before.duty);
    [lowest, last.speed_rpm + f64::from(u8::MAX - last.duty) * rise]
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [forwards, backwards] = [&self.forwards, &self.backwards].map(|points| {
            let [from, to] = range_rpm(points);
            format!("{} to {} rpm", from.ceil(), to.floor())
        });
        write!(f, "{forwards} forwards and {backwards} backwards")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines() -> Lines {
        let points = |all: [(u8, f64); 3]| all.map(|(duty, speed_rpm)| LinePoint { duty, speed_rpm }).to_vec();
        let line = Line {
            forwards: points([(60, 20.0), (100, 50.0), (200, 100.0)]),
            backwards: points([(60, 10.0), (100, 30.0), (200, 60.0)]),
        };
        Lines { supply_v: 5.0, wiring: Lines::wiring_of(&Settings::DEFAULT), motor: [line.clone(), line] }
    }

    #[test]
    fn duties_are_those_of_the_line_in_each_sense() {
        let duties = |one: f64, two: f64| lines().duties([one, two].map(CentiRpm::from_rpm));
        assert_eq!(duties(50.0, -30.0), Ok([100, 100]));
        assert_eq!(duties(35.0, 75.0), Ok([80, 150]));
        assert_eq!(duties(0.0, 18.0), Ok([0, 57]), "along the lowest part");
        assert_eq!(duties(110.0, -66.0), Ok([220, 220]), "along the highest part");
        let error = duties(20.0, -80.0).unwrap_err();
        assert_eq!(error.to_string(), "motor 2 turns at 8 to 76 rpm by its line, and -80 are planned");
        assert_eq!(error.ranges, ["16 to 127 rpm forwards and 8 to 76 rpm backwards"; 2]);
        assert!(duties(15.0, 30.0).is_err(), "it may stand");
        assert!(Lines::default().duties([CentiRpm(1), CentiRpm(0)]).is_err(), "nothing was measured");
    }

    #[test]
    fn lines_follow_the_speeds_of_the_last_trial() {
        let asked = |one: f64, two: f64| [one, two].map(CentiRpm::from_rpm);
        let mut lines = lines();
        // Motor 2 stood.
        lines.follow(asked(50.0, -30.0), [45.0, 0.5]);
        assert_eq!(lines.duties(asked(45.0, -30.0)), Ok([100, 100]));
        lines.follow(asked(45.0, 0.0), [50.0, 0.0]);
        assert_eq!(lines, super::tests::lines(), "and back");
    }

    #[test]
    fn lines_go_to_a_file_and_back() {
        let text = toml::to_string(&lines()).unwrap();
        assert_eq!(toml::from_str::<Lines>(&text).unwrap(), lines());
    }
}
