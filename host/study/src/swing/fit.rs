//! Lines fitted to a motion, and their readings: which motor has which line, and in which sense.

use super::MOST_LEFT;
use sim::functions::atan2;

/// Least ratio of the weaker motor's swing to the stronger one's.
const WEAKEST: f64 = 0.07;

/// A complex number.
pub type Complex = nalgebra::Complex<f64>;

/// Returns the magnitude of a number.
pub fn size(number: Complex) -> f64 {
    number.norm_sqr().sqrt()
}

/// Returns the angle of a number relative to another one, degrees.
pub fn angle_deg(one: Complex, other: Complex) -> f64 {
    let quotient = one * other.conj();
    atan2(quotient.im, quotient.re).to_degrees()
}

/// A spectral line: components of the rates in the plane, wx + i wy, at its frequency and at the opposite one; and of the rate
/// about z.
#[derive(Clone, Copy, Debug, Default)]
pub struct Line {
    /// Its multiples of the two frequencies.
    pub of: [i32; 2],
    /// Component of wx + i wy at its frequency.
    pub turns: Complex,
    /// Component of wx + i wy at the opposite frequency.
    pub opposite: Complex,
    /// Component of the rate about z.
    pub about_z: Complex,
}

/// A fit of lines to a motion.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The two frequencies, Hz, with their signs. Zero: no line.
    pub hz: [f64; 2],
    /// Lines at distinct frequencies. A line shared by both motors is listed once, as motor 1's.
    pub lines: Vec<Line>,
    /// Unexplained share of the squares of the motion: in the plane, and about z.
    pub left: [f64; 2],
    /// Part of these shares that may be noise.
    pub noise: [f64; 2],
}

impl Fit {
    /// Returns the line of a motor.
    pub fn motor(&self, motor: usize) -> Option<&Line> {
        self.lines.iter().find(|line| line.of[motor] == 1 && line.of[1 - motor] == 0)
    }

    /// Returns whether its lines leave more of the motion unexplained than those of two motors do.
    pub fn leaves_much(&self) -> bool {
        self.left.iter().zip(self.noise).any(|(left, noise)| left - noise > MOST_LEFT)
    }

    /// Returns whether one motor's swing is so weak that it may be a part of the other's.
    pub fn hides_one(&self) -> bool {
        let [Some(one), Some(other)] = [self.motor(0), self.motor(1)] else { return false };
        let [one, other] = [size(one.turns), size(other.turns)];
        one.min(other) < WEAKEST * one.max(other)
    }

    /// Returns the same lines read with other senses, as factors of the frequencies, or with the motors swapped.
    pub fn read(&self, senses: [f64; 2], swapped: bool) -> Self {
        let mut fit = self.clone();
        for line in &mut fit.lines {
            // Only lines of a single motor have a sense.
            let of = usize::from(line.of[0] == 0);
            if senses[of] < 0.0 && line.of[1 - of] == 0 {
                (line.turns, line.opposite, line.about_z) = (line.opposite, line.turns, line.about_z.conj());
            }
            line.of = if swapped { [line.of[1], line.of[0]] } else { line.of };
        }
        let hz = [0, 1].map(|k| senses[k] * self.hz[k]);
        Self { hz: if swapped { [hz[1], hz[0]] } else { hz }, ..fit }
    }
}
