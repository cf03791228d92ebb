//! The robot in glycerin.
#![forbid(unsafe_code)]

pub mod fluid;
pub mod rod;

/// A vector in three dimensions.
pub type V3 = nalgebra::Vector3<f64>;
