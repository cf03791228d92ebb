//! Why turns cannot be used.

use super::{PATIENCE_S, REST_S};
use miette::Diagnostic;
use thiserror::Error;

/// Why the turns cannot be used.
#[derive(Error, Diagnostic, Clone, PartialEq, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum TurnError {
    /// The axis is not vertical.
    #[error("{axis} is not vertical: {up} points up")]
    #[diagnostic(help(
        "stand the sensor so that its {axis} axis points up or down, and start again; if it does, correct accel_axes in the \
         board's settings"
    ))]
    NotVertical { axis: &'static str, up: String },
    /// The sensor turned about another axis.
    #[error("the sensor turned by {other_deg:.0}° about {other}, and by {angle_deg:.0}° about {axis}")]
    #[diagnostic(help(
        "turn it about its {axis} axis, flat on the table; if you did, correct gyro_axes in the board's settings"
    ))]
    WrongAxis { axis: &'static str, angle_deg: f64, other: &'static str, other_deg: f64 },
    /// The sensor turned the same way as before.
    #[error("turn {number} went the wrong way: {angle_deg:.0}° instead of {wanted_deg:.0}°")]
    #[diagnostic(help("turn forwards, then back by the same way, and so on; start again"))]
    WrongWay { number: usize, angle_deg: f64, wanted_deg: f64 },
    /// The sensor stopped half way.
    #[error("turn {number} stopped at {angle_deg:.0}° of {wanted_deg:.0}°")]
    #[diagnostic(help(
        "turn by the whole angle before you let it rest, or name the angle that you turn, such as `biflag sensor turn z 360`"
    ))]
    HalfWay { number: usize, angle_deg: f64, wanted_deg: f64 },
    /// The sensor turned too far.
    #[error("turn {number} went on to {angle_deg:.0}° instead of {wanted_deg:.0}°")]
    #[diagnostic(help("stop at the mark; start again"))]
    TooFar { number: usize, angle_deg: f64, wanted_deg: f64 },
    /// No turn came.
    #[error("the sensor was not turned within {PATIENCE_S:.0} s")]
    #[diagnostic(help("start again, and turn it when the program says so"))]
    NoTurn,
    /// The sensor was never still.
    #[error("the sensor was not still for {REST_S:.0} s within {PATIENCE_S:.0} s")]
    #[diagnostic(help("put it on a table that does not shake, and start again"))]
    NeverStill,
}
