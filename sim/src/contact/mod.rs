//! Contact of rods with each other and with themselves.
//!
//! The definition is the implicit contact model (Choi, Tong, Jawed, Joo 2021; Tong et al. 2023): an
//! energy of the distance of two edges, see [`penalty`]. A rod moves many contact tolerances in one
//! step, so the solver takes the model's limit, its quadratic branch, with the force as an unknown:
//! 0 <= lambda, gap + lambda/k >= 0, lambda (gap + lambda/k) = 0 for every pair of edges
//! ([`complementarity`]). The stiffness k then costs nothing.
//!
//! Distances are between centre lines, gaps are distances less two rod radii; both in m, body frame.

pub mod bundling;
pub mod complementarity;
pub mod distance;
pub mod friction;
pub mod pairs;
pub mod penalty;
