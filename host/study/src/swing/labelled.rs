//! A trial whose label, its stated speeds, is tested by its motion.

use super::balance::Balance;
use super::causes::Cause;
use super::fit::Complex;
use super::lines::MIXED;
use super::score::beside_the_other;
use crate::attitude::Columns;
use std::ops::Range;

/// Ratio of a motor's usual swing to the other motor's, below which no cause about this motor alone is named.
const HIDDEN: f64 = 0.075;

/// Largest relative error of a label from a board's encoders.
const WELL_KNOWN: f64 = 0.02;

/// A trial whose label, its stated speeds, is tested.
#[derive(Clone, Debug)]
pub struct Labelled<'a> {
    /// Yaw, pitch and roll.
    pub angles_deg: &'a Columns<3>,
    /// From the settling of the motion to the end of the run, on the clock of the angles, s.
    pub settled_s: Range<f64>,
    /// Speeds of motors 1 and 2 as labelled, rpm.
    pub rpm: [f64; 2],
    /// Largest error of a right label: a share of the speed, plus rpm.
    pub off: (f64, f64),
    /// Whether flagella that turn at these speeds touch.
    pub touches: bool,
    /// Speeds estimated from the motion alone, rpm.
    pub told_rpm: Option<[f64; 2]>,
    /// Whether only the yaw was measured.
    pub has_yaw_alone: bool,
    /// The steady attitude, if it is known and settled.
    pub balance: Option<Balance>,
}

impl Labelled<'_> {
    pub(super) fn fastest_rpm(&self) -> f64 {
        self.rpm[0].abs().max(self.rpm[1].abs())
    }

    /// Returns whether both motors may be equally fast, within the error of the label.
    pub(super) fn may_be_alike(&self) -> bool {
        let apart_rpm = (self.rpm[0].abs() - self.rpm[1].abs()).abs();
        apart_rpm < 3.0 * (self.off.0 * self.fastest_rpm() + self.off.1)
    }

    /// Returns whether the speeds do not distinguish the motors.
    pub(super) fn is_vague(&self) -> bool {
        self.may_be_alike() && self.off.0 > WELL_KNOWN
    }

    /// Returns whether a cause is within the error of a right label.
    pub(super) fn allows(&self, cause: Cause) -> bool {
        match cause {
            Cause::Factor { motors, factor } => {
                let fastest = (0..2).filter(|&k| motors[k]).map(|k| self.rpm[k].abs()).fold(0.0, f64::max);
                (factor - 1.0).abs() < self.off.0 + self.off.1 / fastest
            }
            Cause::Other(rpm) => (0..2).all(|k| self.is_near(rpm, k)),
            _ => false,
        }
    }

    /// Returns the largest error of a right label in a motor's speed, rpm.
    pub fn error_rpm(&self, k: usize) -> f64 {
        self.off.0 * self.rpm[k].abs() + self.off.1
    }

    /// Returns whether a motor's speed is within the error of a right label.
    pub(super) fn is_near(&self, rpm: [f64; 2], k: usize) -> bool {
        (rpm[k] - self.rpm[k]).abs() <= self.error_rpm(k)
    }

    /// Returns the mean pitch and roll.
    pub(super) fn lean_deg(&self) -> Option<Complex> {
        let [_, pitch, roll] = self.angles_deg.tracks().map(|track| track.mean(self.settled_s.clone()));
        Some(Complex::new(pitch?, roll?))
    }

    /// Returns whether speeds agree with the label, within its error.
    pub(super) fn is_of(&self, rpm: [f64; 2]) -> bool {
        (0..2).all(|k| self.is_near(rpm, k) && (rpm[k] == 0.0) == (self.rpm[k] == 0.0))
    }

    /// Returns whether the motion alone tells the label's speeds.
    pub(super) fn is_told(&self) -> bool {
        self.told_rpm.is_some_and(|rpm| self.is_of(rpm))
    }

    /// Returns whether the line of a motor that turns otherwise is a sum or a difference of the label's lines.
    pub(super) fn mixes(&self, rpm: [f64; 2], length_s: f64) -> bool {
        let mut mixed = MIXED
            .iter()
            .filter(|of| !of.contains(&0))
            .map(|[a, b]| f64::from(*a) * self.rpm[0] + f64::from(*b) * self.rpm[1]);
        let are_one = |line_rpm: f64, k: usize| (line_rpm.abs() - rpm[k].abs()).abs() / 60.0 * length_s < 1.0;
        mixed.any(|line_rpm| (0..2).any(|k| !self.is_near(rpm, k) && are_one(line_rpm, k)))
    }

    /// Returns whether speeds differ from the label's in one motor alone, whose swing the other motor hides.
    pub(super) fn hides(&self, rpm: [f64; 2]) -> bool {
        let is_same = |k: usize| self.is_near(rpm, k);
        (0..2).any(|k| {
            !is_same(k) && is_same(1 - k) && [self.rpm, rpm].into_iter().all(|rpm| beside_the_other(rpm, k) < HIDDEN)
        })
    }
}
