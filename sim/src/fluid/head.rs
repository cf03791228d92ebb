//! The surface of a rigid body as regularised point forces, and its resistance.
//!
//! Method of regularised Stokeslets (Cortez 2001; Cortez, Fauci, Medovikov 2005): point forces F_j on the closed
//! surface make the flow 8 pi mu u(x_i) = sum over j of (1/R + e^2/R^3) F_j + (x_i - x_j).F_j (x_i - x_j)/R^3 at each
//! of its points, with R^2 = |x_i - x_j|^2 + e^2. This flow must equal the velocity of the surface. The matrix of the
//! system is symmetric, positive definite and constant in the body frame, so it is inverted once.
//!
//! A point represents a cell of the surface, and its regularisation is a fixed share of the cell's width. The flow of a
//! point in its own cell is then nearly the mean flow of a force spread over the cell, and the error decreases with the
//! width.
//!
//! Units SI, body frame. The axis of all shapes is parallel to z.

use super::stokeslet_factor;
use crate::V3;
use crate::functions::{hypot, powi, sin_cos};
use crate::linear::invert;
use crate::params::{Head, HeadShape, ParamError, Robot};
use nalgebra::{DMatrix, Matrix3, Matrix6};
use std::f64::consts::{PI, TAU};

/// Points of a head. More change its resistance by less than a per cent, and cost time in each sweep.
pub const POINTS: usize = 40;
/// Regularisation over the width of a cell. With it and [`INSET`], the translational and the rotational resistance of a
/// sphere are within 1 % for any number of points.
const EPSILON: f64 = 0.42;
/// Depth of the points under the surface, relative to the distance between neighbours. The body in the flow is slightly
/// larger than the hull of its points.
const INSET: f64 = 0.06;
/// The same for a cylinder, with a ring of points on each edge; these points represent the largest part of the body.
const INSET_OF_EDGES: f64 = 0.09;

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Place, m.
    pub at: V3,
    /// Area of its cell, m2.
    pub area: f64,
}

/// Returns about `count` points, well spread on the surface of a head: rings about its axis, about as far apart as the
/// points of a ring. They are symmetric in both planes through the axis, as the robot is. Empty for a head that is not
/// a body in the flow.
pub fn surface_points(head: &Head, count: usize) -> Vec<SurfacePoint> {
    let (a, c) = (head.radius_m, head.half_length());
    let width_for = |area: f64| (area / count as f64).sqrt();
    let (width, rings) = match head.shape {
        HeadShape::None | HeadShape::Local => return Vec::new(),
        HeadShape::Cylinder => {
            let width = width_for(TAU * a * (a + 2.0 * c));
            let inset = INSET_OF_EDGES * width;
            (width, cylinder_rings(a - inset, c - inset, width))
        }
        HeadShape::Sphere | HeadShape::Spheroid => {
            let width = width_for(spheroid_outline(a, c).windows(2).map(band).sum());
            let inset = INSET * width;
            (width, spheroid_rings(&spheroid_outline(a - inset, c - inset), width))
        }
    };
    let mut points = Vec::new();
    for (k, ring) in rings.iter().enumerate() {
        let half = (PI * ring.radius / width).round().max(1.0);
        let number = 2.0 * half;
        // Every second ring is turned by half a cell.
        let shift = if k % 2 == 0 { 0.5 } else { 0.0 };
        for j in 0..number as usize {
            let (sine, cosine) = sin_cos(TAU * (j as f64 + shift) / number);
            let at = head.centre() + V3::new(ring.radius * cosine, ring.radius * sine, ring.height);
            points.push(SurfacePoint { at, area: ring.area / number });
        }
    }
    points
}

/// Points of a surface at one height.
struct Ring {
    radius: f64,
    height: f64,
    area: f64,
}

/// Returns the rings of a cylinder: one on each edge, where the forces are largest, and others at equal distances
/// between them.
fn cylinder_rings(a: f64, c: f64, width: f64) -> Vec<Ring> {
    let rings = (a / width + 0.5).round().max(1.0);
    let step = a / (rings - 0.5);
    let bands = (2.0 * c / width).round().max(1.0);
    let height = 2.0 * c / bands;
    let mut out = Vec::new();
    let disc = |k: f64| PI * powi(step * k, 2);
    for k in 1..rings as usize {
        let k = k as f64;
        out.push(Ring { radius: step * (k - 0.5), height: c, area: disc(k) - disc(k - 1.0) });
    }
    let edge = PI * a * a - disc(rings - 1.0) + PI * a * height;
    for k in 0..=bands as usize {
        let area = if k == 0 || k == bands as usize { edge } else { TAU * a * height };
        out.push(Ring { radius: a, height: c - k as f64 * height, area });
    }
    for k in (1..rings as usize).rev() {
        let k = k as f64;
        out.push(Ring { radius: step * (k - 0.5), height: -c, area: disc(k) - disc(k - 1.0) });
    }
    out
}

/// Returns the outline of a spheroid in a half-plane through its axis: distance from the axis and height, at close
/// steps.
fn spheroid_outline(a: f64, c: f64) -> Vec<[f64; 2]> {
    let steps = 4000;
    (0..=steps).map(|i| sin_cos(PI * f64::from(i) / f64::from(steps))).map(|(s, z)| [a * s, c * z]).collect()
}

