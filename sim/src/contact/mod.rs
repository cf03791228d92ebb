//! Contact of rods with each other and with themselves.
//!
//! The implicit contact model (Choi, Tong, Jawed, Joo 2021; Tong et al. 2023) has an energy of the distance D of two edges:
//! with lengths in rod radii r, delta the contact tolerance and K = 15 r/delta, E = [ln(1 + exp(K (2 - D)))/K]^2, quadratic
//! below 2 - delta/r and zero above 2 + delta/r. A rod moves many tolerances in one step, so the solver takes the model's
//! limit, its quadratic branch, with the force as an unknown: 0 <= lambda, gap + lambda/k >= 0, lambda (gap + lambda/k) = 0
//! for every pair of edges ([`complementarity`]). The stiffness k then does not affect the cost.
//!
//! Distances are between centre lines, gaps are distances less two rod radii; both in m, body frame.

pub mod broad_phase;
pub mod bundling;
pub mod complementarity;
pub mod distance;
pub mod friction;
pub mod history;
pub mod pairs;
