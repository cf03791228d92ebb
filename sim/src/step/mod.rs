//! One implicit step of rods, fluid, contact and body together.
//!
//! ```
//! use sim::body::{closure::Closure, shaft::MotorState};
//! use sim::params::Robot;
//! use sim::step::{Solver, StepControl};
//!
//! let mut solver = Solver::new(&Robot::default(), Closure::Full)?;
//! let (mut state, mut control) = (solver.at_rest(), StepControl::default());
//! // Motor 1 turns at 50 rpm, motor 2 stands.
//! let speed = 50.0 * std::f64::consts::TAU / 60.0;
//! let motors = |time: f64| [MotorState { angle: speed * time, speed }, MotorState { angle: 0.0, speed: 0.0 }];
//! while state.time < 0.2 {
//!     let report = control.advance(&mut solver, &mut state, 0.2, &motors)?;
//!     println!("{:.4} s: {} sweeps, thrust {:.2e} N", state.time, report.sweeps, report.fluid[0].force.z);
//! }
//! // The flagellum turns counter-clockwise, and the base the other way.
//! assert!(state.body.yaw < 0.0 && state.body.rate.z < 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`StepControl`] chooses the length of a step and [`Solver`] takes it, from one [`State`](crate::step::state::State) to the
//! next. A step goes through these parts:
//!
//! | part | what it does |
//! | --- | --- |
//! | [`formula`], `time_step` | the weights of the time formulas, motors and shafts at the end of the step |
//! | `predict` | trial shapes by extrapolation |
//! | `sweep` | flagellum 1, flagellum 2 (`flagellum`), contact (`contact`), base (`body`), again and again |
//! | `converge` | judges each sweep: converged, another one, stalled |
//! | `accept`, `truncation` | the checks of a solved step, its loads, its error, the new state |
//!
//! `preconditioner` has the frozen inverses that correct a flagellum in a sweep, stored as `panels` or `factors`.
//! `inverses` chooses the shapes for them, `rest` shares the inverses at rest, `corotated` adapts them to a flagellum
//! that has moved, and `compliance` derives the response to contact from them. `crate::anderson` accelerates slow
//! iterations. `model` has the constant data of a robot. The flow between the rods and the base's rate are inside the
//! iteration: extrapolating either is unstable at every step.
//!
//! # Where the time goes
//!
//! Shares of the processor's time, closure `full`, AVX-512: robot `published` at (90, 90) rpm without contact, at (90, 60)
//! with light contact and at (-90, -80), where the flagella mesh; robot `physical` at (90, 90). Trials of 1200 s, and of 120 s
//! at (-90, -80), of an earlier build.
//!
//! | part | free | light | hard | `physical` |
//! | --- | --- | --- | --- | --- |
//! | residuals, with the flow of the rods, `Flagellum::update_residual` | 30 % | 31 % | 25 % | 25 % |
//! | frames and elastic forces, `StepProblem::update_forces` | 10 % | 9 % | 7 % | 10 % |
//! | products with the frozen inverse, `Flagellum::correct` | 13 % | 13 % | 12 % | 12 % |
//! | compliance to contact forces, `Flagellum::compliance_columns` | 0 % | 3 % | 8 % | 0 % |
//! | search for close edges, `BroadPhase::search` | 8 % | 8 % | 8 % | 7 % |
//! | least gap of every step, `BroadPhase::least_distance` | 8 % | 2 % | 2 % | 5 % |
//! | moving the shapes, `Flagellum::apply` | 3 % | 5 % | 5 % | 3 % |
//! | frozen inverses, `Equations::invert` | 1 % | 0 % | 1 % | 1 % |
//! | flow of the head, `Surroundings::update` | 0 % | 0 % | 0 % | 13 % |
//!
//! Printed, for one column, by
//! `perf record --call-graph dwarf,4096 -F 997 -e cpu-clock target/release/biflag simulate --speeds 90,90 --duration 1200 --robot
//! published` and `perf report --children --no-inline -g none`; the rest is spread over the sweep itself.

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
mod key;
mod limits;
mod model;
mod panels;
mod preconditioner;
mod predict;
mod problem;
mod report;
mod rest;
mod solver;
pub mod state;
pub mod surroundings;
mod sweep;
mod time_step;
mod truncation;
mod unknowns;

pub use control::{StepControl, StepError};
pub use inverses::Linearisation;
pub use limits::Limits;
pub use model::Model;
pub use report::{StepFailure, StepReport};
pub use rest::InversesAtRest;
pub use solver::Solver;
pub use time_step::Attempt;
