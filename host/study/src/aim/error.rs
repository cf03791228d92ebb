//! Why there is no answer.

use super::quantity::Quantity;
use crate::text::word;
use miette::Diagnostic;
use sim::steady::SolveError;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use thiserror::Error;

/// Why there is no answer.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum AimError {
    /// Fewer than two quantities are asked for.
    #[error("two speeds give two quantities, and {} is named", if *named == 0 { "none" } else { "one" })]
    #[diagnostic(
        code(wrong_use),
        help("give two of --yaw, --pitch, --roll, --tilt and --thrust, such as --yaw=-67 --pitch=-4")
    )]
    TooFew { named: usize },
    /// A quantity cannot have this value.
    #[error("{} cannot be {value}", word(quantity))]
    #[diagnostic(code(wrong_use), help("give {} to {}", range.start(), range.end()))]
    OutOfRange { quantity: Quantity, value: f64, range: RangeInclusive<f64> },
    /// The table cannot be read.
    #[error("{}: the table cannot be read: {reason}", path.display())]
    #[diagnostic(
        code(wrong_use),
        help(
            "give the table of `biflag sweep`: CSV or Parquet with the columns w1_rpm, w2_rpm, yaw_deg, pitch_deg, roll_deg"
        )
    )]
    Table { path: PathBuf, reason: String },
    /// The table has too few speeds.
    #[error("the table has {rows} steady states of one robot, mirror images included")]
    #[diagnostic(code(wrong_use), help("give a table with at least ten steady states that differ in both speeds"))]
    TooSmall { rows: usize },
    /// The model of the robot fails at all speeds tried.
    #[error("the model of this robot has no steady state at {} and {} rpm", rpm[0], rpm[1])]
    Model { rpm: [f64; 2], source: SolveError },
    /// The robot turns over at these speeds (rpm), so it has no attitude there.
    #[error("the robot overturns at {} and {} rpm", .0[0], .0[1])]
    #[diagnostic(help("give it the mass that hangs upright"))]
    Overturned([f64; 2]),
    /// The user has interrupted the search.
    #[error("interrupted")]
    Interrupted,
    /// The model has not answered in time. [`aim`](super::aim()) reports its best result so far instead.
    #[error("the time was over")]
    TimeOver,
}
