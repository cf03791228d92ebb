//! A trial in memory: read once from its log ([`Data`]), expressed relative to its zero ([`Zeroed`]), and judged
//! by a table of findings ([`Judged`]).
//!
//! The commands `record`, `info`, `compare`, `calibrate`, `report` and `export` take all results of a trial from this
//! module, and never read logs, level attitudes or remove drift in any other way. A trial passes through the same
//! [`Collector`] while it is recorded and when it is read from its log, so both give the same results.

mod angles;
mod back_at_zero;
mod bounds;
mod budget;
mod clock;
mod collect;
mod data;
mod errors;
mod fields;
mod finding;
mod findings;
mod import_rest;
mod imported;
mod judged;
mod over_time;
mod read;
mod repeats;
mod rest;
mod rest_fit;
mod righting;
mod scatter;
mod sensitivity;
mod shapes;
mod tilt_zero;
mod usable;
mod zero;
mod zeroing;

pub use crate::swing::SwingSpeeds;
pub use angles::{Angles, Steady};

pub use budget::{AngleTerm, Budget, CommonTo, Evaluation, TO_COME, Term};
pub use collect::Collector;
pub use data::{Data, Event, LinkSecond, MOTORS, OPERATOR, Records, Times, Want};
pub use fields::{FRAME, Field, TRUTH};
pub use finding::{Finding, FindingKind, LogFinding};
pub use findings::DAMAGED_FRAME;
pub(crate) use findings::labelled;
pub use judged::Judged;
#[cfg(test)]
pub(crate) use over_time::SENSOR_ERRORS;
pub(crate) use over_time::{OverTime, sensor_error};
pub use repeats::{AtSpeeds, mean_of_repeats};
pub(crate) use rest_fit::BLOCK_S;
pub use scatter::{Judgement, Repeat, Repeats, Scatter, scatter_of_repeats};
pub use shapes::{Shape, Shapes};
pub use usable::Unusable;
pub use zero::Zeroed;
