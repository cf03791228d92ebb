//! The line of a motor without encoder: how fast it turns at which duty.
//!
//! `biflag doctor --motors` measures some of its points, in both senses. If the bridge lets the motors run freely between pulses,
//! the line is curved, so a curve leads through the points. Below the slowest point that turns, and beyond the last one, it is
//! straight: the duty at which a motor begins to turn is only known to lie between two measured ones.

use super::BoardSettings;
use miette::Diagnostic;
use nalgebra::{Matrix2, Vector2};
use protocol::Settings;
use protocol::units::CentiRpm;
use serde::{Deserialize, Serialize};
use sim::functions::{exp, ln};
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
    /// What the supply has changed since the measurement.
    #[serde(skip)]
    pub sag: Sag,
}

/// Increase of a line's duties because its supply has sagged, as a logarithm that is linear in the speed: a motor that runs freely
/// between pulses needs more of it at high speeds, a motor that brakes the same at all. A Kalman filter estimates both terms.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sag {
    terms: Vector2<f64>,
    covariance: Matrix2<f64>,
}

/// The lines of both motors of a board.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
pub struct Lines {
    /// The board's settings for which they hold: `bridge` and `motor_reversed`.
    pub wiring: BoardSettings,
    /// Motors 1 and 2.
    pub motor: [Line; 2],
}

/// A speed outside the range of a motor's line.
#[derive(Error, Diagnostic, Clone, PartialEq, Debug)]
#[error("motor {motor} turns at {} to {} rpm by its line, and {wanted_rpm} are planned", .from_rpm.ceil(), .to_rpm.floor())]
#[diagnostic(code(wrong_use), help(
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
    /// The highest speed in this sense.
    pub to_rpm: f64,
    /// All speeds of motors 1 and 2.
    pub ranges: [String; 2],
}

/// Ratios of the used to the expected duty that one trial may correct.
const MOST_SAG: RangeInclusive<f64> = 0.65..=1.5;

/// Covariance of both terms of a sag before the first trial: it takes more duty at high speeds, as a rule. Own choice. The terms
/// change by a hundredth of it from trial to trial, and a trial tells the logarithm with as much, because the speed wanders and the
/// duty is rounded.
const SAG: Matrix2<f64> = Matrix2::new(1e-2, 4e-3, 4e-3, 3e-3);
const OF_A_TRIAL: f64 = 0.01;

/// Speed at which the first term of a sag holds, rpm.
const MIDDLE_RPM: f64 = 50.0;

