//! Settings of the solver.

use serde::{Deserialize, Deserializer, Serialize, de::Error};

/// Precision of the sum over far segments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 32 bits: good to about 1e-6 of the flow.
    #[default]
    Single,
    /// 64 bits: for results that must not depend on rounding, at twice the cost.
    Double,
}

/// Settings of the implicit steps, see [`crate::step`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SolverSettings {
    /// Estimated error above which the next step has half the length (5e-4); a step with a much larger error is repeated. Root
    /// mean square displacement of the flagella against the fluid, over the radius of the helix. `sim/docs/cost.md` has the
    /// resulting errors of means.
    pub step_error: f64,
    /// Longest step in rad (0.3): angle of the faster motor, or the angle between the motors if it is larger. Steps in
    /// free fluid have this length. Longer steps need a third sweep and save nothing; above 1.1 they fail.
    pub step_rad: f64,
    /// Longest step in s (0.1).
    pub longest_step_s: f64,
    /// Velocity residual at which an iteration stops, before its last update, relative to the largest
    /// speed of the helix (0.02). The error of mean forces is about a tenth of it. In steps below 0.13 rad, it is relative
    /// to the speed that would move the helix as far as a step of 0.13 rad does.
    pub tolerance: f64,
    /// Largest number of times that the longest step is halved before the trial stops with an error (10).
    pub halvings: u32,
    /// Largest number of sweeps of a step (25).
    pub sweeps: u32,
    /// Segments of the same rod up to this many edges away are integrated exactly (2).
    pub near_edges: u32,
    /// Gauss points of all other segments, 2 to 4 (2).
    pub gauss_points: u32,
    /// Precision of the sum over far segments (single). Only programs can change it; mean forces are then the same to
    /// six digits. Files of older versions may contain it, as single.
    #[serde(skip_serializing, deserialize_with = "single")]
    pub far_field: Precision,
}

fn single<'de, D: Deserializer<'de>>(value: D) -> Result<Precision, D::Error> {
    match String::deserialize(value)?.as_str() {
        "single" => Ok(Precision::Single),
        other => Err(D::Error::unknown_variant(other, &["single"])),
    }
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self {
            step_error: 5e-4,
            step_rad: 0.3,
            longest_step_s: 0.1,
            tolerance: 0.02,
            halvings: 10,
            sweeps: 25,
            near_edges: 2,
            gauss_points: 2,
            far_field: Precision::Single,
        }
    }
}
