//! The tank's boundaries as images: plane no-slip walls and a free surface.
//!
//! World axes. A point force at height h over a wall has an image at height -h. With z the height of a point in the
//! flow, X from the image to this point, R^2 = |X|^2 + eps^2, n the wall's normal into the fluid, f_n and X_n
//! components along n, g the force with its part along the wall reversed, and q = g.X, the image's flow is
//!
//! ```text
//! 8 pi mu u = -(1/R + eps^2/R^3) f + 2 h z (1/R^3 - 3 eps^2/R^5) g - 2 h q/R^3 n
//!             + ((q - 2 z f_n)/R^3 - 6 h z q/R^5) X
//! ```
//!
//! This is the image of Ainley, Durkin, Embid, Boindala and Cortez 2008 (*The method of images for regularized
//! Stokeslets*), with its terms collected. With the Stokeslet of [`super::far`] the flow vanishes at the wall to
//! rounding for every eps, eps = 0 gives Blake's image (1971), and force and velocity may be exchanged (reciprocity).
//!
//! A free surface that stays plane acts as a mirror: the image of a force is its mirror image. The walls are mirrored
//! as well, so that the surface has neither a normal velocity nor shear, whichever walls meet it.
//!
//! Each wall reflects the forces and their mirror images, but not the images in other walls. Between two walls that
//! face each other the sum is too large: midway between them by 12 % for a force along them (Faxen 1922: a small
//! sphere's drag grows by 1.004 radii over the distance; two images give 2 x 9/16). [`super::reflections`] has the
//! correction, and the images that are far from the robot; [`Walls::near`] has the other images.

use crate::V3;
use crate::lanes::{PADDING, Vectors, Wide, Wide3};
use crate::params::{Face, Tank};
use crate::simd::{Kernel, Simd, dispatch};
use nalgebra::{DMatrix, Matrix3};

/// A plane wall across an axis of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// The axis: 0, 1 or 2.
    pub axis: usize,
    /// Position of the plane along the axis, m.
    pub at: f64,
    /// 1 where the fluid is on the side of larger coordinates, else -1.
    pub side: f64,
}

impl Plane {
    /// Returns the height of a point over the wall, m.
    #[inline(always)]
    pub fn height(&self, x: V3) -> f64 {
        self.side * (x[self.axis] - self.at)
    }
}

/// No-slip walls, and a free surface across the vertical.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Walls {
    /// The walls; with a free surface also their mirror images.
    pub planes: Vec<Plane>,
    /// The walls with images of the forces' mirror images.
    of_mirrored: Vec<Plane>,
    /// Height of the free surface, m.
    pub surface: Option<f64>,
}

/// An image is far if its distance from the robot's space is more than this, over half the width of that space.
const FAR: f64 = 2.1;

impl Walls {
    /// Returns the boundaries of a fluid. `surface`: height of a free surface, m.
    pub fn new(mut planes: Vec<Plane>, surface: Option<f64>) -> Self {
        if let Some(surface) = surface {
            let floors: Vec<Plane> = planes.iter().filter(|p| p.axis == 2).copied().collect();
            planes.extend(floors.iter().map(|p| Plane { at: 2.0 * surface - p.at, side: -p.side, ..*p }));
        }
        let of_mirrored = if surface.is_some() { planes.clone() } else { Vec::new() };
        Self { planes, of_mirrored, surface }
    }

    /// Returns the walls and the free surface of a tank, world axes from the joint.
    pub fn of(tank: &Tank) -> Self {
        let plane = |face: &Face| {
            let (axis, side) = face.normal();
            Plane { axis, at: tank.place(*face), side: -side }
        };
        Self::new(tank.walls.iter().map(plane).collect(), tank.free_surface.then_some(tank.joint_depth_m))
    }

    /// Returns the same boundaries without the images that are far from every point of a robot between two corners (m):
    /// the flow of far images is smooth there.
    pub fn near(&self, [low, high]: [V3; 2]) -> Self {
        let width = (high - low).max();
        let is_near = |mirrors: &[(usize, f64)]| {
            let [mut from, mut to] = [low, high];
            for (axis, at) in mirrors {
                (from[*axis], to[*axis]) = (2.0 * at - to[*axis], 2.0 * at - from[*axis]);
            }
            let gap = V3::from_fn(|axis, _| (from[axis] - high[axis]).max(low[axis] - to[axis]).max(0.0));
            gap.norm() < FAR * 0.5 * width
        };
        let chosen = |planes: &[Plane], mirrors: &[(usize, f64)]| {
            planes.iter().filter(|p| is_near(&[mirrors, &[(p.axis, p.at)]].concat())).copied().collect()
        };
        let mirrored = self.surface.map(|at| (2, at));
        Self {
            planes: chosen(&self.planes, &[]),
            of_mirrored: chosen(&self.of_mirrored, mirrored.as_slice()),
            surface: self.surface,
        }
    }

