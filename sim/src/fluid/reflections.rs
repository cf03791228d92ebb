//! The flow missing from the images in single walls: the reflections of these images in the other walls of a tank.
//!
//! The sum of the images in single walls subtracts too much flow. Midway between two walls a force along them loses 12
//! % too much of its flow, and in a closed tank a robot's sideways mobility would not even be positive. The remainder
//! is a smooth flow without forces in the tank. It is found once, in world axes: point forces behind each wall (method
//! of fundamental solutions) cancel the slip that the superposed images leave on it, at as many points (least squares).
//! For points about the robot, the result is a polynomial in the positions of the force and of the flow.

use super::head::stokeslet;
use super::walls::{Images, Plane, Walls};
use crate::V3;
use crate::cholesky::whiten;
use crate::functions::{asinh, cos, cosh, sinh};
use crate::linear::multiply;
use crate::simd::{Kernel, Simd, dispatch};
use nalgebra::{DMatrix, Matrix3};

/// Largest number of points on all walls.
const POINTS: f64 = 250.0;
/// Damping of the least squares, relative to the mean square of a force's flow. It matters only for forces that cause
/// no flow.
const DAMPING: f64 = 1e-9;
/// Extent of a wall that no other wall bounds, over its distance from the robot's middle.
const OPEN: f64 = 8.0;
/// Distance of the forces behind a wall, over the spacing of its points.
const BEHIND: f64 = 1.0;
/// Total degree of the polynomials.
const DEGREE: usize = 4;
/// Points for the fit of the polynomials, along each axis of the box about the robot.
const SAMPLES: usize = 5;

/// The remaining flow between points about the robot.
#[derive(Clone, Debug, Default)]
pub struct Reflections {
    centre: V3,
    half: V3,
    /// Gives the coefficients of the flow from the moments of the forces: for all monomials along x, then y, then z.
    matrix: DMatrix<f64>,
    /// Monomials at the points, one point after the other.
    values: Vec<f64>,
}

impl Reflections {
    /// Returns the flow missing from the images in `near`, which may lack some of the images in `walls`. `robot`: least
    /// and largest corner of the box that holds the robot, m. `None` for a single wall or surface, whose image is
    /// exact.
    pub fn new(walls: &Walls, near: &Walls, robot: [V3; 2]) -> Option<Self> {
        if walls.planes.len() + usize::from(walls.surface.is_some()) < 2 {
            return None;
        }
        let middle = (robot[0] + robot[1]) * 0.5;
        let (mut points, mut sources) = (vec![], vec![]);
        // The mirror images of forces account for the mirror images of walls.
        let above = walls.surface.unwrap_or(f64::INFINITY);
        let real: Vec<&Plane> = walls.planes.iter().filter(|plane| plane.axis != 2 || plane.at < above).collect();
        let along = (POINTS / real.len().max(1) as f64).sqrt() as usize;
        for plane in &real {
            let mut ends = [V3::repeat(-OPEN), V3::repeat(OPEN)].map(|e| middle + e * plane.height(middle));
            for other in &real {
                ends[usize::from(other.side < 0.0)][other.axis] = other.at;
            }
            if let Some(surface) = walls.surface {
                ends[1].z = surface;
            }
            cover(plane, middle, ends, along, &mut points, &mut sources);
        }
        let flow = |x: V3, y: V3| {
            let own = stokeslet(x - y, 0.0);
            match walls.surface {
                None => own,
                Some(surface) => {
                    let mirrored = stokeslet(x - V3::new(y.x, y.y, 2.0 * surface - y.z), 0.0);
                    own + mirrored * Matrix3::from_diagonal(&V3::new(1.0, 1.0, -1.0))
                }
            }
        };
        let blocks = |rows: &[V3], columns: &[V3], block: &dyn Fn(V3, V3) -> Matrix3<f64>| {
            let mut matrix = DMatrix::zeros(3 * rows.len(), 3 * columns.len());
            for (i, x) in rows.iter().enumerate() {
                for (j, y) in columns.iter().enumerate() {
                    matrix.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&block(*x, *y));
                }
            }
            matrix
        };
        let behind = blocks(&points, &sources, &flow);
        let samples = grid(robot);
        let mut slip = blocks(&points, &samples, &|x, y| stokeslet(x - y, 0.0));
        let mut images = Images::default();
        images.assemble(walls, &points, &samples, 0.0);
        images.add_to(&mut slip, 1.0);
        let mut far = DMatrix::zeros(3 * samples.len(), 3 * samples.len());
        for (walls, sign) in [(walls, 1.0), (near, -1.0)] {
            images.assemble(walls, &samples, &samples, 0.0);
            images.add_to(&mut far, sign);
        }

