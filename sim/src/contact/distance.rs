//! Distance of two segments, exact in all end cases (Lumelsky 1985).

use crate::V3;

/// Segments whose directions have a squared sine below this are parallel: their common perpendicular is lost to rounding.
const PARALLEL: f64 = 1e-8;

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

/// Returns the closest points of the segments p0-p1 and q0-q1 (m); of parallel segments one of the closest pairs.
pub fn segment_distance(p0: V3, p1: V3, q0: V3, q1: V3) -> Closest {
    let (u, v, w) = (p1 - p0, q1 - q0, p0 - q0);
    let (a, b, c, d, e) = (u.dot(&u), u.dot(&v), v.dot(&v), u.dot(&w), v.dot(&w));
    let determinant = a * c - b * b;
    let at = |s: f64, t: f64| Closest { s, t, separation: w + u * s - v * t };
    let along = |x: f64, square: f64| {
        if square > 0.0 { (x / square).clamp(0.0, 1.0) } else { 0.0 }
    };
    if determinant <= PARALLEL * a * c {
        // The distance is reached at an end of one of them.
        let ends = [at(0.0, along(e, c)), at(1.0, along(b + e, c)), at(along(-d, a), 0.0), at(along(b - d, a), 1.0)];
        let nearer = |x: Closest, y: Closest| {
            if y.separation.norm_squared() < x.separation.norm_squared() { y } else { x }
        };
        return ends.into_iter().fold(ends[0], nearer);
    }
    let s = ((b * e - c * d) / determinant).clamp(0.0, 1.0);
    let wanted = (b * s + e) / c;
    let t = wanted.clamp(0.0, 1.0);
    at(if t == wanted { s } else { along(b * t - d, a) }, t)
}