/// Returns the area of the band between two points of an outline.
fn band(ends: &[[f64; 2]]) -> f64 {
    let ([r0, z0], [r1, z1]) = (ends[0], ends[1]);
    PI * (r0 + r1) * hypot(r1 - r0, z1 - z0)
}

/// Returns the rings in the middle of equal arcs of an outline.
fn spheroid_rings(outline: &[[f64; 2]], width: f64) -> Vec<Ring> {
    let lengths = outline.windows(2).map(|p| hypot(p[1][0] - p[0][0], p[1][1] - p[0][1]));
    let mut arc = vec![0.0];
    for length in lengths {
        arc.push(arc[arc.len() - 1] + length);
    }
    let total = arc[arc.len() - 1];
    let rings = (total / width).round().max(2.0);
    let at = |s: f64| arc.partition_point(|t| *t < s).min(outline.len() - 1);
    (0..rings as usize)
        .map(|k| {
            let [low, middle, high] = [0.0, 0.5, 1.0].map(|h| at((k as f64 + h) / rings * total));
            let [radius, height] = outline[middle];
            Ring { radius, height, area: outline[low..=high].windows(2).map(band).sum() }
        })
        .collect()
}

/// A rigid body, as its surface and the forces that move it.
#[derive(Clone, Debug)]
pub struct RigidSurface {
    /// Its points, m.
    pub points: Vec<V3>,
    /// Velocities of the points (m/s) for forces (N, on the fluid): 3 n square.
    pub mobility: DMatrix<f64>,
    /// Forces (N, on the fluid) for velocities of the points (m/s): 3 n square.
    pub resistance: DMatrix<f64>,
}

impl RigidSurface {
    /// Returns the head of a robot; `None` if it is not a body in the flow.
    ///
    /// # Errors
    /// A head whose points are too close to each other.
    pub fn of_head(robot: &Robot) -> Result<Option<Self>, ParamError> {
        let points = surface_points(&robot.head, POINTS);
        if points.is_empty() {
            return Ok(None);
        }
        let singular = || ParamError {
            key: "head.radius_m",
            value: robot.head.radius_m,
            reason: "the resistance of the head cannot be computed with it".into(),
        };
        Self::new(&points, robot.fluid.viscosity()).map(Some).ok_or_else(singular)
    }

    /// Inverts the mobility of the points; `None` when it is singular, as with points in the same place.
    pub fn new(points: &[SurfacePoint], viscosity: f64) -> Option<Self> {
        let factor = stokeslet_factor(viscosity);
        let size = 3 * points.len();
        let mut matrix = vec![0.0; size * size];
        for (i, p) in points.iter().enumerate() {
            for (j, q) in points.iter().enumerate() {
                let epsilon_squared = EPSILON * EPSILON * 0.5 * (p.area + q.area);
                let block = stokeslet(p.at - q.at, epsilon_squared) * factor;
                for a in 0..3 {
                    for b in 0..3 {
                        matrix[(3 * i + a) * size + 3 * j + b] = block[(a, b)];
                    }
                }
            }
        }
        let mobility = DMatrix::from_row_slice(size, size, &matrix);
        invert(&mut matrix, size).then(|| Self {
            points: points.iter().map(|p| p.at).collect(),
            mobility,
            resistance: DMatrix::from_row_slice(size, size, &matrix),
        })
    }

    /// Returns the forces of the points (N, on the fluid) when the body moves with these velocities (m/s and rad/s, at
    /// `pivot`): one column for each of the six.
    pub fn forces_of_motions(&self, pivot: V3) -> DMatrix<f64> {
        let mut velocities = DMatrix::zeros(3 * self.points.len(), 6);
        for (i, x) in self.points.iter().enumerate() {
            velocities.fixed_view_mut::<3, 6>(3 * i, 0).copy_from(&rigid_motions(x - pivot));
        }
        &self.resistance * velocities
    }

    /// Returns the torque on the fluid about the joint per angular velocity, N m s.
    pub fn rotational_resistance(&self) -> Matrix3<f64> {
        self.rigid_resistance(V3::zeros()).fixed_view::<3, 3>(3, 3).into_owned()
    }

    /// Returns force and torque about `pivot` on the fluid (N, N m) for velocity and angular velocity there.
    pub fn rigid_resistance(&self, pivot: V3) -> Matrix6<f64> {
        let forces = self.forces_of_motions(pivot);
        let mut total = Matrix6::zeros();
        for (i, x) in self.points.iter().enumerate() {
            total += rigid_motions(x - pivot).transpose() * forces.fixed_view::<3, 6>(3 * i, 0);
        }
        total
    }
}

/// Returns the velocities at `arm` from the pivot for unit velocities (first three columns) and angular velocities.
pub fn rigid_motions(arm: V3) -> nalgebra::Matrix3x6<f64> {
    let mut motions = nalgebra::Matrix3x6::zeros();
    motions.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    motions.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
    motions
}

/// Returns the regularised Stokeslet at `r` from a unit force, without the factor 1/(8 pi mu): 1/m.
pub fn stokeslet(r: V3, epsilon_squared: f64) -> Matrix3<f64> {
    let distance_squared = r.norm_squared() + epsilon_squared;
    let inverse = 1.0 / distance_squared.sqrt();
    let cubed = inverse / distance_squared;
    Matrix3::identity() * (inverse + epsilon_squared * cubed) + r * r.transpose() * cubed
}
