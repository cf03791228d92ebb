//! The twin: an experiment held against the model.

mod compare;

pub use compare::{Comparison, Finding, Point, SessionComparison, Skipped};
