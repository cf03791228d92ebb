//! Corotated coordinates: a frozen inverse serves a rod that has turned and bent since.
//!
//! A vector along the rod is transformed to the shape at which the inverse was built: differences between neighbouring
//! nodes are rotated, edge by edge, from the present material frames to the frames of that shape. The product is
//! transformed back the same way. Without this, an inverse would be good for a fraction of a revolution.

use crate::V3;
use crate::rod::frames::Frames;

/// Transforms nodal vectors `at` from the present frames to those of the inverse, three numbers a node.
#[inline(always)]
pub fn to_reference(built: &[[V3; 3]], today: &Frames, at: impl Fn(usize) -> V3, out: &mut [f32]) {
    let mut put = |i: usize, value: V3| {
        for a in 0..3 {
            out[3 * i + a] = value[a] as f32;
        }
    };
    let mut last = at(1);
    let mut sum = last;
    put(0, at(0));
    put(1, last);
    for (e, [t, d1, d2]) in built.iter().enumerate().skip(1) {
        let next = at(e + 1);
        let step = next - last;
        last = next;
        sum += t * step.dot(&today.tangent.at(e)) + d1 * step.dot(&today.m1.at(e)) + d2 * step.dot(&today.m2.at(e));
        put(e + 1, sum);
    }
}

/// Transforms corrections from the frames of the inverse to the present ones, times `sign`: free nodes are rotated, the
/// other unknowns only converted.
#[inline(always)]
pub fn from_reference(built: &[[V3; 3]], today: &Frames, sign: f64, product: &[f32], out: &mut [f64]) {
    for (slot, value) in out.iter_mut().zip(product) {
        *slot = sign * f64::from(*value);
    }
    let (mut sum, mut last) = (V3::zeros(), V3::zeros());
    for (e, [t, d1, d2]) in built.iter().enumerate().skip(1) {
        let q = 3 * (e - 1);
        let next = V3::new(out[q], out[q + 1], out[q + 2]);
        let step = next - last;
        last = next;
        sum += today.tangent.at(e) * step.dot(t) + today.m1.at(e) * step.dot(d1) + today.m2.at(e) * step.dot(d2);
        for a in 0..3 {
            out[q + a] = sum[a];
        }
    }
}
