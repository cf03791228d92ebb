//! The result of a point with its cost and its origin.

use super::compute::Outcome;
use super::point::Name;
use crate::program;
use serde::{Deserialize, Serialize};

/// The result of a point.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct Record {
    /// Its index in the plan.
    pub index: u64,
    /// Its name.
    pub name: Name,
    /// Its result.
    pub outcome: Outcome,
    /// Its cost.
    pub cost: Cost,
}

/// The cost of a point. It is not part of the result.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub struct Cost {
    /// Processor time, s.
    pub processor_s: f64,
    /// Sweeps of the solver over all starting phases, including unsuccessful searches; 0 for a failed point.
    pub sweeps: u64,
}

/// The computer and the program that computed points.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Hash, Debug, Default)]
pub struct Origin {
    /// Name of the computer.
    pub host: String,
    /// Version and commit of the program.
    pub program: String,
}

impl Origin {
    /// Returns the origin of points computed by this program.
    pub fn here() -> Self {
        Self { host: system::network::name(), program: format!("{} {}", program::VERSION, program::GIT_HASH) }
    }
}
