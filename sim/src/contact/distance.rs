//! Distance of two segments, exact in all end cases (Lumelsky 1985).

use crate::V3;

/// Closest points of two segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// Parameter on the first segment, 0 to 1.
    pub s: f64,
    /// Parameter on the second segment, 0 to 1.
    pub t: f64,
    /// From the point on the second to the point on the first, m.
    pub separation: V3,
}

/// Closest points of p0-p1 and q0-q1. Parallel segments: one of the closest pairs.
pub fn segment_distance(p0: V3, p1: V3, q0: V3, q1: V3) -> Closest {
    let (u, v, w) = (p1 - p0, q1 - q0, p0 - q0);
    let (a, b, c, d, e) = (u.dot(&u), u.dot(&v), v.dot(&v), u.dot(&w), v.dot(&w));
    let determinant = a * c - b * b;
    let along = |x: f64, length2: f64| {
        if length2 > 0.0 {
            (x / length2).clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    let mut s = if determinant > 1e-14 * a * c {
        ((b * e - c * d) / determinant).clamp(0.0, 1.0)
    } else {
        0.5
    };
    let wanted = if c > 0.0 { (b * s + e) / c } else { 0.0 };
    let mut t = wanted.clamp(0.0, 1.0);
    if t != wanted {
        s = along(b * t - d, a);
    } else if determinant <= 1e-14 * a * c {
        // Parallel: the middle of one may face beyond the other's end.
        s = along(b * t - d, a);
        t = along(b * s + e, c);
    }
    Closest {
        s,
        t,
        separation: w + u * s - v * t,
    }
}
