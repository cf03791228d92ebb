//! The rigid base on its ball joint and what couples it to the flagella.
//!
//! World: z up. Body frame B at the ball joint P, x_B from motor 2 to motor 1, z_B up along the
//! robot's axis. Shaft frame of motor k: origin at the foot of shaft k, parallel to B but turned by
//! the motor's angle about z_B.

pub mod body;
pub mod clamp;
pub mod closure;
