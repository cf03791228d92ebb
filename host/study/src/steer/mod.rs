//! Steering: reaches an attitude and holds it, on the rig and in the model.
//!
//! Twenty times a second a [`Pilot`] gets an [`Observation`] and gives the speeds of both motors: the built-in
//! [`Controller`], or a [`Policy`], any program that reads a line of JSON and writes one. [`Steering`] is the loop without
//! its clock: the rig (crate `rig`) and the model ([`crate::run::model::steer`]) call it, each at the ticks of its own board.
//!
//! The robot swings by some degrees with each turn of its flagella, at any speeds. What can be reached and held is the mean
//! over some turns ([`Means`]).

mod budget;
mod controller;
mod error;
mod means;
mod observation;
mod pilot;
mod policy;
mod record;
mod result;
mod steering;

pub use budget::{YawError, yaw_error};
pub use controller::{Controller, Map};
pub use error::SteerError;
pub use means::Means;
pub use observation::{Measured, Observation, Wanted};
pub use pilot::Pilot;
pub use policy::{Patience, Policy};
pub use record::{Times, message};
pub use result::{Held, Tally};
pub use steering::{SetPoint, Steering};

/// Observations and set-points a second.
pub const RATE_HZ: f64 = 20.0;

/// Time from one observation to the next, µs of the board's clock: ten of its ticks.
pub const PERIOD_US: u64 = 50_000;

/// Largest error of mean yaw and pitch at which an attitude counts as reached, degrees.
pub const REACHED_DEG: f64 = 1.0;

/// Time at the end of a run whose means are the result, s.
pub const HELD_S: f64 = 30.0;
