//! Elementary functions with the same bits on every machine.
//!
//! The standard library's functions call the system's, whose last bits depend on its version and on the processor. Clippy
//! forbids them in code that computes results (`clippy.toml`). Roots, magnitudes and roundings are exact everywhere.

pub use libm::{
    acos, asin, asinh, atan, atan2, cos, cosh, exp, hypot, log10, pow, sin, sincos as sin_cos, sinh, tan, tanh,
};
pub use libm::{expm1 as exp_m1, log as ln, log1p as ln_1p, log2};

/// Returns a whole power, by repeated squaring.
#[inline(always)]
pub fn powi(mut base: f64, exponent: i32) -> f64 {
    let mut left = exponent.unsigned_abs();
    let mut power = 1.0;
    while left > 0 {
        if left % 2 == 1 {
            power *= base;
        }
        left /= 2;
        if left > 0 {
            base *= base;
        }
    }
    if exponent < 0 { 1.0 / power } else { power }
}

/// Returns a number, or zero in place of a negative one or a NaN. Instructions for maxima differ in the sign of zero.
#[inline(always)]
pub fn positive_part(x: f64) -> f64 {
    if x > 0.0 { x } else { 0.0 }
}
