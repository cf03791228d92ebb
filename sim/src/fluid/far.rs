//! Flow of regularised point Stokeslets, the Gauss points of far segments.
//!
//! 8 pi mu u(x) = sum over points of (1/R + eps^2/R^3) F + (x - y).F (x - y)/R^3 with
//! R^2 = |x - y|^2 + eps^2 (Cortez 2001). In single precision twice as many pairs fit into a vector register.

use crate::V3;
use serde::{Deserialize, Serialize};

/// Targets are padded to a multiple of this, so that every vector width divides them.
const LANES: usize = 16;

/// Returns the Gauss-Legendre rule of 2, 3 or 4 points on [0, 1]: (point, weight).
pub fn gauss_rule(points: usize) -> &'static [(f64, f64)] {
    const TWO: [(f64, f64); 2] = [(0.211_324_865_405_187_13, 0.5), (0.788_675_134_594_812_9, 0.5)];
    const THREE: [(f64, f64); 3] =
        [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
    const FOUR: [(f64, f64); 4] = [
        (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
        (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
        (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
        (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
    ];
    match points {
        0..=2 => &TWO,
        3 => &THREE,
        _ => &FOUR,
    }
}

/// Precision of the sum over far segments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// 32 bits: good to about 1e-6 of the flow.
    #[default]
    Single,
    /// 64 bits: for results that must not depend on rounding, at twice the cost.
    Double,
}

/// Point forces, coordinates in m and strengths in N.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    points: Vec<[f64; 6]>,
}

impl Sources {
    /// Removes all points.
    pub fn clear(&mut self) {
        self.points.clear();
    }

    /// Adds a point.
    #[inline(always)]
    pub fn push(&mut self, at: V3, force: V3) {
        self.points.push([at.x, at.y, at.z, force.x, force.y, force.z]);
    }

    /// Adds the Gauss points of the edges `edges` of a line with a linear nodal density (N/m).
    pub fn push_edges(&mut self, nodes: &[V3], density: &[V3], edges: std::ops::Range<usize>, rule: &[(f64, f64)]) {
        for e in edges {
            let (x, dx) = (nodes[e], nodes[e + 1] - nodes[e]);
            let (f, df) = (density[e], density[e + 1] - density[e]);
            let length = dx.norm();
            for (point, weight) in rule {
                self.push(x + dx * *point, (f + df * *point) * (weight * length));
            }
        }
    }
}

/// Points where the flow is wanted, and the flow there.
#[derive(Clone, Debug)]
pub struct Targets(Points);

#[derive(Clone, Debug)]
enum Points {
    Single(single::Points),
    Double(double::Points),
}

impl Targets {
    /// Room for `count` points.
    pub fn new(count: usize, precision: Precision) -> Self {
        Self(match precision {
            Precision::Single => Points::Single(single::Points::new(count)),
            Precision::Double => Points::Double(double::Points::new(count)),
        })
    }

    /// Moves the points (m) and clears the flow.
    pub fn set(&mut self, points: &[V3]) {
        match &mut self.0 {
            Points::Single(targets) => targets.set(points),
            Points::Double(targets) => targets.set(points),
        }
    }

    /// Adds the flow of point forces, without the factor 1/(8 pi mu): N/m.
    pub fn add_flow(&mut self, sources: &Sources, epsilon: f64) {
        match &mut self.0 {
            Points::Single(targets) => targets.add_flow(&sources.points, epsilon),
            Points::Double(targets) => targets.add_flow(&sources.points, epsilon),
        }
    }

    /// Returns the flow at a point.
    #[inline(always)]
    pub fn flow(&self, i: usize) -> V3 {
        match &self.0 {
            Points::Single(targets) => targets.flow(i),
            Points::Double(targets) => targets.flow(i),
        }
    }
}

/// The sum in one precision: scalar type, its vectors and their operations.
macro_rules! kernel {
    ($name:ident, $scalar:ident, $view:ident, $view_mut:ident, $lanes:ident, $splat:ident, $sub:ident, $mul:ident, $div:ident, $sqrt:ident, $fma:ident) => {
        mod $name {
            use super::LANES;
            use crate::V3;
            use pulp::{Simd, WithSimd};

            #[derive(Clone, Debug)]
            pub(super) struct Points {
                count: usize,
                at: [Vec<$scalar>; 3],
                flow: [Vec<$scalar>; 3],
                converted: Vec<[$scalar; 6]>,
            }

            impl Points {
                pub(super) fn new(count: usize) -> Self {
                    let padded = count.div_ceil(LANES) * LANES;
                    let zeros = || std::array::from_fn(|_| vec![0.0; padded]);
                    Self { count, at: zeros(), flow: zeros(), converted: Vec::new() }
                }

                pub(super) fn set(&mut self, points: &[V3]) {
                    for (axis, (at, flow)) in self.at.iter_mut().zip(&mut self.flow).enumerate() {
                        for (slot, point) in at.iter_mut().zip(points) {
                            *slot = point[axis] as $scalar;
                        }
                        flow.fill(0.0);
                    }
                }

                pub(super) fn add_flow(&mut self, sources: &[[f64; 6]], epsilon: f64) {
                    self.converted.clear();
                    self.converted.extend(sources.iter().map(|s| s.map(|v| v as $scalar)));
                    pulp::Arch::new().dispatch(Sum { points: self, e2: (epsilon * epsilon) as $scalar });
                }

                #[inline(always)]
                pub(super) fn flow(&self, i: usize) -> V3 {
                    V3::new(self.flow[0][i] as f64, self.flow[1][i] as f64, self.flow[2][i] as f64)
                }
            }

            struct Sum<'a> {
                points: &'a mut Points,
                e2: $scalar,
            }

            impl WithSimd for Sum<'_> {
                type Output = ();

                #[inline(always)]
                fn with_simd<S: Simd>(self, simd: S) {
                    let [x, y, z] = &self.points.at;
                    let (x, y, z) = (S::$view(x).0, S::$view(y).0, S::$view(z).0);
                    let [ux, uy, uz] = &mut self.points.flow;
                    let (ux, uy, uz) = (S::$view_mut(ux).0, S::$view_mut(uy).0, S::$view_mut(uz).0);
                    let (e2, one) = (simd.$splat(self.e2), simd.$splat(1.0));
                    for block in 0..self.points.count.div_ceil(S::$lanes) {
                        let (px, py, pz) = (x[block], y[block], z[block]);
                        let (mut sx, mut sy, mut sz) = (ux[block], uy[block], uz[block]);
                        for source in &self.points.converted {
                            // Spelled out: a closure would be compiled without the vector instructions.
                            let dx = simd.$sub(px, simd.$splat(source[0]));
                            let dy = simd.$sub(py, simd.$splat(source[1]));
                            let dz = simd.$sub(pz, simd.$splat(source[2]));
                            let fx = simd.$splat(source[3]);
                            let fy = simd.$splat(source[4]);
                            let fz = simd.$splat(source[5]);
                            let r2 = simd.$fma(dx, dx, simd.$fma(dy, dy, simd.$fma(dz, dz, e2)));
                            let inverse = simd.$div(one, simd.$sqrt(r2));
                            let cubed = simd.$mul(simd.$mul(inverse, inverse), inverse);
                            let dot = simd.$fma(dx, fx, simd.$fma(dy, fy, simd.$mul(dz, fz)));
                            let along = simd.$mul(dot, cubed);
                            let direct = simd.$fma(e2, cubed, inverse);
                            sx = simd.$fma(direct, fx, simd.$fma(along, dx, sx));
                            sy = simd.$fma(direct, fy, simd.$fma(along, dy, sy));
                            sz = simd.$fma(direct, fz, simd.$fma(along, dz, sz));
                        }
                        ux[block] = sx;
                        uy[block] = sy;
                        uz[block] = sz;
                    }
                }
            }
        }
    };
}

kernel!(
    single,
    f32,
    as_simd_f32s,
    as_mut_simd_f32s,
    F32_LANES,
    splat_f32s,
    sub_f32s,
    mul_f32s,
    div_f32s,
    sqrt_f32s,
    mul_add_e_f32s
);
kernel!(
    double,
    f64,
    as_simd_f64s,
    as_mut_simd_f64s,
    F64_LANES,
    splat_f64s,
    sub_f64s,
    mul_f64s,
    div_f64s,
    sqrt_f64s,
    mul_add_e_f64s
);
