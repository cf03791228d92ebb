//! Rigid bodies in the fluid: closed forms, and finer resolutions where there are none.

use crate::common::prove;
use nalgebra::Matrix6;
use sim::V3;
use sim::fluid::head::{POINTS, RigidSurface, surface_points};
use sim::params::{Head, HeadShape};
use std::f64::consts::PI;

/// Resistance about the centre in units of the sphere's, 6 pi mu a and 8 pi mu a^3.
fn resistance(shape: HeadShape, radius: f64, length: f64, points: usize) -> Matrix6<f64> {
    let head = Head { shape, radius_m: radius, length_m: length, centre_m: [0.01, -0.02, 0.03] };
    let (points, viscosity) = (surface_points(&head, points), 1.3);
    let surface = RigidSurface::new(&points, viscosity).expect("regular");
    let mut matrix = surface.rigid_resistance(V3::new(0.01, -0.02, 0.03));
    let units = [6.0 * PI * viscosity * radius, 8.0 * PI * viscosity * radius.powi(3)];
    for row in 0..6 {
        for column in 0..6 {
            matrix[(row, column)] /= (units[row / 3] * units[column / 3]).sqrt();
        }
    }
    matrix
}

/// Translation across and along the axis, rotation about axes across it and about it, over `want`; less 1, the largest.
fn error(matrix: &Matrix6<f64>, want: [f64; 4]) -> f64 {
    let diagonal = matrix.diagonal();
    let places = [(0, 0), (1, 0), (2, 1), (3, 2), (4, 2), (5, 3)];
    places.iter().map(|&(row, k)| (diagonal[row] / want[k] - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn sphere_has_the_resistance_of_stokes() {
    for points in [POINTS, 80, 160, 320] {
        let matrix = resistance(HeadShape::Sphere, 0.0135, 1.0, points);
        prove(
            &format!("sphere of {points} points: 6 pi mu a and 8 pi mu a^3, relative"),
            error(&matrix, [1.0; 4]),
            0.01,
        );
        let cross = (matrix - Matrix6::from_diagonal(&matrix.diagonal())).amax();
        prove(&format!("sphere of {points} points: off the diagonal, relative"), cross, 0.01);
    }
    let [coarse, fine] = [POINTS, 640].map(|points| error(&resistance(HeadShape::Sphere, 0.02, 1.0, points), [1.0; 4]));
    prove("sphere: error of 640 points over that of the head's", fine / coarse, 0.6);
}

/// Resistances of a spheroid with half axes `a` across and `c` along the axis of revolution over those of a sphere of radius
/// `a`: Kim and Karrila 1991, table 3.4 (prolate) and 3.6 (oblate).
fn spheroid(a: f64, c: f64) -> [f64; 4] {
    let (long, short) = (a.max(c), a.min(c));
    let e = (1.0 - (short / long).powi(2)).sqrt();
    let units = [long / a, long / a, (long / a).powi(3), (long / a).powi(3)];
    let functions = if c > a {
        let l = ((1.0 + e) / (1.0 - e)).ln();
        let along = 8.0 / 3.0 * e.powi(3) / (-2.0 * e + (1.0 + e * e) * l);
        let across = 16.0 / 3.0 * e.powi(3) / (2.0 * e + (3.0 * e * e - 1.0) * l);
        let about = 4.0 / 3.0 * e.powi(3) * (1.0 - e * e) / (2.0 * e - (1.0 - e * e) * l);
        let tumbling = 4.0 / 3.0 * e.powi(3) * (2.0 - e * e) / (-2.0 * e + (1.0 + e * e) * l);
        [across, along, tumbling, about]
    } else {
        let root = (1.0 - e * e).sqrt();
        let cotangent = (e / root).atan();
        let along = 4.0 / 3.0 * e.powi(3) / ((2.0 * e * e - 1.0) * cotangent + e * root);
        let across = 8.0 / 3.0 * e.powi(3) / ((2.0 * e * e + 1.0) * cotangent - e * root);
        let about = 2.0 / 3.0 * e.powi(3) / (cotangent - e * root);
        let tumbling = 2.0 / 3.0 * e.powi(3) * (2.0 - e * e) / (e * root - (1.0 - 2.0 * e * e) * cotangent);
        [across, along, tumbling, about]
    };
    [0, 1, 2, 3].map(|k| functions[k] * units[k])
}

#[test]
fn spheroids_have_their_closed_forms() {
    for ratio in [0.5, 0.8, 1.25, 2.0, 3.0, 4.0] {
        let a = 0.0135;
        let matrix = resistance(HeadShape::Spheroid, a, 2.0 * a * ratio, POINTS);
        prove(
            &format!("spheroid, {ratio} times as long as wide: closed forms, relative"),
            error(&matrix, spheroid(a, ratio * a)),
            0.02,
        );
    }
}

#[test]
fn cylinders_agree_with_finer_resolutions() {
    // The head of the built-in robot, a flat one and a slender one.
    for (radius, length, bound) in [(0.0135, 0.0285, 0.02), (0.0135, 0.0135, 0.05), (0.01, 0.06, 0.05)] {
        let fine = resistance(HeadShape::Cylinder, radius, length, 500).diagonal();
        let want = [fine[0], fine[2], fine[3], fine[5]];
        for points in [POINTS, 100, 200] {
            let matrix = resistance(HeadShape::Cylinder, radius, length, points);
            let check =
                format!("cylinder of radius {radius}, length {length} m, {points} points against 500, relative");
            prove(&check, error(&matrix, want), bound);
        }
    }
}
