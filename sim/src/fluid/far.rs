//! Flow of regularised point Stokeslets, the Gauss points of far segments.
//!
//! 8 pi mu u(x) = sum over points of (1/R + eps^2/R^3) F + (x - y).F (x - y)/R^3 with
//! R^2 = |x - y|^2 + eps^2 (Cortez 2001). Single precision: the sum is then good to about 1e-6 of
//! the flow, and twice as many pairs fit into a vector register.

use crate::V3;
use pulp::{Simd, WithSimd};

/// Targets are padded to a multiple of this, so that every vector width divides them.
const LANES: usize = 16;

/// Gauss-Legendre points on [0, 1] with weights: (point, weight).
pub fn gauss_rule(points: usize) -> &'static [(f64, f64)] {
    const TWO: [(f64, f64); 2] = [
        (0.211_324_865_405_187_13, 0.5),
        (0.788_675_134_594_812_9, 0.5),
    ];
    const THREE: [(f64, f64); 3] = [
        (0.112_701_665_379_258_3, 5.0 / 18.0),
        (0.5, 8.0 / 18.0),
        (0.887_298_334_620_741_7, 5.0 / 18.0),
    ];
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

/// Point forces, coordinates in m and strengths in N.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    points: Vec<[f32; 6]>,
}

impl Sources {
    /// Forgets all points.
    pub fn clear(&mut self) {
        self.points.clear();
    }

    /// Adds a point.
    #[inline(always)]
    pub fn push(&mut self, at: V3, force: V3) {
        self.points.push([
            at.x as f32,
            at.y as f32,
            at.z as f32,
            force.x as f32,
            force.y as f32,
            force.z as f32,
        ]);
    }

    /// Adds the Gauss points of the edges `edges` of a line with a linear nodal density (N/m).
    pub fn push_edges(
        &mut self,
        nodes: &[V3],
        density: &[V3],
        edges: std::ops::Range<usize>,
        rule: &[(f64, f64)],
    ) {
        for e in edges {
            let (x, dx) = (nodes[e], nodes[e + 1] - nodes[e]);
            let (f, df) = (density[e], density[e + 1] - density[e]);
            let length = dx.norm();
            for (point, weight) in rule {
                self.push(x + dx * *point, (f + df * *point) * (weight * length));
            }
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// Points where the flow is wanted, and the flow there.
#[derive(Clone, Debug)]
pub struct Targets {
    count: usize,
    at: [Vec<f32>; 3],
    flow: [Vec<f32>; 3],
}

impl Targets {
    /// Room for `count` points.
    pub fn new(count: usize) -> Self {
        let padded = count.div_ceil(LANES) * LANES;
        let zeros = || std::array::from_fn(|_| vec![0.0; padded]);
        Self {
            count,
            at: zeros(),
            flow: zeros(),
        }
    }

    /// Moves the points and clears the flow.
    pub fn set(&mut self, points: &[V3]) {
        for (axis, (at, flow)) in self.at.iter_mut().zip(&mut self.flow).enumerate() {
            for (slot, point) in at.iter_mut().zip(points) {
                *slot = point[axis] as f32;
            }
            flow.fill(0.0);
        }
    }

    /// Adds the flow of point forces, without the factor 1/(8 pi mu).
    pub fn add_flow(&mut self, sources: &Sources, epsilon: f64) {
        pulp::Arch::new().dispatch(Kernel {
            targets: self,
            sources,
            e2: (epsilon * epsilon) as f32,
        });
    }

    /// Flow at a point.
    #[inline(always)]
    pub fn flow(&self, i: usize) -> V3 {
        debug_assert!(i < self.count);
        V3::new(
            self.flow[0][i] as f64,
            self.flow[1][i] as f64,
            self.flow[2][i] as f64,
        )
    }
}

struct Kernel<'a> {
    targets: &'a mut Targets,
    sources: &'a Sources,
    e2: f32,
}

impl WithSimd for Kernel<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let [x, y, z] = &self.targets.at;
        let (x, y, z) = (
            S::as_simd_f32s(x).0,
            S::as_simd_f32s(y).0,
            S::as_simd_f32s(z).0,
        );
        let [ux, uy, uz] = &mut self.targets.flow;
        let (ux, uy, uz) = (
            S::as_mut_simd_f32s(ux).0,
            S::as_mut_simd_f32s(uy).0,
            S::as_mut_simd_f32s(uz).0,
        );
        let (e2, one) = (simd.splat_f32s(self.e2), simd.splat_f32s(1.0));
        for block in 0..x.len() {
            let (px, py, pz) = (x[block], y[block], z[block]);
            let (mut sx, mut sy, mut sz) = (ux[block], uy[block], uz[block]);
            for source in &self.sources.points {
                // Spelled out: a closure would be compiled without the vector instructions.
                let (yx, yy, yz) = (
                    simd.splat_f32s(source[0]),
                    simd.splat_f32s(source[1]),
                    simd.splat_f32s(source[2]),
                );
                let (fx, fy, fz) = (
                    simd.splat_f32s(source[3]),
                    simd.splat_f32s(source[4]),
                    simd.splat_f32s(source[5]),
                );
                let (dx, dy, dz) = (
                    simd.sub_f32s(px, yx),
                    simd.sub_f32s(py, yy),
                    simd.sub_f32s(pz, yz),
                );
                let r2 = simd.mul_add_e_f32s(
                    dx,
                    dx,
                    simd.mul_add_e_f32s(dy, dy, simd.mul_add_e_f32s(dz, dz, e2)),
                );
                let inverse = simd.div_f32s(one, simd.sqrt_f32s(r2));
                let cubed = simd.mul_f32s(simd.mul_f32s(inverse, inverse), inverse);
                let along = simd.mul_f32s(
                    simd.mul_add_e_f32s(dx, fx, simd.mul_add_e_f32s(dy, fy, simd.mul_f32s(dz, fz))),
                    cubed,
                );
                let direct = simd.mul_add_e_f32s(e2, cubed, inverse);
                sx = simd.mul_add_e_f32s(direct, fx, simd.mul_add_e_f32s(along, dx, sx));
                sy = simd.mul_add_e_f32s(direct, fy, simd.mul_add_e_f32s(along, dy, sy));
                sz = simd.mul_add_e_f32s(direct, fz, simd.mul_add_e_f32s(along, dz, sz));
            }
            ux[block] = sx;
            uy[block] = sy;
            uz[block] = sz;
        }
    }
}
