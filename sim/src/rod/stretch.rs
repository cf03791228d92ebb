//! Stretch energy 1/2 EA (|e|/|e0| - 1)^2 |e0| of every edge (Bergou et al. 2010).

use super::{Rod, Stiffness, band::Band, frames::Frames};
use crate::functions::powi;
use crate::lanes::Wide;
use crate::simd::Simd;

/// Returns the energy in J.
pub fn energy(rod: &Rod, frames: &Frames) -> f64 {
    let ea = rod.stiffness.stretch_n;
    (frames.length.iter().zip(&rod.rest_length))
        .map(|(length, rest)| 0.5 * ea * powi(length / rest - 1.0, 2) * rest)
        .sum()
}

/// Returns the tension at neighbouring edges for their `stretch` |e|/|e0|, N.
#[inline(always)]
pub(super) fn tension<S: Simd>(stiffness: &Stiffness, stretch: Wide<S>, one: Wide<S>) -> Wide<S> {
    (stretch - one).scaled(stiffness.stretch_n)
}

/// Adds the Hessian.
pub fn add_hessian(rod: &Rod, frames: &Frames, out: &mut Band) {
    for e in 0..rod.edges() {
        let (t, length, rest) = (frames.tangent.at(e), frames.length[e], rod.rest_length[e]);
        for a in 0..3 {
            for b in 0..3 {
                let identity = if a == b { 1.0 / rest - 1.0 / length } else { 0.0 };
                let value = rod.stiffness.stretch_n * (identity + t[a] * t[b] / length);
                let (row, column) = (4 * e + a, 4 * e + b);
                out.add(row, column, value);
                out.add(row + 4, column + 4, value);
                out.add(row, column + 4, -value);
                out.add(row + 4, column, -value);
            }
        }
    }
}
