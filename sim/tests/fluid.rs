//! The fluid: segments against quadrature, the fast product against the dense matrix, forces against
//! another program's solves and against theory.

use crate::common::{prove, static_solve};
use nalgebra::{DMatrix, DVector, Matrix3};
use sim::V3;
use sim::fluid::{
    far::{Sources, Targets, gauss_rule},
    mobility::{mobility, rigid_resistance},
    near::NearBand,
    segment::segment_flow,
    stokeslet_factor,
};
use sim::params::Precision;
use sim::rod::helix::{Handedness, Helix};
use std::f64::consts::{PI, TAU};

const EPSILON: f64 = 3.09e-3;

fn helix(edges: usize) -> Vec<V3> {
    Helix { radius: 0.00889, pitch: 0.076, axial_length: 0.1962, handedness: Handedness::Right }.nodes(edges)
}

/// Adaptive Simpson quadrature of the regularised Stokeslet times the two hat functions.
fn adaptive(x: V3, y0: V3, y1: V3, epsilon: f64) -> [Matrix3<f64>; 2] {
    type Pair = [Matrix3<f64>; 2];
    let at = |a: f64| -> Pair {
        let r = x - (y0 + (y1 - y0) * a);
        let r2 = r.norm_squared();
        let big = (r2 + epsilon * epsilon).sqrt();
        let kernel = (Matrix3::identity() * (r2 + 2.0 * epsilon * epsilon) + r * r.transpose()) / big.powi(3);
        [kernel * (1.0 - a), kernel * a]
    };
    let simpson =
        |h: f64, f0: &Pair, fm: &Pair, f1: &Pair| -> Pair { [0, 1].map(|k| (f0[k] + fm[k] * 4.0 + f1[k]) * (h / 6.0)) };
    #[allow(clippy::too_many_arguments)]
    fn refine(
        at: &dyn Fn(f64) -> [Matrix3<f64>; 2],
        simpson: &dyn Fn(f64, &Pair2, &Pair2, &Pair2) -> Pair2,
        a: f64,
        b: f64,
        fa: Pair2,
        fm: Pair2,
        fb: Pair2,
        whole: Pair2,
        tolerance: f64,
        depth: usize,
    ) -> Pair2 {
        let m = 0.5 * (a + b);
        let (fl, fr) = (at(0.5 * (a + m)), at(0.5 * (m + b)));
        let (left, right) = (simpson(m - a, &fa, &fl, &fm), simpson(b - m, &fm, &fr, &fb));
        let change = [0, 1].map(|k| left[k] + right[k] - whole[k]);
        let error = change[0].amax().max(change[1].amax());
        if depth == 0 || error < 15.0 * tolerance {
            return [0, 1].map(|k| left[k] + right[k] + change[k] / 15.0);
        }
        let l = refine(at, simpson, a, m, fa, fl, fm, left, 0.5 * tolerance, depth - 1);
        let r = refine(at, simpson, m, b, fm, fr, fb, right, 0.5 * tolerance, depth - 1);
        [0, 1].map(|k| l[k] + r[k])
    }
    type Pair2 = [Matrix3<f64>; 2];
    let (f0, fm, f1) = (at(0.0), at(0.5), at(1.0));
    let whole = simpson(1.0, &f0, &fm, &f1);
    let scale = f0[0].amax().max(fm[0].amax()).max(f1[1].amax());
    let length = (y1 - y0).norm();
    refine(&at, &simpson, 0.0, 1.0, f0, fm, f1, whole, 1e-13 * scale, 40).map(|m| m * length)
}

#[test]
fn segments_match_adaptive_quadrature() {
    let mut worst = 0f64;
    for length in [5e-3, 1.25e-3, 1e-2] {
        for distance in [0.0, 1e-4, 2e-3, 5e-3, 2e-2, 2.6e-2, 0.1, 0.5] {
            for direction in [V3::new(0.36, -0.48, 0.8), V3::new(0.6, 0.64, 0.48), V3::new(-0.6, -0.64, -0.48)] {
                for start in [0.0, 0.5, 1.0] {
                    let y0 = V3::new(0.01, 0.02, -0.01);
                    let y1 = y0 + V3::new(0.6, 0.64, 0.48) * length;
                    let x = y0 + (y1 - y0) * start + direction * distance;
                    let (exact, reference) = (segment_flow(x, y0, y1, EPSILON), adaptive(x, y0, y1, EPSILON));
                    for k in 0..2 {
                        worst = worst.max((exact[k] - reference[k]).amax() / reference[k].amax());
                    }
                }
            }
        }
    }
    prove("segment integrals against adaptive quadrature, relative", worst, 1e-10);
}