    /// Returns the least distance of a point from the walls and the surface, m; negative outside.
    pub fn clearance(&self, x: V3) -> f64 {
        let surface = self.surface.map_or(f64::INFINITY, |at| at - x.z);
        self.planes.iter().map(|plane| plane.height(x)).fold(surface, f64::min)
    }

    /// Returns the flow at `x` of the images of a force at `y` (m), without the factor 1/(8 pi mu): column b belongs to
    /// a unit force along axis b, 1/m.
    pub fn tensor(&self, x: V3, y: V3, epsilon: f64) -> Matrix3<f64> {
        let mut images = Images::default();
        images.assemble(self, &[x], &[y], epsilon);
        Matrix3::from_fn(|a, b| images.columns[(3 * b + a) * PADDING])
    }

    #[inline(always)]
    fn add<S: Simd>(simd: S, planes: &[Plane], x: [Wide<S>; 3], y: V3, e2: f64, sum: &mut [Wide<S>; 9]) {
        for plane in planes {
            match plane.axis {
                0 => blake::<S, 0>(simd, plane, x, y, e2, sum),
                1 => blake::<S, 1>(simd, plane, x, y, e2, sum),
                _ => blake::<S, 2>(simd, plane, x, y, e2, sum),
            }
        }
    }
}

/// Adds the image of unit forces at `y` in a wall across axis `N`: entry 3 b + a is component a for a force along b.
#[inline(always)]
fn blake<S: Simd, const N: usize>(simd: S, plane: &Plane, x: [Wide<S>; 3], y: V3, e2: f64, sum: &mut [Wide<S>; 9]) {
    let all = |value| Wide::all(simd, value);
    let (h, side) = (plane.height(y), plane.side);
    // Components along the normal are stored along the axis: the wall's side changes only their sign.
    let z = (x[N] - all(plane.at)).scaled(side);
    let mut d = [x[0] - all(y.x), x[1] - all(y.y), x[2] - all(y.z)];
    d[N] = (z + all(h)).scaled(side);
    let r2 = d[0].times_plus(d[0], d[1].times_plus(d[1], d[2].times_plus(d[2], all(e2))));
    let i1 = r2.sqrt().inverse();
    let i2 = i1 * i1;
    let i3 = i2 * i1;
    let direct = i3.times_plus(all(e2), i1);
    let hz = z.scaled(2.0 * h);
    let mirrored = hz * i3 * i2.times_plus(all(-3.0 * e2), all(1.0));
    let pull = i3 * (hz * i2).times_plus(all(-3.0), all(1.0));
    let (across, along) = (i3.scaled(2.0 * h * side), (z * i3).scaled(2.0 * side));
    for b in 0..3 {
        let g = if b == N { d[b] } else { -d[b] };
        let gp = pull * g;
        for a in 0..3 {
            let slot = &mut sum[3 * b + a];
            *slot = d[a].times_plus(gp, *slot);
            if a == N {
                *slot = *slot - across * g;
            }
            if b == N {
                *slot = *slot - along * d[a];
            }
            if a == b {
                *slot = *slot - direct + if b == N { mirrored } else { -mirrored };
            }
        }
    }
}

/// Adds the Stokeslets of unit forces at `y`, with the force along the vertical reversed.
#[inline(always)]
fn mirror<S: Simd>(simd: S, x: [Wide<S>; 3], y: V3, e2: f64, sum: &mut [Wide<S>; 9]) {
    let all = |value| Wide::all(simd, value);
    let d = [x[0] - all(y.x), x[1] - all(y.y), x[2] - all(y.z)];
    let r2 = d[0].times_plus(d[0], d[1].times_plus(d[1], d[2].times_plus(d[2], all(e2))));
    let i1 = r2.sqrt().inverse();
    let i3 = i1 * i1 * i1;
    let direct = i3.times_plus(all(e2), i1);
    for b in 0..3 {
        let along = i3 * d[b];
        for a in 0..3 {
            let mut entry = along * d[a];
            if a == b {
                entry = entry + direct;
            }
            let slot = &mut sum[3 * b + a];
            *slot = if b == 2 { *slot - entry } else { *slot + entry };
        }
    }
}

