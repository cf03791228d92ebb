//! All behaviours of the host in one program: each program more would be linked with everything again.
//!
//! `cargo test -p host --test all NAME` runs the tests whose path has NAME in it, such as one file's.

mod aim;
mod calibration;
mod commands;
mod drift;
mod figure;
mod film;
mod format1;
mod hostile_logs;
mod import;
mod pack;
mod plan;
mod plans;
mod preview;
mod program;
mod resistance;
mod simulate;
mod steady;
mod still;
mod sweep;
mod sweep_plan;
mod twin;
