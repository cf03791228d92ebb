//! The gradient of all elastic energies, many nodes at a time.
//!
//! Bending and twist give derivatives with respect to the two edges and the two angles at a node. They are summed with
//! the tension edge by edge; the gradient at a node is the difference of its two edges.

use super::{Rod, bend, frames::Frames, stencil::ByNode, stretch, twist};
use crate::lanes::{Wide, Wide3, padded};
use crate::simd::{Kernel, Simd, dispatch};

/// Numbers of a rod at rest that the gradient uses, padded.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AtRest {
    inverse_length: Vec<f64>,
    inverse_voronoi_length: Vec<f64>,
    curvature: [Vec<f64>; 2],
    twist: Vec<f64>,
}

impl AtRest {
    pub(super) fn new(length: &[f64], voronoi_length: &[f64], curvature: &[[f64; 2]], twist: &[f64]) -> Self {
        let copied = |values: &mut dyn Iterator<Item = f64>| {
            let mut out = vec![1.0; padded(voronoi_length.len())];
            out.iter_mut().zip(values).for_each(|(slot, value)| *slot = value);
            out
        };
        Self {
            inverse_length: copied(&mut length.iter().map(|l| 1.0 / l)),
            inverse_voronoi_length: copied(&mut voronoi_length.iter().map(|l| 1.0 / l)),
            curvature: [0, 1].map(|k| copied(&mut curvature.iter().map(|c| c[k]))),
            twist: copied(&mut twist.iter().copied()),
        }
    }
}

/// Rows of the scratch: the angles, and the derivatives with respect to two edges.
const ROWS: usize = 9;

/// Writes the gradient to `out`, four slots a node.
pub(super) fn gradient(rod: &Rod, frames: &mut Frames, angles: &[f64], out: &mut [f64]) {
    let mut scratch = std::mem::take(&mut frames.gradients);
    scratch.resize(ROWS * padded(rod.nodes()), 0.0);
    dispatch(Gradient { rod, frames, angles, scratch: &mut scratch, out });
    frames.gradients = scratch;
}

/// Compiles the gradient for the machine's vector instructions.
struct Gradient<'a> {
    rod: &'a Rod,
    frames: &'a Frames,
    angles: &'a [f64],
    scratch: &'a mut [f64],
    out: &'a mut [f64],
}

impl Kernel for Gradient<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Gradient { rod, frames, angles, scratch, out } = self;
        let (n, at_rest, stiffness) = (rod.nodes(), &rod.at_rest, &rod.stiffness);
        let length = padded(n);
        let (given, by_node) = scratch.split_at_mut(length);
        given[..n - 1].copy_from_slice(angles);
        // Derivatives with respect to the edge before each node, and to the edge after it: x, y, z, angle.
        let (before, after) = by_node.split_at_mut(4 * length);
        for i in (1..n - 1).step_by(S::F64_LANES) {
            let zero = Wide::all(simd, 0.0);
            let mut sum = ByNode { edges: [Wide3([zero; 3]); 2], angles: [zero; 2] };
            let per_length = Wide::load(simd, &at_rest.inverse_voronoi_length, i);
            let natural = [0, 1].map(|k| Wide::load(simd, &at_rest.curvature[k], i));
            bend::add_gradient(simd, frames, i, natural, per_length.scaled(stiffness.bend_nm2), &mut sum);
            let turned = Wide::load(simd, given, i) - Wide::load(simd, given, i - 1);
            let twist = turned + Wide::load(simd, &frames.reference_twist, i);
            let twists = [twist, Wide::load(simd, &at_rest.twist, i)];
            twist::add_gradient(simd, frames, i, twists, per_length.scaled(stiffness.twist_nm2), &mut sum);
            for (side, rows) in [&mut *before, &mut *after].into_iter().enumerate() {
                for axis in 0..3 {
                    sum.edges[side].0[axis].store(rows, axis * length + i);
                }
                sum.angles[side].store(rows, 3 * length + i);
            }
        }
        // Ends have no derivatives, and beyond the last inner node the registers left meaningless numbers.
        for rows in [&mut *before, &mut *after] {
            for row in rows.chunks_exact_mut(length) {
                row[0] = 0.0;
                row[n - 1..].fill(0.0);
            }
        }
        for e in (0..n - 1).step_by(S::F64_LANES) {
            let inverse = Wide::load(simd, &frames.length, e).inverse();
            let stretch = Wide::load(simd, &frames.length, e) * Wide::load(simd, &at_rest.inverse_length, e);
            let tension = stretch::tension(stiffness, stretch, Wide::all(simd, 1.0));
            let tangent = frames.tangent.load(simd, e);
            for axis in 0..3 {
                let at = axis * length + e;
                let sum = Wide::load(simd, before, at + 1) + Wide::load(simd, after, at);
                sum.times_plus(inverse, tangent.0[axis] * tension).store(after, at);
            }
            let at = 3 * length + e;
            (Wide::load(simd, before, at + 1) + Wide::load(simd, after, at)).store(after, at);
        }
        for row in after.chunks_exact_mut(length) {
            row[n - 1] = 0.0;
        }
        let mut last = [0.0; 3];
        for (i, slots) in out.chunks_exact_mut(4).enumerate() {
            for axis in 0..3 {
                let next = after[axis * length + i];
                slots[axis] = last[axis] - next;
                last[axis] = next;
            }
            slots[3] = after[3 * length + i];
        }
    }
}
