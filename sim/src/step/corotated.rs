//! Corotated coordinates: a frozen inverse serves a rod that has turned and bent since.
//!
//! A vector along the rod is transformed to the shape at which the inverse was built: differences between neighbouring
//! nodes are rotated, edge by edge, from the present material frames to the frames of that shape. The product is
//! transformed back the same way. Without this, an inverse would be good for a fraction of a revolution.

use crate::V3;
use crate::lanes::Vectors;
use crate::simd::{Kernel, Simd, dispatch};

/// Material frames along a rod: tangents and both directors of the edges.
pub type Axes<'a> = [&'a Vectors; 3];

/// Transforms nodal vectors `at` from the present frames to those of the inverse, three numbers a node. `steps`: scratch.
#[inline(always)]
pub fn to_reference(built: Axes, today: Axes, at: impl Fn(usize) -> V3, steps: &mut Vectors, out: &mut [f32]) {
    let edges = out.len() / 3 - 1;
    steps.fill(edges, |e| at(e + 1) - at(e));
    dispatch(Rotate { steps, edges, from: today, to: built });
    let mut sum = at(1);
    for (i, slots) in out.chunks_exact_mut(3).enumerate() {
        if i > 1 {
            sum += steps.at(i - 1);
        }
        let value = if i == 0 { at(0) } else { sum };
        (slots[0], slots[1], slots[2]) = (value.x as f32, value.y as f32, value.z as f32);
    }
}

/// Sets the steps of corrections that are in the frames of the inverse, in the present ones.
#[inline(always)]
pub fn steps_from_reference(built: Axes, today: Axes, product: &[f32], edges: usize, steps: &mut Vectors) {
    set_steps(steps, edges, product);
    dispatch(Rotate { steps, edges, from: built, to: today });
}

/// Sets the difference of each edge's ends of vectors at the free nodes, three numbers a node; clamped ones do not move.
#[inline(always)]
pub fn set_steps<T: Copy + Into<f64>>(steps: &mut Vectors, edges: usize, free: &[T]) {
    let at = |e: usize| if e == 0 { V3::zeros() } else { V3::from_fn(|a, _| free[3 * e - 3 + a].into()) };
    steps.fill(edges, |e| at(e) - at(e.saturating_sub(1)));
}

/// Rotates a vector of each edge from its frame among `from` to the one among `to`.
struct Rotate<'a> {
    steps: &'a mut Vectors,
    edges: usize,
    from: Axes<'a>,
    to: Axes<'a>,
}

impl Kernel for Rotate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for e in (0..self.edges).step_by(S::F64_LANES) {
            let step = self.steps.load(simd, e);
            let [t, d1, d2] = [self.from[0].load(simd, e), self.from[1].load(simd, e), self.from[2].load(simd, e)];
            let [to_t, to_d1, to_d2] = [self.to[0].load(simd, e), self.to[1].load(simd, e), self.to[2].load(simd, e)];
            let across = to_d1 * step.dot_unfused(d1);
            self.steps.store(to_t * step.dot_unfused(t) + across + to_d2 * step.dot_unfused(d2), e);
        }
    }
}