#[test]
fn fast_product_matches_the_dense_matrix() {
    let nodes = helix(49);
    let density: Vec<V3> = (0..50).map(|i| V3::new(1.0, (0.1 * i as f64).sin(), 0.5)).collect();
    let exact =
        mobility(&[&nodes], EPSILON, 1.0) * DVector::from_iterator(150, density.iter().flat_map(|f| [f.x, f.y, f.z]));
    for (reach, points, bound) in [(2, 2, 5e-5), (3, 3, 2e-6)] {
        let mut near = NearBand::new(50, reach, points);
        near.assemble(&nodes, EPSILON, 1.0);
        near.multiply(&density);
        let (mut sources, mut targets) = (Sources::default(), Targets::new(50, Precision::Single));
        sources.push_edges(0..49, gauss_rule(points), |i| nodes[i], |i| density[i]);
        targets.set(&nodes);
        targets.add_flow(&sources, EPSILON);
        let worst = (0..50)
            .map(|i| {
                let fast = near.flow(i) + targets.flow(i) * stokeslet_factor(1.0);
                (fast - V3::new(exact[3 * i], exact[3 * i + 1], exact[3 * i + 2])).norm()
            })
            .fold(0.0, f64::max);
        let check = format!("fast product, {reach} edges exact, {points} Gauss points, against dense");
        prove(&check, worst / exact.amax(), bound);
    }
}

#[test]
fn nodal_force_densities_match_another_program() {
    for name in ["rss_straight_pair.csv", "rss_helix_pair.csv", "rss_bent_pair.csv"] {
        let (lines, velocity, force) = static_solve(name);
        let views: Vec<&[V3]> = lines.iter().map(Vec::as_slice).collect();
        let matrix = mobility(&views, 3.06e-3, 1.0);
        let u = DVector::from_iterator(3 * velocity.len(), velocity.iter().flat_map(|u| [u.x, u.y, u.z]));
        let density = matrix.lu().solve(&u).expect("regular");
        let largest = force.iter().fold(0f64, |a, f| a.max(f.amax()));
        let worst = force
            .iter()
            .enumerate()
            .flat_map(|(i, f)| (0..3).map(move |a| (i, a, f[a])))
            .map(|(i, a, f)| (density[3 * i + a] + f).abs() / largest)
            .fold(0.0, f64::max);
        prove(&format!("{name}: nodal force densities, over the largest"), worst, 1e-8);
    }
}

/// Radius of the round rod whose far flow a regularised centre line has.
///
/// The mean flow of a long line of these Stokeslets on itself is f/(4 pi mu) (2 ln(l/eps)) along and
/// f/(4 pi mu) (ln(l/eps) + 1) across, that of a round rod of radius a (Keller and Rubinow 1976)
/// f/(4 pi mu) (2 ln(l/a) - 1) and f/(4 pi mu) (ln(l/a) + 1/2): equal for a = eps/sqrt(e).
fn equivalent_radius(epsilon: f64) -> f64 {
    epsilon * (-0.5f64).exp()
}

#[test]
fn straight_rod_drag_matches_slender_body_theory() {
    // Batchelor 1970: 2 pi mu U l/(ln(l/a) - 0.807) along, 4 pi mu U l/(ln(l/a) + 0.193) across.
    let (length, epsilon) = (0.4, 0.002);
    let line: Vec<V3> = (0..=160).map(|i| V3::new(0.0, 0.0, -length * i as f64 / 160.0)).collect();
    let drag = rigid_resistance(&[&line], line[80], epsilon, 1.0, 0.0).expect("regular");
    let log = (length / equivalent_radius(epsilon)).ln();
    let along = 2.0 * PI * length / (log - 0.807);
    let across = 4.0 * PI * length / (log + 0.193);
    prove("straight rod: drag along against slender-body theory", (drag[(2, 2)] / along - 1.0).abs(), 0.03);
    prove("straight rod: drag across against slender-body theory", (drag[(0, 0)] / across - 1.0).abs(), 0.03);
}