        let mut fitted = Self {
            centre: middle,
            half: (robot[1] - robot[0]) * 0.5,
            matrix: DMatrix::zeros(0, 0),
            values: Vec::new(),
        };
        fitted.set_points(&samples);
        let values = std::mem::take(&mut fitted.values);
        let values = DMatrix::from_row_slice(samples.len(), values.len() / samples.len(), &values);
        let factors = values.qr();
        let fit = factors.r().solve_upper_triangular(&factors.q().transpose())?.kronecker(&Matrix3::identity());
        // Polynomials first: they are fewer than the samples.
        let size = fit.nrows();
        let mut rows = DMatrix::zeros(2 * size, behind.ncols());
        rows.rows_mut(0, size).copy_from(&(&fit * blocks(&samples, &sources, &flow)));
        rows.rows_mut(size, size).copy_from(&((slip * fit.transpose()).transpose() * &behind));
        let rows = whiten(&behind, &rows, DAMPING)?;
        let cancelled = rows.rows(0, size) * rows.rows(size, size).transpose();
        let matrix = &fit * (far * fit.transpose()) - cancelled;
        // The exact flow is reciprocal.
        let matrix = (&matrix + matrix.transpose()) * 0.5;
        let count = matrix.nrows() / 3;
        let of = |i: usize| 3 * (i % count) + i / count;
        fitted.matrix = DMatrix::from_fn(3 * count, 3 * count, |i, j| matrix[(of(i), of(j))]);
        Some(fitted)
    }

    /// Sets the points where forces act and the flow is wanted, m.
    pub fn set_points(&mut self, points: &[V3]) {
        self.values.clear();
        for x in points {
            let scaled = self.scaled(*x);
            push_monomials(scaled, &mut self.values);
        }
    }

    /// Adds the moments of forces (N) at the points from `first` on: the sums of force times each monomial.
    pub fn add_moments(&self, first: usize, forces: &[V3], moments: &mut Vec<f64>) {
        moments.resize(self.matrix.nrows(), 0.0);
        let values = &self.values[first * moments.len() / 3..];
        dispatch(Gather { values, forces, moments });
    }

    /// Adds the flow of forces with these moments to the flow at the points, without the factor 1/(8 pi mu): N/m.
    pub fn add_flow(&self, moments: &[f64], flow: &mut [V3]) {
        let mut coefficients = vec![0.0; moments.len()];
        multiply(self.matrix.as_slice(), moments, &mut coefficients);
        dispatch(Spread { values: &self.values, coefficients: &coefficients, flow });
    }

    fn scaled(&self, x: V3) -> V3 {
        (x - self.centre).component_div(&self.half)
    }
}

/// Adds forces times the monomials at their points; compiled for the machine's vector instructions.
struct Gather<'a> {
    values: &'a [f64],
    forces: &'a [V3],
    moments: &'a mut [f64],
}

impl Kernel for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let count = self.moments.len() / 3;
        for (values, force) in self.values.chunks_exact(count).zip(self.forces) {
            for (moments, f) in self.moments.chunks_exact_mut(count).zip(force.as_slice()) {
                for (moment, value) in moments.iter_mut().zip(values) {
                    *moment += f * value;
                }
            }
        }
    }
}

/// Adds polynomials at the points to the flow there; compiled for the machine's vector instructions.
struct Spread<'a> {
    values: &'a [f64],
    coefficients: &'a [f64],
    flow: &'a mut [V3],
}

impl Kernel for Spread<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let count = self.coefficients.len() / 3;
        for (values, u) in self.values.chunks_exact(count).zip(self.flow) {
            for (coefficients, u) in self.coefficients.chunks_exact(count).zip(u.as_mut_slice()) {
                let (values, coefficients) = (values.chunks_exact(8), coefficients.chunks_exact(8));
                let rest: f64 = values.remainder().iter().zip(coefficients.remainder()).map(|(v, c)| v * c).sum();
                let mut sums = [simd.splat_f64s(0.0); 8];
                for (values, coefficients) in values.zip(coefficients) {
                    let (values, coefficients) = (S::as_simd_f64s(values).0, S::as_simd_f64s(coefficients).0);
                    for i in 0..8 / S::F64_LANES {
                        sums[i] = simd.fused_f64s(values[i], coefficients[i], sums[i]);
                    }
                }
                *u += simd.sum_f64s(sums) + rest;
            }
        }
    }
}

/// Adds the monomials of a total degree up to [`DEGREE`] to a list.
fn push_monomials(x: V3, out: &mut Vec<f64>) {
    let mut first = 1.0;
    for a in 0..=DEGREE {
        let mut second = first;
        for b in 0..=DEGREE - a {
            let mut third = second;
            for _ in 0..=DEGREE - a - b {
                out.push(third);
                third *= x.z;
            }
            second *= x.y;
        }
        first *= x.x;
    }
}

/// Returns the points of a grid in a box, closer together at its sides.
fn grid([low, high]: [V3; 2]) -> Vec<V3> {
    let at = |i: usize| -cos(std::f64::consts::PI * (i as f64 + 0.5) / SAMPLES as f64);
    let index = |i: usize| V3::new(at(i % SAMPLES), at(i / SAMPLES % SAMPLES), at(i / SAMPLES / SAMPLES));
    (0..SAMPLES.pow(3)).map(|i| (low + high) * 0.5 + (high - low).component_mul(&index(i)) * 0.5).collect()
}

/// Adds points of a wall between its ends, `along` per side and closer together near the robot's middle, and positions
/// of forces behind them.
fn cover(plane: &Plane, middle: V3, ends: [V3; 2], along: usize, points: &mut Vec<V3>, sources: &mut Vec<V3>) {
    let height = plane.height(middle);
    let axes = [(plane.axis + 1) % 3, (plane.axis + 2) % 3];
    // Positions and spacing along each axis.
    let places = axes.map(|axis| {
        let [from, to] = ends.map(|corner| asinh((corner[axis] - middle[axis]) / height));
        let step = (to - from) / along as f64;
        (0..along).map(move |i| {
            let u = from + (i as f64 + 0.5) * step;
            (middle[axis] + height * sinh(u), height * cosh(u) * step)
        })
    });
    for (first, first_step) in places[0].clone() {
        for (second, second_step) in places[1].clone() {
            let mut x = V3::zeros();
            (x[plane.axis], x[axes[0]], x[axes[1]]) = (plane.at, first, second);
            points.push(x);
            x[plane.axis] -= plane.side * BEHIND * first_step.max(second_step);
            sources.push(x);
        }
    }
}
