//! The report of a step, or why it failed.

use crate::body::load::Load;

/// Why a step failed; a shorter one may succeed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum StepFailure {
    /// The iteration stopped getting better.
    #[error(
        "the iteration stalled at a velocity residual of {residual:.1e} m/s (wanted {wanted:.1e}), gap error {gap:.1e} m"
    )]
    Stalled { residual: f64, wanted: f64, gap: f64 },
    /// A number overflowed.
    #[error("the iteration diverged")]
    Diverged,
    /// The rods went through each other.
    #[error("the rods passed through each other")]
    PassedThrough,
    /// The time formula's error is too large.
    #[error("the motion is not resolved: error estimate {error:.1e} m (allowed {allowed:.1e})")]
    Unresolved { error: f64, allowed: f64 },
    /// The robot touches the tank, or is beyond its walls.
    #[error("the robot touches a wall or the surface of the tank")]
    TouchesTank,
    /// The frozen inverse does not exist.
    #[error("the rod's equations are singular")]
    Singular,
}

/// Report of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Sweeps taken.
    pub sweeps: u32,
    /// Velocity residual before the last update, m/s.
    pub residual: f64,
    /// Estimated error of the time formula, m: displacement of the flagella against the fluid, root mean square. Zero for the
    /// first steps from rest, whose past has too few points for an estimate.
    pub error: f64,
    /// Number of pairs that press.
    pub touching: u32,
    /// Number of pressing pairs between the flagella; the others press a flagellum against itself.
    pub between: u32,
    /// Largest force of a pair, N.
    pub largest_force: f64,
    /// Loads of the fluid on the clamps, body axes.
    pub fluid: [Load; 2],
    /// Load of the fluid on a head that is a body in the flow, body axes. With a one-way closure the head is held
    /// still.
    pub head: Load,
    /// Loads of contact on the clamps, body axes.
    pub contact: [Load; 2],
    /// Net weight of the flagella, body axes at the base's attitude.
    pub weight: [Load; 2],
    /// Rate of change of the base's angular momentum less all moments on it, N m: the iteration's error.
    pub moment_error: f64,
}
