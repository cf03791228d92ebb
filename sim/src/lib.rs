//! The robot in glycerin.
#![forbid(unsafe_code)]
// Formulas run over the same index of several short arrays; iterators would hide which.
#![allow(clippy::needless_range_loop)]

pub mod contact;
pub mod fluid;
mod lanes;
pub mod params;
pub mod profile;
pub mod robot;
pub mod rod;
pub mod sample;
pub mod state;
pub mod steady;
pub mod step;
pub mod trial;

/// A vector in three dimensions.
pub type V3 = nalgebra::Vector3<f64>;
