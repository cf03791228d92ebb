//! The methods by name.

use crate::failure::Failure;
use biflag_log::Method;

/// Returns the method of this name.
///
/// # Errors
/// Another name.
pub fn parse(name: &str) -> Result<Method, Failure> {
    match name {
        "trial" => Ok(Method::Trial),
        "steady" => Ok(Method::Steady),
        _ => Err(Failure::parameter("method", format!("\"{name}\" is none; give \"trial\" or \"steady\""))),
    }
}
