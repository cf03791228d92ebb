//! Trials from plan to result: everything that is computed about a trial without a board and without a page.
//!
//! A [`plan`] lists trials. The rig or the [model](run::model) runs them and writes their logs ([`biflag_log`]) into a
//! [`session`] folder. Everything after that reads a log through [`trial`]: the comparison with the model and the fit
//! ([`twin`]), tables ([`export`]). [`sweep`] and [`aim`] only use the model.
//!
//! It is a separate crate because three programs share it: `biflag`, the Python module, and a laboratory's own programs. A
//! program that fits a viscosity should not compile a serial port or a web page. The interface to the crate `rig` is
//! [`run::Recorder`], which accepts a trial's messages from any source; the interface to the crate `page` is [`trial::Data`] with
//! [`trial::Zeroed`], and the comparisons made of them.
//!
//! | module | answers |
//! | --- | --- |
//! | [`plan`], [`preview`] | which trials, of which robot, in which order; how long they take |
//! | [`run`] | what a trial's log begins with; a trial in the model |
//! | [`session`] | which trials of a folder are done |
//! | [`sensor`] | the errors of a sensor, from its data sheet or measured |
//! | [`trial`], [`attitude`] | what a log says: angles from a measured zero, with their uncertainty |
//! | [`twin`] | whether experiment and model agree; which parameters make them agree |
//! | [`sweep`], [`aim`] | steady states over many speeds and robots; speeds for an attitude |
//! | `swing` | the speeds of both motors by the motion of the robot, and whether the stated speeds of a trial agree with it |
//! | [`steer`] | the speeds of the next moment, so that an attitude is reached and held |
//! | [`export`], [`output`] | tables and files for other programs |
//! | [`import`] | trials that other instruments measured |

// Functions whose last bits depend on the machine; tests may call them.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod aim;
pub mod attitude;
pub mod colour;
pub mod draw;
pub mod export;
pub mod import;
pub mod lock;
pub mod output;
pub mod plan;
pub mod preview;
pub mod program;
pub mod progress;
pub mod run;
pub mod secret;
pub mod sensor;
pub mod session;
pub mod statistics;
pub mod steer;
pub mod sweep;
pub mod swing;
pub mod text;
pub mod trial;
pub mod twin;

/// The diagnostic code of wrong use, for which programs exit with code 2 instead of 1. Set it with
/// `#[diagnostic(code(wrong_use))]`, or as `code = WRONG_USE` in [`miette::miette!`].
pub const WRONG_USE: &str = "wrong_use";
