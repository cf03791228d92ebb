//! The closures by name.

use crate::failure::Failure;
use sim::body::closure::Closure;

/// Returns the closure of this name.
///
/// # Errors
/// Another name.
pub fn parse(name: &str) -> Result<Closure, Failure> {
    match name {
        "full" => Ok(Closure::Full),
        "lumped" => Ok(Closure::Lumped),
        "paper" => Ok(Closure::Paper),
        _ => Err(Failure::parameter("closure", format!("\"{name}\" is none; give \"full\", \"lumped\" or \"paper\""))),
    }
}
