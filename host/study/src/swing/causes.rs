//! The usual mistakes of a label of speeds.

use sim::functions::ln;
use std::fmt;

/// The cause of a wrong label: what was true instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cause {
    /// One or both motors turned this many times as fast.
    Factor {
        /// Which motors.
        motors: [bool; 2],
        /// True speed divided by the label's.
        factor: f64,
    },
    /// These motors turned the other way.
    Sign([bool; 2]),
    /// Each motor had the speed of the other.
    Swapped,
    /// Each motor had the speed of the other, and turned the other way.
    Reversed,
    /// This motor stood.
    Stands(usize),
    /// The motors turned at these speeds, rpm.
    Other([f64; 2]),
    /// None of these: the strongest line is at this speed, rpm.
    Unknown {
        /// Speed of the line, without its sense.
        line_rpm: f64,
    },
    /// The motors stopped before the end of the run.
    StopEarly {
        /// Time on the clock of the angles.
        at_s: f64,
    },
}

/// Speeds of slower motors are not judged: their lines are weak compared with the disturbances of a rig.
pub const SLOWEST_RPM: f64 = 10.0;

/// Faster motors are not expected.
pub const FASTEST_RPM: f64 = 130.0;

/// Factors of both motors: wrong counts, gears or time bases; and turns a second, degrees or radians read as rpm.
const OF_BOTH: [f64; 14] =
    [0.25, 0.5, 1.0 / 1.5, 1.5, 2.0, 4.0, 1.0 / 1.05, 1.05, 1.0 / 6.0, 6.0, 9.55, 1.0 / 9.55, 60.0, 1.0 / 60.0];

/// Factors of one motor: wrong counts or gear.
const OF_ONE: [f64; 8] = [0.25, 0.5, 1.0 / 1.5, 1.5, 2.0, 4.0, 1.0 / 1.05, 1.05];

/// Returns the causes that can be tested for a label, and the speeds of each.
pub fn causes(rpm: [f64; 2]) -> Vec<(Cause, [f64; 2])> {
    let both = OF_BOTH.map(|factor| ([true; 2], factor));
    let one = OF_ONE.into_iter().flat_map(|factor| [([true, false], factor), ([false, true], factor)]);
    let factors = both.into_iter().chain(one).map(|(motors, factor)| Cause::Factor { motors, factor });
    let signs = [[true, false], [false, true], [true; 2]].map(Cause::Sign);
    let others = [Cause::Swapped, Cause::Reversed, Cause::Stands(0), Cause::Stands(1)];
    let all = factors.chain(signs).chain(others);
    all.filter_map(|cause| Some((cause, cause.applied(rpm)?))).collect()
}

impl Cause {
    /// Returns the true speeds for the speeds of a label; `None` if a motion could not show the cause, or if it changes nothing.
    fn applied(self, rpm: [f64; 2]) -> Option<[f64; 2]> {
        let is_fast = |speed: f64| speed.abs() >= SLOWEST_RPM;
        let of_motors = |motors: [bool; 2], factor: f64| {
            let turned = [0, 1].map(|k| if motors[k] { rpm[k] * factor } else { rpm[k] });
            let is_told = |k: usize| {
                motors[k] && is_fast(turned[k]) && (motors == [true; 2] || rpm[k].abs() >= SLOWEST_RPM / 2.0)
            };
            let told = (0..2).filter(|&k| is_told(k)).count();
            let wanted = if motors == [true; 2] { 1 } else { 2 - usize::from(!motors[0]) - usize::from(!motors[1]) };
            (told >= wanted && turned.iter().all(|w| w.abs() < FASTEST_RPM)).then_some(turned)
        };
        match self {
            Self::Factor { motors, factor } => {
                // Below 15 rpm a short run does not resolve 5 %.
                let is_small = (factor - 1.0).abs() < 0.1;
                let is_told = !is_small || (0..2).any(|k| motors[k] && rpm[k].abs() >= 15.0);
                of_motors(motors, factor).filter(|_| is_told)
            }
            Self::Sign(motors) => of_motors(motors, -1.0),
            Self::Swapped => (rpm.into_iter().all(is_fast) && rpm[0] != rpm[1]).then_some([rpm[1], rpm[0]]),
            Self::Reversed => Self::Swapped.applied(rpm).map(|turned| turned.map(|w| -w)),
            Self::Stands(motor) => {
                let other = rpm[1 - motor];
                let left = if motor == 0 { [0.0, other] } else { [other, 0.0] };
                (rpm.into_iter().all(is_fast)).then_some(left)
            }
            Self::Other(rpm) => Some(rpm),
            Self::Unknown { .. } | Self::StopEarly { .. } => None,
        }
    }

    /// Returns whether the cause is about one motor alone.
    pub fn is_of_one(self) -> bool {
        match self {
            Self::Factor { motors, .. } | Self::Sign(motors) => motors != [true; 2],
            Self::Stands(_) => true,
            Self::Swapped | Self::Reversed | Self::Other(_) | Self::Unknown { .. } | Self::StopEarly { .. } => false,
        }
    }

    /// Returns whether a line at a sum or a difference of two right speeds can imitate the cause: a large factor of one motor, or
    /// a small one of both.
    pub fn is_mixed(self) -> bool {
        match self {
            Self::Factor { factor, .. } => self.is_of_one() == (ln(factor.abs()).abs() > 1.0),
            Self::Stands(_) => true,
            _ => false,
        }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = |motors: [bool; 2]| match motors {
            [true, true] => "both motors",
            [true, false] => "motor 1",
            _ => "motor 2",
        };
        match self {
            Self::Factor { motors, factor } => write!(f, "{} turned {factor:.3} times as fast", of(*motors)),
            Self::Sign(motors) => write!(f, "{} turned the other way", of(*motors)),
            Self::Swapped => write!(f, "each motor had the speed of the other"),
            Self::Reversed => write!(f, "each motor had the speed of the other, and turned the other way"),
            Self::Stands(motor) => write!(f, "motor {} stood", motor + 1),
            Self::Other([one, two]) => write!(f, "the motors turned at {one:.1} and {two:.1} rpm"),
            Self::Unknown { line_rpm } => {
                write!(f, "the motors turned at other speeds, one of them maybe at {line_rpm:.1} rpm")
            }
            Self::StopEarly { at_s } => write!(f, "the motors stopped at {at_s:.0} s"),
        }
    }
}
