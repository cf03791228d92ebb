//! One implicit step of rods, fluid, contact and body together.
//!
//! [`StepControl`] chooses the length of a step and [`Solver`] takes it, from one [`State`](crate::state::State) to the
//! next. A step goes through these parts:
//!
//! | part | what it does |
//! | --- | --- |
//! | [`formula`], `time_step` | the weights of the time formulas, motors and shafts at the end of the step |
//! | `predict` | trial shapes by extrapolation |
//! | `sweep` | flagellum 1, flagellum 2 (`flagellum`), contact (`contact`), base (`body`), again and again |
//! | `converge` | judges each sweep: converged, another one, stalled |
//! | `accept`, `truncation` | the checks that let the step count, its loads, its error, the new state |
//!
//! `preconditioner` has the frozen inverses that correct a flagellum in a sweep, as `panels` or `factors`; `inverses` chooses
//! the shapes they are built at, `corotated` takes them along with the flagellum, `compliance` makes of them the response to
//! contact, and `crate::anderson` accelerates slow iterations. `model` is what never
//! changes about a robot. The flow between the rods and the base's rate are inside the iteration: extrapolating either is
//! unstable at every step.
//!
//! # Where the time goes
//!
//! Shares of the processor's time, closure `full`, AVX-512: robot `published` at (90, 90) rpm without contact, at (90, 60)
//! with light contact and at (-90, -80), where the flagella mesh; robot `physical` at (90, 90).
//!
//! | part | free | light | hard | `physical` |
//! | --- | --- | --- | --- | --- |
//! | residuals, `Flagellum::update_residual` | 29 % | 32 % | 21 % | 31 % |
//! | of these, of the compliance and of the surroundings: flow of points, `Targets::add_flow` | 22 % | 25 % | 16 % | 30 % |
//! | frames and elastic forces, `StepProblem::update_forces` | 8 % | 9 % | 5 % | 9 % |
//! | products with the frozen inverse, `Flagellum::precondition` | 13 % | 11 % | 11 % | 12 % |
//! | compliance to contact forces, `Flagellum::compliance_columns` | 0 % | 4 % | 8 % | 0 % |
//! | search for close edges, `BroadPhase::search` | 10 % | 8 % | 5 % | 7 % |
//! | least gap of every step, `BroadPhase::least_distance` | 10 % | 4 % | 2 % | 5 % |
//! | moving the shapes, `Flagellum::apply` | 3 % | 3 % | 3 % | 2 % |
//! | frozen inverses, `Equations::invert` | 4 % | 3 % | 16 % | 3 % |
//! | flow of the head, `Surroundings::update` | 0 % | 0 % | 0 % | 14 % |
//!
//! Printed, for one column, by
//! `perf record --call-graph dwarf,4096 -F 997 -e cpu-clock target/release/examples/point 90 90 full 120 published` and
//! `perf report --children --no-inline -g none`; the rest is spread over the sweep itself.

mod accept;
mod body;
mod compliance;
mod contact;
mod control;
mod converge;
mod corotated;
mod factors;
mod flagellum;
pub mod formula;
mod inverses;
mod limits;
mod model;
mod panels;
mod preconditioner;
mod predict;
mod problem;
mod report;
mod solver;
mod sweep;
mod time_step;
mod truncation;
mod unknowns;

pub use control::{StepControl, StepError};
pub use inverses::Linearisation;
pub use limits::Limits;
pub use model::Model;
pub use report::{StepFailure, StepReport};
pub use solver::Solver;
pub use time_step::Attempt;
