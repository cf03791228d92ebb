//! All behaviours of the simulator in one program: each program more would be linked with everything again.
//!
//! `cargo test -p sim --test all NAME` runs the tests whose path has NAME in it, such as one file's.

mod bundling;
mod common;
mod contact;
mod effort;
mod elastic;
mod fluid;
mod groups;
mod hard_cases;
mod head;
mod helices;
mod params;
mod peer;
mod phase;
mod published;
mod resistance;
mod return_to_rest;
mod returning_tilt;
mod robot;
mod rod;
mod spin;
mod steady;
mod surroundings;
mod tank;
mod walls;
