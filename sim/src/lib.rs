//! A robot with two elastic helical flagella in a viscous fluid.
//!
//! A rigid base hangs on a ball joint in glycerin and turns two soft helices with its motors. The model
//! computes its attitude over time: elastic rods ([`rod`]), Stokes flow about them ([`fluid`]), contact
//! between them ([`contact`]), the base ([`body`]), and implicit steps that solve all of it together
//! ([`step`]). Start at [`trial`]: a robot ([`params`]) and a profile of speeds ([`trial::profile`]) give
//! samples ([`trial::sample`]) and the means at their end ([`trial::means`]); [`steady`] finds these means sooner.
//!
//! SI throughout. World: z up. Body frame B at the ball joint: x_B from motor 2 to motor 1, z_B up along
//! the robot's axis. Positive speed is counter-clockwise seen from above; a right-handed helix then
//! pushes towards its clamp.
//!
//! Not modelled: the inertia of fluid and rods (the Reynolds number is about 0.3 at 90 rpm), and the flow that a rod's
//! spin causes. A line of regularised Stokeslets has the drag of a round rod whose radius is exp(-1/2) times the
//! regularisation. For the robot `physical` this is the rod's radius; for `published` it is 0.62 times the rod's
//! radius, and the rods also spin without drag. Against the resolved surface of a rigid published flagellum the torque
//! is 4 % low with `physical`, 35 % with `published` (`published_helix_with_its_surface_resolved` in
//! `sim/tests/helices.rs`). `sim/docs/accuracy.md` lists the sources of error and their sizes.
//!
//! `sim/docs/proof.md` lists the verification of each part, `sim/docs/cost.md` the cost per edge and per case.
//! `sim/docs/valleys.md` explains the valleys of the published map and the effect of the starting phase
//! ([`steady::phase`]), `sim/docs/steady.md` the solution for steady states ([`steady`]). `sim/lab` has the programs
//! that make their tables.
//!
//! No files, no printing, no threads, nothing global: trials are independent and may run side by side. Trials of one
//! robot are faster if they share [`step::InversesAtRest`].
#![forbid(unsafe_code)]
// Functions whose last bits depend on the machine; tests may call them.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
// Formulas use one index into several short arrays; iterators would hide it.
#![allow(clippy::needless_range_loop)]

pub mod accuracy;
mod anderson;
pub mod body;
mod cholesky;
pub mod contact;
pub mod fluid;
pub mod functions;
pub mod groups;
mod lanes;
mod linear;
pub mod params;
pub mod resistance;
pub mod return_to_rest;
pub mod rod;
mod simd;
pub mod split_mix;
pub mod steady;
pub mod step;
#[cfg(test)]
mod tests {
    mod same_bits;
}
pub mod trial;

/// A vector in three dimensions.
pub type V3 = nalgebra::Vector3<f64>;