/// Force along z and torque about it on a helix that moves so at each of its points, by Lighthill's slender-body theory
/// (1976): u = (I - t t').f/(4 pi mu) + Stokeslets of f farther than a sqrt(e)/2.
pub fn lighthill(helix: &Helix, radius: f64, edges: usize, motion: impl Fn(&V3) -> V3) -> (f64, f64) {
    let nodes = helix.nodes(edges);
    let middle: Vec<V3> = nodes.windows(2).map(|p| (p[0] + p[1]) * 0.5).collect();
    let tangent: Vec<V3> = nodes.windows(2).map(|p| (p[1] - p[0]).normalize()).collect();
    let length = (nodes[1] - nodes[0]).norm();
    let cutoff = 0.5 * radius * 0.5f64.exp();
    let mut matrix = DMatrix::zeros(3 * edges, 3 * edges);
    for i in 0..edges {
        for j in 0..edges {
            let block = if i == j {
                // The local term, and the integral of 1/r from the cut-off less the neighbours' sum:
                // the harmonic numbers differ from the logarithm by Euler's constant.
                let log = (length / cutoff).ln() - 0.577_215_664_901_532_9;
                let tt = tangent[i] * tangent[i].transpose();
                (Matrix3::identity() - tt) * 2.0 + (Matrix3::identity() + tt) * (2.0 * log)
            } else {
                let r = middle[i] - middle[j];
                let d = r.norm();
                (Matrix3::identity() / d + r * r.transpose() / d.powi(3)) * length
            };
            matrix.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&(block * stokeslet_factor(1.0)));
        }
    }
    let velocity = DVector::from_iterator(
        3 * edges,
        middle.iter().flat_map(|x| {
            let u = motion(x);
            [u.x, u.y, u.z]
        }),
    );
    let f = matrix.lu().solve(&velocity).expect("regular");
    let (mut force, mut torque) = (0.0, 0.0);
    for (i, x) in middle.iter().enumerate() {
        force -= f[3 * i + 2] * length;
        torque -= (x.x * f[3 * i + 1] - x.y * f[3 * i]) * length;
    }
    (force, torque)
}

#[test]
fn helix_thrust_torque_and_drag_match_slender_body_theory() {
    let shape = Helix { radius: 0.00889, pitch: 0.076, axial_length: 0.1962, handedness: Handedness::Right };
    let epsilon = 0.002;
    let nodes = shape.nodes(196);
    let resistance = rigid_resistance(&[&nodes], V3::zeros(), epsilon, 1.0, 0.0).expect("regular");
    let (thrust, torque, drag) = (-resistance[(2, 5)], -resistance[(5, 5)], -resistance[(2, 2)]);
    let radius = equivalent_radius(epsilon);
    let (thrust_theory, torque_theory) = lighthill(&shape, radius, 400, |x| V3::z().cross(x));
    let (drag_theory, _) = lighthill(&shape, radius, 400, |_| V3::z());
    assert!(thrust > 0.0, "a right-handed helix turned counter-clockwise from above pushes up");
    prove("helix thrust against slender-body theory", (thrust / thrust_theory - 1.0).abs(), 0.03);
    prove("helix torque against slender-body theory", (torque / torque_theory - 1.0).abs(), 0.03);
    prove("helix drag along its axis against slender-body theory", (drag / drag_theory - 1.0).abs(), 0.03);
    // Resistive force theory (Gray and Hancock 1955) leaves out the flow between turns: a bound only.
    let angle = (TAU * shape.radius).atan2(shape.pitch);
    let log = (2.0 * shape.pitch / equivalent_radius(epsilon)).ln();
    let (kt, kn) = (2.0 * PI / (log - 0.5), 4.0 * PI / (log + 0.5));
    let resistive = (kn - kt) * angle.sin() * angle.cos() * shape.radius * shape.contour_length();
    prove("helix thrust against resistive force theory (bound only)", (thrust / resistive - 1.0).abs(), 0.6);
}
