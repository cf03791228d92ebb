//! Closures and methods by name.

use crate::failure::Failure;
use biflag_log::Method;
use sim::body::closure::Closure;

/// Returns the closure of this name.
///
/// # Errors
/// Another name.
pub fn closure(name: &str) -> Result<Closure, Failure> {
    match name {
        "full" => Ok(Closure::Full),
        "lumped" => Ok(Closure::Lumped),
        "paper" => Ok(Closure::Paper),
        _ => Err(unknown("closure", name, "\"full\", \"lumped\" or \"paper\"")),
    }
}

/// Returns the method of this name.
///
/// # Errors
/// Another name.
pub fn method(name: &str) -> Result<Method, Failure> {
    match name {
        "trial" => Ok(Method::Trial),
        "steady" => Ok(Method::Steady),
        _ => Err(unknown("method", name, "\"trial\" or \"steady\"")),
    }
}

fn unknown(key: &str, name: &str, names: &str) -> Failure {
    Failure::parameter(key, format!("\"{name}\" is none; give {names}"))
}
