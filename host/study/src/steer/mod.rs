//! Steering: reaches an attitude and holds it, on the rig and in the model.
//!
//! Twenty times a second a [`Pilot`] receives an [`Observation`] and returns the speeds of both motors. A pilot is the
//! built-in [`Controller`], or a [`Policy`]: any program that reads a line of JSON and writes one. [`Steering`] is the
//! control loop without a clock: the rig (crate `rig`) and the model ([`crate::run::model::steer`]) call it at the
//! ticks of their own boards.
//!
//! At any speeds, the robot swings by some degrees with each turn of its flagella. Only the mean over some turns can be
//! reached and held ([`Means`]).

mod budget;
mod controller;
mod error;
mod means;
mod observation;
mod policy;
mod result;
mod steering;

pub use budget::{YawError, yaw_error};
pub use controller::{Controller, Map};
pub use error::SteerError;
pub use means::Means;
pub use observation::{Measured, Observation, Wanted};
pub use policy::{PATIENCE_OF_MODEL, PATIENCE_OF_RIG, Policy};
pub use result::{Held, Tally};
pub use steering::{Pilot, SetPoint, Steering, Times, message};

/// Observations and set-points per second.
pub const RATE_HZ: f64 = 20.0;

/// Time between two observations, µs of the board's clock: ten of its ticks.
pub const PERIOD_US: u64 = 50_000;

/// An attitude counts as reached if the errors of mean yaw and pitch are at most this, degrees.
pub const REACHED_DEG: f64 = 1.0;

/// The result is the means over this time at the end of a run, s.
pub const HELD_S: f64 = 30.0;
