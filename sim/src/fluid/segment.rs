//! The exact flow of one regularised Stokeslet segment with a linear force density.
//!
//! For a segment y0 -> y1 and a point x, with x0 = x - y0, v = y0 - y1, L = |v| and
//! R(a)^2 = |x0 + a v|^2 + eps^2, the flow is 8 pi mu u = L (A1 f0 + A2 f1). A1 and A2 follow from
//! the moments T_{m,-p} = int_0^1 a^m R(a)^-p da (Cortez 2018, section 3).

use crate::V3;
use crate::functions::{ln, powi};
use nalgebra::Matrix3;

/// Eight-point Gauss-Legendre rule on [-1, 1]: positive abscissae and weights.
const GAUSS8: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// Beyond this many segment lengths the closed forms lose digits by cancellation, and quadrature is exact to rounding.
const FAR: f64 = 5.0;

/// Moments of a segment: T_{0,-1}, T_{1,-1} and T_{0,-3} to T_{3,-3}.
#[derive(Clone, Copy, Debug)]
struct Moments {
    inverse: [f64; 2],
    cubed: [f64; 4],
}

impl Moments {
    /// Returns the closed forms. `s0` = x0.v, `l2` = L^2, `r0` = R(0), `r1` = R(1).
    fn closed(s0: f64, l2: f64, r0: f64, r1: f64) -> Self {
        let l = l2.sqrt();
        let s1 = s0 + l2;
        let sum = r0 + r1;
        // One logarithm for the textbook's difference of two: it needs no cases for signs.
        let t01 = ln((sum + l) / (sum - l)) / l;
        let t03 = (s1 / r1 - s0 / r0) / (l2 * r0 * r0 - s0 * s0);
        let t11 = (r1 - r0 - s0 * t01) / l2;
        let t13 = -(1.0 / r1 - 1.0 / r0 + s0 * t03) / l2;
        let t23 = (-1.0 / r1 + t01 - s0 * t13) / l2;
        let t33 = (-1.0 / r1 + 2.0 * t11 - s0 * t23) / l2;
        Self { inverse: [t01, t11], cubed: [t03, t13, t23, t33] }
    }

    fn quadrature(r0_squared: f64, s0: f64, l2: f64) -> Self {
        let mut moments = Self { inverse: [0.0; 2], cubed: [0.0; 4] };
        for (abscissa, weight) in GAUSS8 {
            for a in [0.5 * (1.0 - abscissa), 0.5 * (1.0 + abscissa)] {
                let inverse = 1.0 / (r0_squared + a * (2.0 * s0 + a * l2)).sqrt();
                let (mut w1, mut w3) = (0.5 * weight * inverse, 0.5 * weight * powi(inverse, 3));
                for m in 0..4 {
                    if m < 2 {
                        moments.inverse[m] += w1;
                        w1 *= a;
                    }
                    moments.cubed[m] += w3;
                    w3 *= a;
                }
            }
        }
        moments
    }
}

/// Returns the matrices L A1 and L A2, dimensionless: 8 pi mu u(x) = (L A1) f0 + (L A2) f1.
///
/// `y0`, `y1`: ends of the segment, `epsilon`: regularisation, in m. Accurate to about 1e-12 on, near
/// and far from the segment for `epsilon` above a hundredth of the segment's length.
pub fn segment_flow(x: V3, y0: V3, y1: V3, epsilon: f64) -> [Matrix3<f64>; 2] {
    let (x0, v) = (x - y0, y0 - y1);
    let e2 = epsilon * epsilon;
    let (l2, s0) = (v.norm_squared(), x0.dot(&v));
    let r0_squared = x0.norm_squared() + e2;
    let r1_squared = r0_squared + 2.0 * s0 + l2;
    let moments = if r0_squared.min(r1_squared) > FAR * FAR * l2 {
        Moments::quadrature(r0_squared, s0, l2)
    } else {
        Moments::closed(s0, l2, r0_squared.sqrt(), r1_squared.sqrt())
    };
    let ([t01, t11], [t03, t13, t23, t33]) = (moments.inverse, moments.cubed);
    let (xx, vv) = (x0 * x0.transpose(), v * v.transpose());
    let xv = x0 * v.transpose() + v * x0.transpose();
    let identity = Matrix3::identity();
    let a2 = identity * (t11 + e2 * t13) + xx * t13 + xv * t23 + vv * t33;
    let a1 = identity * (t01 + e2 * t03) + xx * t03 + xv * t13 + vv * t23 - a2;
    let length = l2.sqrt();
    [a1 * length, a2 * length]
}
