//! Closures and methods by name.

use crate::failure::Failure;
use biflag_log::Method;
use serde::Serialize;
use sim::body::closure::Closure;
use study::text::word;

/// Returns the closure of this name.
///
/// # Errors
/// Another name.
pub fn closure(name: &str) -> Result<Closure, Failure> {
    one_of("closure", name, &[Closure::Full, Closure::Lumped, Closure::Paper])
}

/// Returns the method of this name.
///
/// # Errors
/// Another name.
pub fn method(name: &str) -> Result<Method, Failure> {
    one_of("method", name, &[Method::Trial, Method::Steady])
}

fn one_of<T: Serialize + Copy>(key: &str, name: &str, all: &[T]) -> Result<T, Failure> {
    let unknown = || format!("{name:?} is none; give one of {}", all.iter().map(word).collect::<Vec<_>>().join(", "));
    all.iter().find(|one| word(*one) == name).copied().ok_or_else(|| Failure::parameter(key, unknown()))
}
