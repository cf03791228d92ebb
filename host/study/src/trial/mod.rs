//! A trial in memory: read from its log once ([`Data`]), then referred to its zero ([`Zeroed`]).
//!
//! The commands `record`, `info`, `compare`, `calibrate`, `report` and `export` take all results of a trial from this
//! module; none of them reads logs, levels attitudes or removes drift in another way. A trial that is being recorded
//! passes through the same [`Collector`] as one that is read from its log, so that both give the same results.

mod angles;
mod axes;
mod back_at_zero;
mod blocks;
mod bounds;
mod budget;
mod causes;
mod clock;
mod collect;
mod data;
mod errors;
mod finding;
mod findings;
mod import_findings;
mod import_rest;
mod imported;
mod judged;
mod read;
mod repeats;
mod rest;
mod rest_fit;
mod righting;
mod scatter;
mod sensitivity;
mod sensor_gap;
mod shapes;
mod tilt_zero;
mod usable;
mod zero;

pub use angles::{Angles, Steady};
pub(crate) use blocks::BLOCK_S;
pub use bounds::Times;
pub use budget::{AngleTerm, Budget, CommonTo, Evaluation, Term};
#[cfg(test)]
pub(crate) use causes::SENSOR_ERRORS;
pub(crate) use causes::sensor_error;
pub(crate) use causes::{Causes, OverTime};
pub use collect::Collector;
pub use data::{Data, Event, FORCES, LinkSecond, MOTORS, Records, Want};
pub use finding::{Finding, FindingKind, LogFinding};
pub use findings::{DAMAGED_FRAME, findings};
pub use repeats::{AtSpeeds, mean_of_repeats};
pub use scatter::{Judgement, Repeat, Repeats, Scatter, scatter_of_repeats};
pub use shapes::{Shape, Shapes};
pub use usable::Unusable;
pub use zero::Zeroed;
