//! Statics of rods against analytic theory, with the error falling as the square of the edge length.

use crate::common::prove;
use nalgebra::{DMatrix, DVector};
use sim::V3;
use sim::rod::helix::{Handedness, Helix};
use sim::rod::{Rod, Stiffness, band::Band, frames::Frames, frames::ReferenceFrames};
use std::f64::consts::{PI, TAU};

const RADIUS: f64 = 0.003;
const YOUNG: f64 = 1.255e6;

fn stiffness() -> Stiffness {
    Stiffness::solid_round(RADIUS, YOUNG, 0.5)
}

/// A rod in equilibrium with dead loads.
struct Statics {
    rod: Rod,
    nodes: Vec<V3>,
    angles: Vec<f64>,
    reference: ReferenceFrames,
    frames: Frames,
    /// Slots that may move.
    free: Vec<usize>,
    /// Generalised loads, one a slot.
    load: Vec<f64>,
}

impl Statics {
    /// Clamped at its first two nodes and first angle.
    fn clamped(rod: Rod) -> Self {
        let n = rod.nodes();
        let free = (7..4 * n - 1).collect();
        let (nodes, reference) = (rod.shape.clone(), rod.rest_frames.clone());
        Self { nodes, angles: vec![0.0; n - 1], reference, frames: Frames::new(n), free, load: vec![0.0; 4 * n], rod }
    }

    fn update(&mut self) {
        self.frames.update(&self.reference, &self.nodes, &self.angles);
    }

    /// The Hessian on the free slots.
    fn hessian(&self) -> DMatrix<f64> {
        let mut band = Band::new(4 * self.rod.nodes());
        self.rod.hessian(&self.frames, &self.angles, &mut band);
        DMatrix::from_fn(self.free.len(), self.free.len(), |a, b| band.get(self.free[a], self.free[b]))
    }

    /// Newton's method with limited steps.
    fn solve(&mut self) {
        for _ in 0..400 {
            self.update();
            let mut gradient = vec![0.0; 4 * self.rod.nodes()];
            self.rod.gradient(&mut self.frames, &self.angles, &mut gradient);
            let right = DVector::from_iterator(self.free.len(), self.free.iter().map(|&s| self.load[s] - gradient[s]));
            let step = self.hessian().lu().solve(&right).expect("a regular system");
            let largest = (self.free.iter().zip(step.iter()))
                .map(|(s, d)| if s % 4 == 3 { 0.01 * d.abs() } else { d.abs() })
                .fold(0.0, f64::max);
            let share = (0.004 / largest).min(1.0);
            for (&slot, d) in self.free.iter().zip(step.iter()) {
                if slot % 4 == 3 {
                    self.angles[slot / 4] += share * d
                } else {
                    self.nodes[slot / 4][slot % 4] += share * d
                }
            }
            self.update();
            self.frames.accept(&mut self.reference);
            if largest < 1e-11 {
                return;
            }
        }
        panic!("no equilibrium");
    }

    fn energy(&self) -> f64 {
        self.rod.energy(&self.frames, &self.angles)
    }
}

fn straight(edges: usize, length: f64) -> Rod {
    let nodes = (0..=edges).map(|i| V3::new(0.0, 0.0, -length * i as f64 / edges as f64)).collect();
    Rod::stress_free(nodes, stiffness()).clamped_at_foot()
}

#[test]
fn small_deflection_of_a_cantilever() {
    let (length, force) = (0.2, 1e-6);
    let mut errors = vec![];
    for edges in [40, 80, 160] {
        let mut statics = Statics::clamped(straight(edges, length));
        let tip = 4 * edges;
        statics.load[tip] = force;
        statics.solve();
        let theory = force * length.powi(3) / (3.0 * stiffness().bend_nm2);
        errors.push((statics.nodes[edges].x / theory - 1.0).abs());
    }
    prove("cantilever, small: tip deflection at 160 edges, relative", errors[2], 2e-4);
    prove("cantilever, small: error ratio on halving the edges, less 4", (errors[0] / errors[1] - 4.0).abs(), 0.5);
    prove("cantilever, small: error ratio on halving again, less 4", (errors[1] / errors[2] - 4.0).abs(), 0.5);
}

