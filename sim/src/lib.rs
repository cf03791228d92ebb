//! The robot in glycerin.
#![forbid(unsafe_code)]

pub mod contact;
pub mod fluid;
pub mod params;
pub mod robot;
pub mod rod;
pub mod state;
pub mod step;

/// A vector in three dimensions.
pub type V3 = nalgebra::Vector3<f64>;