/// The matrix of image flows between points, and its product with forces.
#[derive(Clone, Debug, Default)]
pub struct Images {
    /// For every source nine columns over the targets, 3 b + a as in [`blake`], padded to whole registers, one after the
    /// other.
    columns: Vec<f64>,
    /// Number of targets, padded.
    padded: usize,
    at: Vectors,
    flow: Vectors,
}

impl Images {
    /// Computes the matrix for these points, m: world axes.
    pub fn assemble(&mut self, walls: &Walls, targets: &[V3], sources: &[V3], epsilon: f64) {
        self.padded = targets.len().div_ceil(PADDING) * PADDING;
        // Padding repeats a point: its numbers stay finite.
        self.at.fill(self.padded, |i| targets[i.min(targets.len() - 1)]);
        self.flow.fill(self.padded, |_| V3::zeros());
        self.columns.resize(9 * self.padded * sources.len(), 0.0);
        dispatch(Assemble { images: self, walls, sources, e2: epsilon * epsilon });
    }

    /// Adds the matrix times a factor to another one, with three rows a target and three columns a source.
    pub fn add_to(&self, matrix: &mut DMatrix<f64>, factor: f64) {
        let targets = matrix.nrows() / 3;
        let padded = self.padded;
        for (j, columns) in self.columns.chunks_exact(9 * padded).enumerate() {
            for (entry, column) in columns.chunks_exact(padded).enumerate() {
                let (b, a) = (entry / 3, entry % 3);
                for (i, value) in column[..targets].iter().enumerate() {
                    matrix[(3 * i + a, 3 * j + b)] += value * factor;
                }
            }
        }
    }

    /// Computes the flow of forces (N) at the sources from `first` on; [`Images::flow`] returns it.
    pub fn multiply(&mut self, first: usize, forces: &[V3]) {
        dispatch(Multiply { images: self, first, forces });
    }

    /// Returns the flow at a target after [`Images::multiply`], without the factor 1/(8 pi mu): N/m.
    #[inline(always)]
    pub fn flow(&self, i: usize) -> V3 {
        self.flow.at(i)
    }
}

/// Compiles the assembly for the machine's vector instructions.
struct Assemble<'a> {
    images: &'a mut Images,
    walls: &'a Walls,
    sources: &'a [V3],
    e2: f64,
}

impl Kernel for Assemble<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { images, walls, sources, e2 } = self;
        let zero = Wide::all(simd, 0.0);
        let padded = images.padded;
        for (source, columns) in sources.iter().zip(images.columns.chunks_exact_mut(9 * padded)) {
            for block in (0..padded).step_by(S::F64_LANES) {
                let at = images.at.load(simd, block).0;
                let mut sum = [zero; 9];
                if let Some(surface) = walls.surface {
                    let reflected = V3::new(source.x, source.y, 2.0 * surface - source.z);
                    Walls::add(simd, &walls.of_mirrored, at, reflected, e2, &mut sum);
                    for entry in &mut sum[6..] {
                        *entry = -*entry;
                    }
                    mirror(simd, at, reflected, e2, &mut sum);
                }
                Walls::add(simd, &walls.planes, at, *source, e2, &mut sum);
                for (entry, value) in sum.into_iter().enumerate() {
                    value.store(columns, entry * padded + block);
                }
            }
        }
    }
}

/// Compiles the product for the machine's vector instructions.
struct Multiply<'a> {
    images: &'a mut Images,
    first: usize,
    forces: &'a [V3],
}

impl Kernel for Multiply<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { images, first, forces } = self;
        let padded = images.padded;
        let columns = &images.columns[9 * padded * first..];
        for block in (0..padded).step_by(S::F64_LANES) {
            // One sum for each axis of the force: a single sum would wait for each of its terms.
            let mut sums = [[Wide::all(simd, 0.0); 3]; 3];
            for (force, columns) in forces.iter().zip(columns.chunks_exact(9 * padded)) {
                for b in 0..3 {
                    let force = Wide::all(simd, force[b]);
                    for a in 0..3 {
                        let entry = Wide::load(simd, columns, (3 * b + a) * padded + block);
                        sums[b][a] = entry.times_plus(force, sums[b][a]);
                    }
                }
            }
            let sum = |a: usize| sums[0][a] + sums[1][a] + sums[2][a];
            images.flow.store(Wide3([sum(0), sum(1), sum(2)]), block);
        }
    }
}
