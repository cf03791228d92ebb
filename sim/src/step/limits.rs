//! Lengths and forces for solving and judging contact.

use crate::functions::powi;
use crate::params::Robot;
use crate::rod::Rod;

/// Pairs of edges closer than this gap, in rod radii, are pairs of the step.
const WATCHED_RADII: f64 = 0.5;
/// Pairs with a gap below a rod radius over this are solved for, the others only watched.
const ACTIVE_FRACTION: f64 = 30.0;
/// Largest plausible force of a pair, in units of EI/length^2, the scale of a flagellum's buckling load. Above it the
/// iteration has diverged.
const LARGEST_LOADS: f64 = 2500.0;
/// Force for which the contact stiffness is designed, N: somewhat above the published robot's largest, 0.4 N.
const DESIGN_FORCE: f64 = 0.5;
/// For robots with weak flagella, the design force is this share of the largest force instead.
const DESIGN_SHARE: f64 = 0.25;
/// Share of the tolerance for the law's own overlap, force over stiffness; the rest is for the iteration's errors.
const LAW_SHARE: f64 = 0.5;
/// Factor by which the stiffness grows when a force needs more.
const STIFFER: f64 = 4.0;
/// Share of the tolerance that the error of the gap law may have.
const GAP_SHARE: f64 = 0.25;
/// Share of the tolerance that pairs coming close within a step may overlap before they are solved for.
const OVERLAP_SHARE: f64 = 0.3;
/// Share of the tolerance by which the held closest points may be wrong.
const HELD_SHARE: f64 = 0.5;

/// Limits of contact, SI.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Whether rods touch at all.
    pub enabled: bool,
    /// Distance of centre lines at which rods touch: two radii.
    pub distance: f64,
    /// Distance of centre lines below which edges are pairs of the step.
    pub watched: f64,
    /// Gap below which pairs are solved for.
    pub active_gap: f64,
    /// Largest error of the gap law in a converged step.
    pub gap_error: f64,
    /// Overlap from which a pair found late must be solved for.
    pub overlap: f64,
    /// Largest error of the held closest points in a converged step.
    pub held_error: f64,
    /// A pair's force at or above this means that the iteration has diverged.
    pub largest_force: f64,
    /// Largest overlap by the law itself.
    law_overlap: f64,
    /// Coefficient of friction.
    pub friction: f64,
    /// Sliding speed below which contacts stick.
    pub slip: f64,
}

impl Limits {
    /// Returns the limits of a robot. `rod`: either of its rods.
    pub fn new(robot: &Robot, rod: &Rod) -> Self {
        let (radius, tolerance) = (robot.flagellum.rod_radius_m, robot.contact.tolerance_m);
        let buckling = rod.stiffness.bend_nm2 / powi(robot.flagellum.axial_length_m, 2);
        let distance = 2.0 * radius;
        Self {
            enabled: robot.contact.enabled,
            distance,
            watched: distance + WATCHED_RADII * radius,
            active_gap: radius / ACTIVE_FRACTION,
            gap_error: GAP_SHARE * tolerance,
            overlap: OVERLAP_SHARE * tolerance,
            held_error: HELD_SHARE * tolerance,
            largest_force: LARGEST_LOADS * buckling,
            law_overlap: LAW_SHARE * tolerance,
            friction: robot.contact.friction,
            slip: robot.contact.slip_speed_m_s,
        }
    }

    /// Returns the contact stiffness that a trial starts with, N/m.
    pub fn stiffness(&self) -> f64 {
        DESIGN_FORCE.min(DESIGN_SHARE * self.largest_force) / self.law_overlap
    }

    /// Returns the stiffness (N/m) for the steps after one with this stiffness and largest force (N).
    pub fn stiffness_after(&self, stiffness: f64, force: f64) -> f64 {
        if force > self.law_overlap * stiffness { STIFFER * stiffness } else { stiffness }
    }
}