/// Large deflection of a cantilever under a dead tip load: the elastica, integrated by shooting.
fn elastica(load: f64) -> [f64; 2] {
    // theta'' = -load cos(theta), theta(0) = 0, theta'(1) = 0; arc length in units of the length.
    let shoot = |slope: f64| {
        let (mut theta, mut rate, mut x, mut y) = (0.0, slope, 0.0, 0.0);
        let steps = 4000;
        let h = 1.0 / steps as f64;
        for _ in 0..steps {
            let f = |t: f64, r: f64| [r, -load * t.cos(), t.sin(), t.cos()];
            let k1 = f(theta, rate);
            let k2 = f(theta + 0.5 * h * k1[0], rate + 0.5 * h * k1[1]);
            let k3 = f(theta + 0.5 * h * k2[0], rate + 0.5 * h * k2[1]);
            let k4 = f(theta + h * k3[0], rate + h * k3[1]);
            let mean = |i: usize| h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            (theta, rate, x, y) = (theta + mean(0), rate + mean(1), x + mean(2), y + mean(3));
        }
        (rate, x, y)
    };
    let (mut low, mut high) = (0.0, load);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if shoot(middle).0 > 0.0 { high = middle } else { low = middle }
    }
    let (_, x, y) = shoot(0.5 * (low + high));
    [x, y]
}

#[test]
fn large_deflection_of_a_cantilever() {
    let length = 0.2;
    let mut errors = vec![];
    for edges in [40, 80, 160] {
        // The elastica does not stretch: make the stretch stiff.
        let mut rod = straight(edges, length);
        rod.stiffness.stretch_n *= 1e3;
        let force = 4.0 * rod.stiffness.bend_nm2 / (length * length);
        let mut statics = Statics::clamped(rod);
        for part in 1..=4 {
            statics.load[4 * edges] = force * part as f64 / 4.0;
            statics.solve();
        }
        let [x, y] = elastica(4.0);
        let tip = statics.nodes[edges];
        errors.push(((tip.x / length - x).hypot(-tip.z / length - y)).abs());
    }
    prove("elastica, load 4 EI/l2: tip at 160 edges, over the length", errors[2], 2e-4);
    prove("elastica: error ratio on halving the edges, less 4", (errors[0] / errors[1] - 4.0).abs(), 1.0);
}

/// Smallest eigenvalue of the Hessian on the free slots, with angles and positions made comparable.
fn stability(statics: &Statics) -> f64 {
    let mut hessian = statics.hessian();
    for (a, slot) in statics.free.iter().enumerate() {
        let scale = if slot % 4 == 3 { 1.0 } else { 0.05 };
        hessian.row_mut(a).scale_mut(scale);
        hessian.column_mut(a).scale_mut(scale);
    }
    hessian.symmetric_eigenvalues().min()
}

