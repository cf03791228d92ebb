//! Flow of regularised point Stokeslets, the Gauss points of far segments.
//!
//! 8 pi mu u(x) = sum over points of (1/R + eps^2/R^3) F + (x - y).F (x - y)/R^3 with
//! R^2 = |x - y|^2 + eps^2 (Cortez 2001). In single precision twice as many pairs fit into a vector register.

use crate::V3;
use crate::lanes::{PADDING, Vectors, Wide};
use crate::params::Precision;
use crate::simd::{Kernel, Simd, dispatch};
use std::ops::Range;

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

/// Point forces, coordinates in m and strengths in N.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    count: usize,
    /// x, y and z of the points, then of their forces; entries after the points are scratch.
    columns: [Vec<f64>; 6],
    /// Nodes and densities of the line being added.
    line: [Vectors; 2],
}

impl Sources {
    /// Removes all points.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds a point.
    #[inline(always)]
    pub fn push(&mut self, at: V3, force: V3) {
        self.make_room(1);
        for axis in 0..3 {
            self.columns[axis][self.count] = at[axis];
            self.columns[3 + axis][self.count] = force[axis];
        }
        self.count += 1;
    }

    /// Adds the Gauss points of the edges `edges` of a line. `node` and `density`: position (m) and force density (N/m,
    /// linear between nodes) of a node.
    #[inline(always)]
    pub fn push_edges(
        &mut self,
        edges: Range<usize>,
        rule: &[(f64, f64)],
        node: impl Fn(usize) -> V3,
        density: impl Fn(usize) -> V3,
    ) {
        self.line[0].fill(edges.len() + 1, |i| node(edges.start + i));
        self.line[1].fill(edges.len() + 1, |i| density(edges.start + i));
        self.make_room(rule.len() * edges.len());
        for gauss in rule {
            dispatch(Expand { sources: self, edges: edges.len(), gauss: *gauss });
            self.count += edges.len();
        }
    }

    /// Makes room for more points, and for whole registers after them.
    #[inline(always)]
    fn make_room(&mut self, more: usize) {
        let wanted = self.count + more + PADDING;
        if self.columns[0].len() < wanted {
            for column in &mut self.columns {
                column.resize(2 * wanted, 0.0);
            }
        }
    }
}

/// Writes one Gauss point of each edge of the line behind the points; compiled for the machine's vector instructions.
struct Expand<'a> {
    sources: &'a mut Sources,
    edges: usize,
    gauss: (f64, f64),
}

