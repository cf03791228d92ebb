//! Stretch energy 1/2 EA (|e|/|e0| - 1)^2 |e0| of every edge (Bergou et al. 2010).

use super::{Rod, add_at, band::Band, frames::Frames};

/// Energy in J.
pub fn energy(rod: &Rod, frames: &Frames) -> f64 {
    let ea = rod.stiffness.stretch_n;
    (frames.length.iter().zip(&rod.rest_length))
        .map(|(length, rest)| 0.5 * ea * (length / rest - 1.0).powi(2) * rest)
        .sum()
}

/// Adds the gradient.
pub fn add_gradient(rod: &Rod, frames: &Frames, out: &mut [f64]) {
    for e in 0..rod.edges() {
        let tension = rod.stiffness.stretch_n * (frames.length[e] / rod.rest_length[e] - 1.0);
        let pull = frames.tangent[e] * tension;
        add_at(out, e, -pull);
        add_at(out, e + 1, pull);
    }
}

/// Adds the Hessian.
pub fn add_hessian(rod: &Rod, frames: &Frames, out: &mut Band) {
    for e in 0..rod.edges() {
        let (t, length, rest) = (frames.tangent[e], frames.length[e], rod.rest_length[e]);
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
