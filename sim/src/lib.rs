//! A robot with two elastic helical flagella in a viscous fluid.
//!
//! A rigid base hangs on a ball joint in glycerin and turns two soft helices with its motors. The model
//! computes its attitude over time: elastic rods ([`rod`]), Stokes flow about them ([`fluid`]), contact
//! between them ([`contact`]), the base ([`body`]), and implicit steps that solve all of it together
//! ([`step`]). Start at [`trial`]: a robot ([`params`]) and a profile of speeds ([`profile`]) give
//! samples ([`sample`]) and a steady state ([`steady`]).
//!
//! SI throughout. World: z up. Body frame B at the ball joint: x_B from motor 2 to motor 1, z_B up along
//! the robot's axis. Positive speed is counter-clockwise seen from above; a right-handed helix then
//! pushes towards its clamp.
//!
//! Not modelled: inertia of fluid and rods (the Reynolds number is about 0.3 at 90 rpm), walls, and the fluid's torque
//! on a rod that spins steadily about its own centre line.
//! The centre line's regularisation makes the fluid see a rod of exp(-1/2) times its length, that is 0.62
//! rod radii with the default.
//!
//! `sim/docs/proof.md` lists how each part is verified, `sim/docs/valleys.md` where the valleys of the published
//! map lie and why, `sim/docs/cost.md` the cost per edge and per case. `sim/lab` has the programs that make their tables.
//!
//! No files, no printing, no threads: trials are independent and may run side by side.
#![forbid(unsafe_code)]
// Formulas run over the same index of several short arrays; iterators would hide which.
#![allow(clippy::needless_range_loop)]

pub mod body;
pub mod contact;
pub mod fluid;
mod lanes;
mod linear;
pub mod params;
pub mod phase;
pub mod profile;
pub mod resistance;
pub mod rod;
pub mod sample;
pub mod state;
pub mod steady;
pub mod step;
pub mod trial;

/// A vector in three dimensions.
pub type V3 = nalgebra::Vector3<f64>;