impl Kernel for Expand<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Sources { count, columns, line: [nodes, density] } = self.sources;
        let (point, weight) = (Wide::all(simd, self.gauss.0), self.gauss.1);
        for e in (0..self.edges).step_by(S::F64_LANES) {
            let (x, f) = (nodes.load(simd, e), density.load(simd, e));
            let (dx, df) = (nodes.load(simd, e + 1) - x, density.load(simd, e + 1) - f);
            let share = dx.dot(dx).sqrt().scaled(weight);
            let (at, force) = (dx.times_plus(point, x), df.times_plus(point, f) * share);
            for axis in 0..3 {
                at.0[axis].store(&mut columns[axis], *count + e);
                force.0[axis].store(&mut columns[3 + axis], *count + e);
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
    /// Returns targets with room for `count` points.
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
        let columns = sources.columns.each_ref().map(|column| &column[..sources.count]);
        match &mut self.0 {
            Points::Single(targets) => targets.add_flow(columns, epsilon),
            Points::Double(targets) => targets.add_flow(columns, epsilon),
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
    ($name:ident, $widest:literal, $scalar:ident, $vector:ident, $view:ident, $view_mut:ident, $lanes:ident, $splat:ident, $sub:ident, $mul:ident, $div:ident, $sqrt:ident, $fma:ident, $total:ident) => {
        mod $name {
            use crate::V3;
            use crate::simd::{Kernel, Simd, dispatch};

            /// Points are padded to a multiple of this, the lanes of the widest register.
            const LANES: usize = $widest;

            #[derive(Clone, Debug)]
            pub(super) struct Points {
                count: usize,
                at: [Vec<$scalar>; 3],
                flow: [Vec<$scalar>; 3],
                /// The sources, padded with points without a force.
                sources: [Vec<$scalar>; 6],
            }

            impl Points {
                pub(super) fn new(count: usize) -> Self {
                    let padded = count.div_ceil(LANES) * LANES;
                    let zeros = || std::array::from_fn(|_| vec![0.0; padded]);
                    Self { count, at: zeros(), flow: zeros(), sources: Default::default() }
                }

                pub(super) fn set(&mut self, points: &[V3]) {
                    for (axis, (at, flow)) in self.at.iter_mut().zip(&mut self.flow).enumerate() {
                        for (slot, point) in at.iter_mut().zip(points) {
                            *slot = point[axis] as $scalar;
                        }
                        flow.fill(0.0);
                    }
                }

                pub(super) fn add_flow(&mut self, sources: [&[f64]; 6], epsilon: f64) {
                    let count = sources[0].len();
                    for (converted, column) in self.sources.iter_mut().zip(sources) {
                        converted.clear();
                        converted.extend(column.iter().map(|v| *v as $scalar));
                        converted.resize(count.div_ceil(LANES) * LANES, 0.0);
                    }
                    dispatch(Sum { points: self, count, e2: (epsilon * epsilon) as $scalar });
                }

                #[inline(always)]
                pub(super) fn flow(&self, i: usize) -> V3 {
                    V3::new(self.flow[0][i] as f64, self.flow[1][i] as f64, self.flow[2][i] as f64)
                }
            }

            struct Sum<'a> {
                points: &'a mut Points,
                /// Sources without their padding.
                count: usize,
                e2: $scalar,
            }

            impl Kernel for Sum<'_> {
                type Output = ();

                #[inline(always)]
                fn run<S: Simd>(self, simd: S) {
                    let Points { count: targets, at: [x, y, z], flow: [ux, uy, uz], sources } = self.points;
                    let [sx, sy, sz, fx, fy, fz] = sources;
                    let e2 = simd.$splat(self.e2);
                    // Registers of targets. If the last targets fill at most three quarters of the widest register, they are
                    // summed over registers of sources. The order of the sums must not depend on the machine's register
                    // width.
                    let blocked = (*targets + LANES / 4 - 1) / LANES * LANES;
                    {
                        let count = self.count;
                        let (sx, sy, sz) = (&sx[..count], &sy[..count], &sz[..count]);
                        let (fx, fy, fz) = (&fx[..count], &fy[..count], &fz[..count]);
                        let (x, y, z) = (S::$view(x).0, S::$view(y).0, S::$view(z).0);
                        let (ux, uy, uz) = (S::$view_mut(ux).0, S::$view_mut(uy).0, S::$view_mut(uz).0);
                        for block in 0..blocked / S::$lanes {
                            let at = [x[block], y[block], z[block]];
                            let mut sum = [ux[block], uy[block], uz[block]];
                            for j in 0..count {
                                let from = [simd.$splat(sx[j]), simd.$splat(sy[j]), simd.$splat(sz[j])];
                                let force = [simd.$splat(fx[j]), simd.$splat(fy[j]), simd.$splat(fz[j])];
                                sum = add(simd, at, from, force, e2, sum);
                            }
                            [ux[block], uy[block], uz[block]] = sum;
                        }
                    }
                    let (sx, sy, sz) = (S::$view(sx).0, S::$view(sy).0, S::$view(sz).0);
                    let (fx, fy, fz) = (S::$view(fx).0, S::$view(fy).0, S::$view(fz).0);
                    let registers = LANES / S::$lanes;
                    for i in blocked..*targets {
                        let at = [simd.$splat(x[i]), simd.$splat(y[i]), simd.$splat(z[i])];
                        let mut sums = [[simd.$splat(0.0); LANES]; 3];
                        for start in (0..sx.len()).step_by(registers) {
                            for r in 0..registers {
                                let (j, sum) = (start + r, sums.map(|axis| axis[r]));
                                let sum = add(simd, at, [sx[j], sy[j], sz[j]], [fx[j], fy[j], fz[j]], e2, sum);
                                (sums[0][r], sums[1][r], sums[2][r]) = sum.into();
                            }
                        }
                        ux[i] += simd.$total(sums[0]);
                        uy[i] += simd.$total(sums[1]);
                        uz[i] += simd.$total(sums[2]);
                    }
                }
            }

            /// Adds the flow of point forces to a sum, lane by lane.
            #[inline(always)]
            fn add<S: Simd>(
                simd: S,
                at: [S::$vector; 3],
                from: [S::$vector; 3],
                [fx, fy, fz]: [S::$vector; 3],
                e2: S::$vector,
                [sx, sy, sz]: [S::$vector; 3],
            ) -> [S::$vector; 3] {
                // Spelled out: a closure would be compiled without the vector instructions.
                let dx = simd.$sub(at[0], from[0]);
                let dy = simd.$sub(at[1], from[1]);
                let dz = simd.$sub(at[2], from[2]);
                let r2 = simd.$fma(dx, dx, simd.$fma(dy, dy, simd.$fma(dz, dz, e2)));
                let inverse = simd.$div(simd.$splat(1.0), simd.$sqrt(r2));
                let cubed = simd.$mul(simd.$mul(inverse, inverse), inverse);
                let dot = simd.$fma(dx, fx, simd.$fma(dy, fy, simd.$mul(dz, fz)));
                let along = simd.$mul(dot, cubed);
                let direct = simd.$fma(e2, cubed, inverse);
                [
                    simd.$fma(direct, fx, simd.$fma(along, dx, sx)),
                    simd.$fma(direct, fy, simd.$fma(along, dy, sy)),
                    simd.$fma(direct, fz, simd.$fma(along, dz, sz)),
                ]
            }
        }
    };
}

kernel!(
    single,
    16,
    f32,
    f32s,
    as_simd_f32s,
    as_mut_simd_f32s,
    F32_LANES,
    splat_f32s,
    sub_f32s,
    mul_f32s,
    div_f32s,
    sqrt_f32s,
    fused_f32s,
    sum_f32s
);
kernel!(
    double,
    8,
    f64,
    f64s,
    as_simd_f64s,
    as_mut_simd_f64s,
    F64_LANES,
    splat_f64s,
    sub_f64s,
    mul_f64s,
    div_f64s,
    sqrt_f64s,
    fused_f64s,
    sum_f64s
);
