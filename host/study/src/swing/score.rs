//! Scores how well a fit matches two motors that swing a base.
//!
//! The constants are from recordings on the emulated board, of robots of several stiffnesses and lengths.

use super::fit::{Complex, Fit, Line, angle_deg, size};
use crate::attitude::wrapped;
use sim::functions::{cos, ln, pow};

/// Weight of the logarithm of the unexplained share.
const FIT: f64 = 7.0;

/// Weight of the logarithm of the share of the motors' own lines in all lines.
const SHARE: f64 = 12.0;

/// Added to the score of one line: what two lines gain if both are as expected.
const ONE_LINE: f64 = 6.0;

/// Phase of the swing about z relative to the swing in the plane, for motor 1 of the published robot, degrees. Motor 2 has half a
/// turn more.
const PHASE_DEG: f64 = 18.0;

/// Least swing of such a robot, as a share of the expected one.
const LEAST: f64 = 0.1;

/// Returns the least swing of a robot whose faster motor turns at this speed: in the plane, and about z, °/s.
pub fn least_dps(rpm: f64) -> [f64; 2] {
    [in_plane_dps(rpm), about_z_dps(rpm)].map(|expected| LEAST * expected)
}

/// Returns the usual swing in the plane of a motor at this speed, °/s.
pub fn in_plane_dps(rpm: f64) -> f64 {
    0.075 * rpm * pow(rpm / 45.0, 0.7)
}

/// Returns the ratio of a motor's usual swing to the other motor's, whose bending flagellum may hide it.
pub fn beside_the_other(rpm: [f64; 2], motor: usize) -> f64 {
    in_plane_dps(rpm[motor].abs()) / in_plane_dps(rpm[1 - motor].abs())
}

fn about_z_dps(rpm: f64) -> f64 {
    0.19 * rpm
}

/// Returns the score of a fit. Differences of scores between readings of one motion are like log-likelihood ratios.
pub fn score(fit: &Fit) -> f64 {
    let own = [0, 1].map(|motor| fit.motor(motor));
    let left: f64 = fit.left.iter().map(|left| ln(left + 1e-3)).sum();
    let are_opposite = fit.hz[0] * fit.hz[1] < 0.0;
    let all: f64 = fit.lines.iter().map(|line| line.turns.norm_sqr() + line.opposite.norm_sqr()).sum();
    let shared =
        if own[1].is_none() && are_opposite { own[0].map_or(0.0, |line| line.opposite.norm_sqr()) } else { 0.0 };
    let of_motors: f64 = own.iter().flatten().map(|line| line.turns.norm_sqr()).sum::<f64>() + shared;
    let common = -FIT * left + SHARE * ln(of_motors / (all + 1e-12) + 1e-9);
    common
        + match own {
            [Some(one), Some(other)] => two(fit, [one, other]),
            [Some(line), None] if fit.hz[1] == 0.0 => ONE_LINE + swing(line, fit.hz[0], 0) + single(fit, line),
            [None, Some(line)] => ONE_LINE + swing(line, fit.hz[1], 1) + single(fit, line),
            [Some(line), None] if are_opposite => opposite(line, fit.hz),
            [Some(line), None] => ONE_LINE + in_plane(line.turns, fit.hz[0]) + single(fit, line),
            [None, None] => -100.0,
        }
}

fn two(fit: &Fit, own: [&Line; 2]) -> f64 {
    let mixed = fit.lines.iter().filter(|line| line.of[0] != 0 && line.of[1] != 0);
    let strongest = mixed.flat_map(|line| [size(line.turns), size(line.opposite)]).fold(1e-3, f64::max);
    let of_one = |motor: usize| {
        let line = own[motor];
        4.0 * ln(size(line.turns) / strongest + 1e-9).clamp(-2.0, 1.0)
            - 2.0 * square((flat(line) - 0.25).max(0.0) / 0.35)
            + swing(line, fit.hz[motor], motor)
    };
    let between = wrapped(off_deg(own[0], 0) - off_deg(own[1], 1));
    of_one(0) + of_one(1) - 0.5 * square(between / 45.0)
}

/// Returns the score of a line that stands alone: it should turn, and have weak harmonics.
fn single(fit: &Fit, line: &Line) -> f64 {
    let harmonics = fit.lines.iter().filter(|other| other.of[0].abs() + other.of[1].abs() == 2);
    let own = size(line.turns) + 1e-9;
    let of_harmonics: f64 = harmonics
        .flat_map(|other| [size(other.turns), size(other.opposite)])
        .map(|other| square((other / own - 0.25).max(0.0) / 0.12))
        .sum();
    -0.5 * (square((flat(line) - 0.25).max(0.0) / 0.12) + of_harmonics).min(60.0)
}

/// Returns the score of two motors of equal and opposite speeds: one line that turns both ways.
fn opposite(line: &Line, hz: [f64; 2]) -> f64 {
    let (a, b) = (line.turns, line.opposite);
    let (s, c) = sim::functions::sin_cos(PHASE_DEG.to_radians());
    let phase = Complex::new(c, s);
    // Motor 2 swings at the opposite frequency, and the other way about z.
    let both = a * phase - (b * phase).conj();
    let ratio = size(line.about_z) / (size(both) + 1e-9);
    let unequal = (ln((size(a) + 1e-9) / (size(b) + 1e-9)).abs() - 1.1).max(0.0);
    -0.5 * square(unequal / 0.35).min(60.0) + near(ratio, 2.5, 0.6) - 0.5 * square(angle_deg(line.about_z, both) / 50.0)
        + in_plane(a, hz[0])
        + in_plane(b, hz[1])
}

fn swing(line: &Line, hz: f64, motor: usize) -> f64 {
    near(size(line.about_z), about_z_dps(hz.abs() * 60.0), 0.55) + in_plane(line.turns, hz)
        - 0.5 * square(off_deg(line, motor) / 38.0)
}

fn in_plane(turns: Complex, hz: f64) -> f64 {
    near(size(turns), in_plane_dps(hz.abs() * 60.0), 0.9)
}

/// Returns the difference of the phase of the swing about z from a motor's expected phase, degrees.
pub fn off_deg(line: &Line, motor: usize) -> f64 {
    wrapped(angle_deg(line.about_z, line.turns) - PHASE_DEG - 180.0 * motor as f64)
}

/// Returns how well the phases of both swings about z match their motors: 2 for an exact match, 0 if they show nothing.
pub fn agreement(fit: &Fit) -> f64 {
    let of = |motor: usize| fit.motor(motor).map_or(0.0, |line| cos(off_deg(line, motor).to_radians()));
    of(0) + of(1)
}

fn flat(line: &Line) -> f64 {
    (size(line.opposite) / (size(line.turns) + 1e-9)).min(2.0)
}

fn near(size: f64, expected: f64, spread: f64) -> f64 {
    -0.5 * square(ln((size + 1e-9) / expected) / spread).min(30.0)
}

fn square(x: f64) -> f64 {
    x * x
}