/// Lowest speed with a duty, as a share of the lowest measured speed.
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
            let duty = self.motor[motor].duty(wanted_rpm).map_err(|[from_rpm, to_rpm]| OffTheLine {
                motor: motor + 1,
                wanted_rpm,
                from_rpm,
                to_rpm,
                ranges: self.motor.each_ref().map(Line::to_string),
            })?;
            duties[motor] = duty.round() as u8;
        }
        Ok(duties)
    }

    /// Corrects the duties for a sagging battery, from the speeds `turned_rpm` that the motors reached instead of `speeds`.
    pub fn follow(&mut self, speeds: [CentiRpm; 2], turned_rpm: [f64; 2]) {
        for (motor, line) in self.motor.iter_mut().enumerate() {
            let (asked_rpm, turned_rpm) = (speeds[motor].rpm(), turned_rpm[motor]);
            let [used, expected] = [asked_rpm, turned_rpm].map(|rpm| line.duty(rpm));
            let (Ok(used), Ok(expected)) = (used.map(f64::round), expected) else { continue };
            if turned_rpm * asked_rpm > 0.0 && MOST_SAG.contains(&(used / expected)) {
                line.sag.correct(ln(used / expected), turned_rpm);
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
    /// Returns the points of the sense of a speed.
    fn points(&self, speed_rpm: f64) -> &[LinePoint] {
        if speed_rpm < 0.0 { &self.backwards } else { &self.forwards }
    }

    /// Returns the duty of a speed.
    ///
    /// # Errors
    /// The slowest and the fastest speed with a duty.
    fn duty(&self, speed_rpm: f64) -> Result<f64, [f64; 2]> {
        let (points, wanted) = (self.points(speed_rpm), speed_rpm.abs());
        if wanted == 0.0 {
            return Ok(0.0);
        }
        let range = range_rpm(points, &self.sag);
        let is_told = wanted >= range[0] && wanted <= range[1];
        if is_told { Ok((curve(points, wanted) * self.sag.factor(wanted)).max(1.0)) } else { Err(range) }
    }
}

impl Default for Sag {
    fn default() -> Self {
        Self { terms: Vector2::zeros(), covariance: SAG }
    }
}

impl Sag {
    /// Returns the ratio of the duty of a speed to the measured one.
    fn factor(&self, rpm: f64) -> f64 {
        exp(self.terms.dot(&at(rpm)))
    }

    /// Corrects the terms by the logarithm of the used to the expected duty of a speed.
    fn correct(&mut self, more: f64, rpm: f64) {
        let at = at(rpm);
        self.covariance += OF_A_TRIAL * SAG;
        let both = self.covariance * at;
        let gain = both / (at.dot(&both) + OF_A_TRIAL * SAG[(0, 0)]);
        self.terms += gain * more;
        self.covariance -= gain * both.transpose();
    }
}

/// Returns the factors of the terms of a sag at a speed.
fn at(rpm: f64) -> Vector2<f64> {
    Vector2::new(1.0, rpm.abs() / MIDDLE_RPM - 1.0)
}

/// Returns the duty of a speed on the curve through points: a cubic in each interval. Its slope at a point is the harmonic mean
/// of the slopes of both chords there, so that the curve rises where the points do (Butland 1980).
fn curve(points: &[LinePoint], rpm: f64) -> f64 {
    let last = points.len() - 1;
    let at = points.partition_point(|point| point.speed_rpm < rpm).clamp(1, last);
    let width = |i: usize| points[i].speed_rpm - points[i - 1].speed_rpm;
    let chord = |i: usize| f64::from(points[i].duty - points[i - 1].duty) / width(i);
    let slope = |i: usize| if i == last { chord(i) } else { 2.0 / (1.0 / chord(i) + 1.0 / chord(i + 1)) };
    let before = points[at - 1];
    let rise = rpm - before.speed_rpm;
    let (part, straight) = (rise / width(at), f64::from(before.duty) + rise * chord(at));
    if at == 1 || part > 1.0 {
        return straight;
    }
    let [begin, end] = [slope(at - 1), slope(at)].map(|slope| slope - chord(at));
    straight + width(at) * part * (1.0 - part) * ((1.0 - part) * begin - part * end)
}

/// Returns the slowest and the fastest speed in one sense, rpm.
fn range_rpm(points: &[LinePoint], sag: &Sag) -> [f64; 2] {
    let [.., before, last] = points else { return [0.0; 2] };
    let lowest = LOWEST * points.iter().map(|point| point.speed_rpm).find(|rpm| *rpm > 0.0).unwrap_or_default();
    let rise = (last.speed_rpm - before.speed_rpm) / f64::from(last.duty - before.duty);
    let highest = |rpm: f64| last.speed_rpm + (f64::from(u8::MAX) / sag.factor(rpm) - f64::from(last.duty)) * rise;
    // The sag is that of the highest speed itself.
    [lowest, (0..4).fold(last.speed_rpm, |rpm, _| highest(rpm))]
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [forwards, backwards] = [&self.forwards, &self.backwards].map(|points| {
            let [from, to] = range_rpm(points, &self.sag);
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
            sag: Sag::default(),
        };
        Lines { wiring: Lines::wiring_of(&Settings::DEFAULT), motor: [line.clone(), line] }
    }

    #[test]
    fn duties_are_those_of_the_line_in_each_sense() {
        let duties = |one: f64, two: f64| lines().duties([one, two].map(CentiRpm::from_rpm));
        assert_eq!(duties(50.0, -30.0), Ok([100, 100]));
        assert_eq!(duties(35.0, 75.0), Ok([80, 148]), "on a curve, where more than one chord leads there");
        assert_eq!(duties(0.0, 18.0), Ok([0, 57]), "along the lowest part");
        assert_eq!(duties(110.0, -66.0), Ok([220, 220]), "along the highest part");
        let error = duties(20.0, -80.0).unwrap_err();
        assert_eq!(error.to_string(), "motor 2 turns at 8 to 76 rpm by its line, and -80 are planned");
        assert_eq!(error.ranges, ["16 to 127 rpm forwards and 8 to 76 rpm backwards"; 2]);
        assert!(duties(15.0, 30.0).is_err(), "it may stand");
        assert!(Lines::default().duties([CentiRpm(1), CentiRpm(0)]).is_err(), "nothing was measured");
    }

    #[test]
    fn a_curve_leads_through_the_points_where_the_line_is_bent() {
        // The line of the emulated rig `duty-in-in`, motor 1 forwards at 6.4 V, and its speed between two points of it.
        let points =
            [(37, 0.0), (41, 11.0), (45, 26.6), (60, 66.9), (75, 90.1), (95, 108.1), (130, 124.2), (200, 134.0)];
        let points = points.map(|(duty, speed_rpm)| LinePoint { duty, speed_rpm });
        for (duty, speed_rpm) in [(43, 19.1), (50, 42.7), (55, 56.2), (67, 79.2), (85, 100.5)] {
            let told = curve(&points, speed_rpm);
            assert!((told - f64::from(duty)).abs() < 0.5, "{speed_rpm} rpm at {told}, not {duty}");
        }
        points.iter().for_each(|point| assert!((curve(&points, point.speed_rpm) - f64::from(point.duty)).abs() < 1e-9));
    }

    #[test]
    fn lines_follow_the_supply_by_the_speeds_of_the_last_trials() {
        let asked = |one: f64, two: f64| [one, two].map(CentiRpm::from_rpm);
        let mut lines = lines();
        // Motor 2 stood.
        lines.follow(asked(50.0, -30.0), [45.0, 0.5]);
        assert_eq!(
            lines.duties(asked(-30.0, -30.0)),
            Ok([106, 100]),
            "100 by 93, in both senses, a little less for a slow speed"
        );
        lines.follow(asked(50.0, -30.0), [45.0, 0.5]);
        assert_eq!(lines.duties(asked(50.0, -30.0)), Ok([112, 100]), "most of what is left");
        // With a supply that is a tenth lower, a duty of 100 does what 90 did.
        let before = super::tests::lines().motor[0].clone();
        for rpm in [50.0, 75.0, 35.0, 60.0, 80.0] {
            let [duty, _] = lines.duties(asked(rpm, 0.0)).unwrap();
            let is_that = |rpm: &f64| before.duty(*rpm).is_ok_and(|told| told >= 0.9 * f64::from(duty));
            let turned = (160..1270).map(|i| f64::from(i) * 0.1).find(is_that).unwrap();
            lines.follow(asked(rpm, 0.0), [turned, 0.0]);
        }
        assert_eq!(lines.duties(asked(50.0, 0.0)), Ok([111, 0]));
        assert!(lines.duties(asked(120.0, 0.0)).is_err(), "no longer reached");
    }

    /// The line of the emulated rig `duty`, motor 1 forwards at 6.4 V, and its duties at 5.6 V. Its bridge loses 1.8 V and lets the
    /// motor run between pulses.
    #[test]
    fn a_sag_that_grows_with_the_speed_is_followed() {
        let points = [(54, 0.0), (56, 8.5), (60, 20.9), (75, 54.9), (95, 82.0), (130, 106.6), (200, 126.7)];
        let points = points.map(|(duty, speed_rpm)| LinePoint { duty, speed_rpm }).to_vec();
        let sagged: Vec<LinePoint> =
            [(63, 8.6), (70, 19.9), (75, 29.1), (82, 40.0), (90, 50.1), (113, 70.3), (130, 79.8)]
                .map(|(duty, speed_rpm)| LinePoint { duty, speed_rpm })
                .to_vec();
        let line = Line { forwards: points, ..Line::default() };
        let mut lines = Lines { motor: [line, Line::default()], ..Lines::default() };
        let asked = |rpm: f64| [CentiRpm::from_rpm(rpm), CentiRpm(0)];
        let off = |lines: &Lines, rpm: f64| {
            let [duty, _] = lines.duties(asked(rpm)).unwrap();
            let turned = |rpm: &f64| curve(&sagged, *rpm) >= f64::from(duty);
            (60..800).map(|i| f64::from(i) * 0.1).find(turned).unwrap() - rpm
        };
        for rpm in [50.0, 25.0, 75.0] {
            let turned = rpm + off(&lines, rpm);
            lines.follow(asked(rpm), [turned, 0.0]);
        }
        for rpm in [20.0, 30.0, 45.0, 60.0, 75.0] {
            assert!(off(&lines, rpm).abs() < 0.04 * rpm, "{rpm}: {}", off(&lines, rpm));
        }
    }

    #[test]
    fn lines_go_to_a_file_and_back() {
        let text = toml::to_string(&lines()).unwrap();
        assert_eq!(toml::from_str::<Lines>(&text).unwrap(), lines());
    }
}