/// Value between `low` (stable) and `high` (unstable) where `stable` changes.
fn threshold(mut low: f64, mut high: f64, mut stable: impl FnMut(f64) -> bool) -> f64 {
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if stable(middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[test]
fn euler_buckling_load() {
    let length = 0.2;
    let mut errors = vec![];
    for edges in [20, 40, 80] {
        let mut rod = straight(edges, length);
        rod.stiffness.stretch_n *= 1e3;
        let theory = PI * PI * rod.stiffness.bend_nm2 / (4.0 * length * length);
        let critical = threshold(0.5 * theory, 1.5 * theory, |load| {
            let mut statics = Statics::clamped(rod.clone());
            statics.load[4 * edges + 2] = load;
            // The straight state, shortened by the load.
            let strain = load / rod.stiffness.stretch_n;
            for i in 2..=edges {
                statics.nodes[i].z += strain * (i - 1) as f64 * length / edges as f64;
            }
            statics.update();
            stability(&statics) > 0.0
        });
        errors.push((critical / theory - 1.0).abs());
    }
    prove("Euler buckling load at 80 edges, relative", errors[2], 2e-3);
    prove("Euler buckling load: error ratio on halving the edges, less 4", (errors[1] / errors[2] - 4.0).abs(), 0.6);
}

#[test]
fn twist_instability_of_a_ring() {
    // A naturally straight isotropic rod bent into a ring loses stability at a twist of
    // 2 pi sqrt(3) EI/GJ (Michell 1889, Zajac 1962, Goriely 2006).
    let mut errors = vec![];
    for edges in [32, 64] {
        let circumference = 0.3;
        let radius = circumference / TAU;
        // One edge more than the ring: the last lies on the first, and both ends are clamped.
        let nodes = (0..=edges + 1).map(|i| V3::new(0.0, 0.0, -circumference * i as f64 / edges as f64)).collect();
        let mut rod = Rod::stress_free(nodes, stiffness());
        rod.stiffness.stretch_n *= 1e2;
        let chord = 2.0 * radius * (PI / edges as f64).sin();
        for length in rod.rest_length.iter_mut().chain(&mut rod.voronoi_length) {
            *length *= chord * edges as f64 / circumference;
        }
        let theory = TAU * 3f64.sqrt() * rod.stiffness.bend_nm2 / rod.stiffness.twist_nm2;
        let stable_at = |twist: f64| {
            let mut statics = Statics::clamped(rod.clone());
            statics.free.retain(|slot| *slot < 4 * edges && *slot != 4 * edges + 3);
            let ring: Vec<V3> = (0..=edges + 1)
                .map(|i| {
                    let a = TAU * i as f64 / edges as f64;
                    V3::new(radius * a.cos(), radius * a.sin(), 0.0)
                })
                .collect();
            statics.reference = ReferenceFrames::transported_along(&ring);
            statics.nodes = ring;
            statics.angles = (0..=edges).map(|e| twist * e as f64 / edges as f64).collect();
            statics.update();
            // The whole ring may turn about its clamped edge at no cost: one eigenvalue is zero to rounding.
            stability(&statics) > -1e-10
        };
        let critical = threshold(0.5 * theory, 1.5 * theory, stable_at);
        errors.push((critical / theory - 1.0).abs());
    }
    prove("ring's twist instability (Michell) at 64 edges, relative", errors[1], 1e-2);
    prove(
        "ring's twist instability: error ratio on halving the edges, less 4",
        (errors[0] / errors[1] - 4.0).abs(),
        1.0,
    );
}

#[test]
fn axial_spring_rate_of_a_helix() {
    // A force along the axis of a helix and the couple that puts it there: the same moment R F at every
    // section, R F cos(alpha) of it twisting and R F sin(alpha) bending the rod (Love 1927, art. 271;
    // Wahl's spring formula is the limit of a small helix angle alpha). Compliance = 2 energy/force^2.
    let mut errors = vec![];
    for edges in [98, 196] {
        let helix = Helix { radius: 0.00889, pitch: 0.076, axial_length: 0.1962, handedness: Handedness::Right };
        let mut rod = Rod::stress_free(helix.nodes(edges), stiffness()).clamped_at_foot();
        rod.stiffness.stretch_n *= 1e3;
        let force = 1e-7;
        let tip = rod.shape[edges];
        let edge = tip - rod.shape[edges - 1];
        let tangent = edge.normalize();
        // Moment about the tip of a force at the axis.
        let couple = V3::new(-tip.x, -tip.y, 0.0).cross(&V3::new(0.0, 0.0, force));
        let twisting = couple.dot(&tangent);
        let pair = (couple - tangent * twisting).cross(&edge) / edge.norm_squared();
        // The couple is put on the last edge, that is in its middle.
        let strained = helix.contour_length() * (1.0 - 0.5 / edges as f64);
        let alpha = helix.pitch.atan2(TAU * helix.radius);
        let (gj, ei) = (rod.stiffness.twist_nm2, rod.stiffness.bend_nm2);
        let theory = strained * helix.radius.powi(2) * (alpha.cos().powi(2) / gj + alpha.sin().powi(2) / ei);
        let mut statics = Statics::clamped(rod);
        for a in 0..3 {
            statics.load[4 * edges + a] += pair[a] + if a == 2 { force } else { 0.0 };
            statics.load[4 * (edges - 1) + a] -= pair[a];
        }
        statics.load[4 * (edges - 1) + 3] += twisting;
        statics.solve();
        errors.push((2.0 * statics.energy() / (force * force) / theory - 1.0).abs());
    }
    prove("helix: axial spring rate (Love) at 196 edges, relative", errors[1], 1e-2);
    prove(
        "helix: axial spring rate: error ratio on halving the edges, less 4",
        (errors[0] / errors[1] - 4.0).abs(),
        0.6,
    );
}
