//! Coarse points that represent many fine points in a smooth flow: forces are gathered to them, velocities interpolated
//! from them.
//!
//! A fine point takes its velocity from the coarse points near it by polynomial interpolation, and a force goes to the
//! coarse points with the weights of its position. This preserves total forces, and moments as far as the interpolation
//! is exact.

use super::far::gauss_rule;
use crate::V3;

/// Fine point, coarse point, weight.
type Term = (usize, usize, f64);

/// Weights between fine and coarse points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Coarse {
    /// Number of coarse points.
    pub count: usize,
    gather: Vec<Term>,
    spread: Vec<Term>,
}

/// Cubic Lagrange polynomials between coarse points at whole numbers.
struct Cubic<'a>(&'a [usize]);

impl Cubic<'_> {
    /// Returns the weights of the four coarse points about `at`.
    fn weights(&self, at: f64) -> impl Iterator<Item = (usize, f64)> {
        let order = self.0.len().min(4);
        let after = self.0.partition_point(|pick| (*pick as f64) < at);
        let first = after.saturating_sub(order / 2).min(self.0.len() - order);
        (first..first + order).map(move |c| {
            let others = (first..first + order).filter(|other| *other != c).map(|other| self.0[other] as f64);
            (c, others.map(|other| (at - other) / (self.0[c] as f64 - other)).product())
        })
    }
}

impl Coarse {
    /// Returns the weights between the nodes of a line and coarse points, and the nodes that are coarse points: about
    /// every `stride`-th node, at least four, or all. Nodes must be about equally far apart.
    ///
    /// Velocities are given at the nodes; forces are linear densities, integrated over the adjacent edges.
    pub fn line(nodes: usize, stride: usize) -> (Self, Vec<usize>) {
        let last = nodes - 1;
        let intervals = last.div_ceil(stride.max(1)).max(3).min(last);
        let picks: Vec<usize> = (0..=intervals).map(|k| (k * last + intervals / 2) / intervals).collect();
        let cubic = Cubic(&picks);
        let (mut gather, mut spread) = (Vec::new(), Vec::new());
        for i in 0..nodes {
            spread.extend(cubic.weights(i as f64).filter(|(_, w)| *w != 0.0).map(|(c, w)| (i, c, w)));
            let mut hat = vec![0.0; picks.len()];
            for (edge, exists) in [(i.wrapping_sub(1), i > 0), (i, i < last)] {
                for (point, weight) in gauss_rule(3).iter().filter(|_| exists) {
                    let height = if edge == i { 1.0 - point } else { *point };
                    for (c, w) in cubic.weights(edge as f64 + point) {
                        hat[c] += weight * height * w;
                    }
                }
            }
            let area: f64 = hat.iter().sum();
            gather.extend(hat.iter().enumerate().filter(|(_, w)| **w != 0.0).map(|(c, w)| (i, c, w / area)));
        }
        (Self { count: picks.len(), gather, spread }, picks)
    }

    /// Returns the weights of trilinear interpolation from eight points, and these points, m. They lie at 1/sqrt(3) of
    /// the half widths of the box about a body's surface: uniform and linear flows are exact, and second moments nearly
    /// so.
    pub fn body(surface: &[V3]) -> (Self, Vec<V3>) {
        let low = surface.iter().fold(V3::repeat(f64::INFINITY), |a, x| a.inf(x));
        let high = surface.iter().fold(V3::repeat(f64::NEG_INFINITY), |a, x| a.sup(x));
        let (centre, half) = ((low + high) * 0.5, (high - low) * (0.5 / 3f64.sqrt()));
        let side = |corner: usize, axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
        let weight = |x: &V3, c: usize| -> f64 {
            (0..3).map(|axis| 0.5 * (1.0 + side(c, axis) * (x[axis] - centre[axis]) / half[axis])).product()
        };
        let terms: Vec<Term> =
            surface.iter().enumerate().flat_map(|(i, x)| (0..8).map(move |c| (i, c, weight(x, c)))).collect();
        let corner = |c: usize| centre + V3::from_fn(|axis, _| side(c, axis) * half[axis]);
        (Self { count: 8, gather: terms.clone(), spread: terms }, (0..8).map(corner).collect())
    }

    /// Returns weights that make each point of a body its own coarse point.
    pub fn identity(count: usize) -> Self {
        let terms: Vec<Term> = (0..count).map(|i| (i, i, 1.0)).collect();
        Self { count, gather: terms.clone(), spread: terms }
    }

    /// Adds the forces of the fine points to those of the coarse ones.
    pub fn gather(&self, fine: impl Fn(usize) -> V3, coarse: &mut [V3]) {
        for (i, c, weight) in &self.gather {
            coarse[*c] += fine(*i) * *weight;
        }
    }

    /// Adds the velocities of the coarse points to those of the fine ones.
    pub fn spread(&self, coarse: impl Fn(usize) -> V3, fine: &mut [V3]) {
        for (i, c, weight) in &self.spread {
            fine[*i] += coarse(*c) * *weight;
        }
    }
}
