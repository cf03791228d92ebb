//! The flow that images in single walls leave out: the reflections of these images in the other walls of a tank.
//!
//! The sum of the images in single walls subtracts too much flow. Midway between two walls a force along them loses 12
//! % too much of its flow, and in a closed tank a robot's sideways mobility would not even be positive. The remainder
//! is a smooth flow without forces in the tank. It is found once, world axes: point forces behind each wall (method of
//! fundamental solutions) cancel what the superposed images leave on it, in as many points (least squares); between
//! points about the robot the result is a polynomial in the place of the force and of the flow.

use super::head::stokeslet;
use super::walls::{Plane, Walls};
use crate::V3;
use nalgebra::{DMatrix, DVector, Matrix3};

/// Points on all walls, at most.
const POINTS: f64 = 250.0;
/// Damping of the least squares, relative to the mean square of a force's flow. It matters only for forces that cause
/// no flow.
const DAMPING: f64 = 1e-9;
/// How far a wall reaches where no other one ends it, in distances from the robot's middle.
const OPEN: f64 = 8.0;
/// Distance of the forces behind a wall over that of its points from each other.
const BEHIND: f64 = 1.0;
/// Total degree of the polynomials.
const DEGREE: usize = 4;
/// Points along each axis of the box about the robot in which the polynomials are fitted.
const SAMPLES: usize = 5;

/// The remaining flow between points about the robot.
#[derive(Clone, Debug, Default)]
pub struct Reflections {
    centre: V3,
    half: V3,
    /// Coefficients of the flow for those of the forces, three for each monomial.
    matrix: DMatrix<f64>,
    /// Monomials at the points, one point after the other.
    values: Vec<f64>,
}

impl Reflections {
    /// `robot`: least and largest corner of the box in which the robot is, m. `None` where a single wall or surface leaves
    /// nothing.
    pub fn new(walls: &Walls, robot: [V3; 2]) -> Option<Self> {
        if walls.planes().len() + usize::from(walls.surface().is_some()) < 2 {
            return None;
        }
        let middle = (robot[0] + robot[1]) * 0.5;
        let (mut points, mut sources) = (vec![], vec![]);
        // The mirror images of walls are met by the mirror images of forces.
        let above = walls.surface().unwrap_or(f64::INFINITY);
        let real: Vec<&Plane> = walls.planes().iter().filter(|plane| plane.axis != 2 || plane.at < above).collect();
        let along = (POINTS / real.len().max(1) as f64).sqrt() as usize;
        for plane in &real {
            let mut ends = [V3::repeat(-OPEN), V3::repeat(OPEN)].map(|e| middle + e * plane.height(middle));
            for other in &real {
                ends[usize::from(other.side < 0.0)][other.axis] = other.at;
            }
            if let Some(surface) = walls.surface() {
                ends[1].z = surface;
            }
            cover(plane, middle, ends, along, &mut points, &mut sources);
        }
        let flow = |x: V3, y: V3| {
            let own = stokeslet(x - y, 0.0);
            match walls.surface() {
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
        // The library's product with a transpose is far slower than this.
        let across = behind.transpose();
        let mut normal = &across * &behind;
        let damping = DAMPING * normal.trace() / normal.nrows() as f64;
        normal += DMatrix::identity(normal.nrows(), normal.nrows()) * damping;
        let samples = grid(robot);
        let slip = blocks(&points, &samples, &|x, y| stokeslet(x - y, 0.0) + walls.tensor(x, y, 0.0));
        let strengths = normal.cholesky()?.solve(&(across * slip));
        let between = blocks(&samples, &sources, &flow) * strengths * -1.0;

        let mut fitted = Self {
            centre: middle,
            half: (robot[1] - robot[0]) * 0.5,
            matrix: DMatrix::zeros(0, 0),
            values: Vec::new(),
        };
        fitted.set_points(&samples);
        let values = std::mem::take(&mut fitted.values);
        let values = DMatrix::from_row_slice(samples.len(), values.len() / samples.len(), &values);
        let fit = values.pseudo_inverse(1e-12).ok()?.kronecker(&Matrix3::identity());
        let matrix = &fit * between * fit.transpose();
        // The exact flow is reciprocal.
        fitted.matrix = (&matrix + matrix.transpose()) * 0.5;
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

    /// Adds the flow of forces (N) at the points to the flow there, without the factor 1/(8 pi mu): N/m.
    pub fn add_flow(&self, forces: &[V3], flow: &mut [V3]) {
        let count = self.matrix.nrows() / 3;
        let mut moments = DVector::zeros(3 * count);
        for (values, f) in self.values.chunks_exact(count).zip(forces) {
            for (moment, value) in moments.as_mut_slice().chunks_exact_mut(3).zip(values) {
                for a in 0..3 {
                    moment[a] += f[a] * value;
                }
            }
        }
        let coefficients = &self.matrix * moments;
        for (values, u) in self.values.chunks_exact(count).zip(flow) {
            for (coefficient, value) in coefficients.as_slice().chunks_exact(3).zip(values) {
                for a in 0..3 {
                    u[a] += coefficient[a] * value;
                }
            }
        }
    }

    fn scaled(&self, x: V3) -> V3 {
        (x - self.centre).component_div(&self.half)
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

/// Returns the points of a grid in a box, nearer to each other at its sides.
fn grid([low, high]: [V3; 2]) -> Vec<V3> {
    let at = |i: usize| -(std::f64::consts::PI * (i as f64 + 0.5) / SAMPLES as f64).cos();
    let index = |i: usize| V3::new(at(i % SAMPLES), at(i / SAMPLES % SAMPLES), at(i / SAMPLES / SAMPLES));
    (0..SAMPLES.pow(3)).map(|i| (low + high) * 0.5 + (high - low).component_mul(&index(i)) * 0.5).collect()
}

/// Adds points of a wall between its ends, `along` each side, the closer together the nearer to the robot's middle, and
/// places of forces behind them.
fn cover(plane: &Plane, middle: V3, ends: [V3; 2], along: usize, points: &mut Vec<V3>, sources: &mut Vec<V3>) {
    let height = plane.height(middle);
    let axes = [(plane.axis + 1) % 3, (plane.axis + 2) % 3];
    // Along an axis: places and the distance of neighbours.
    let places = axes.map(|axis| {
        let [from, to] = ends.map(|corner| ((corner[axis] - middle[axis]) / height).asinh());
        let step = (to - from) / along as f64;
        (0..along).map(move |i| {
            let u = from + (i as f64 + 0.5) * step;
            (middle[axis] + height * u.sinh(), height * u.cosh() * step)
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
