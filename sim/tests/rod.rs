//! The rod's energies against finite differences and at rest.
#![allow(clippy::needless_range_loop)]

use crate::common::{noise, prove};
use sim::V3;
use sim::rod::{
    Rod, Stiffness,
    band::Band,
    frames::Frames,
    helix::{Handedness, Helix},
};

fn helix_rod(edges: usize) -> Rod {
    let helix =
        Helix { radius: 0.00889, pitch: 0.076, axial_length: 0.0044 * edges as f64, handedness: Handedness::Right };
    Rod::stress_free(helix.nodes(edges), Stiffness::solid_round(0.003, 1.255e6, 0.5))
}

/// Slots of positions are scaled by a length of 1 cm, so that forces and couples compare.
fn scale(slot: usize) -> f64 {
    if slot % 4 == 3 { 1.0 } else { 1e-2 }
}

#[test]
fn helix_at_rest_has_no_force() {
    let rod = helix_rod(49);
    let mut frames = Frames::new(rod.nodes());
    let angles = vec![0.0; rod.edges()];
    frames.update(&rod.rest_frames, &rod.shape, &angles);
    let mut gradient = vec![0.0; 4 * rod.nodes()];
    rod.gradient(&mut frames, &angles, &mut gradient);
    let largest = gradient.iter().fold(0f64, |a, g| a.max(g.abs()));
    prove("helix at rest: largest force, N or N m", largest, 1e-12);
}

#[test]
fn gradient_and_hessian_match_finite_differences() {
    let whole = helix_rod(11);
    let n = whole.nodes();
    let Stiffness { stretch_n, bend_nm2, twist_nm2 } = whole.stiffness;
    let alone = Stiffness { stretch_n: 0.0, bend_nm2: 0.0, twist_nm2: 0.0 };
    let energies = [
        ("stretch", Stiffness { stretch_n, ..alone }),
        ("bend", Stiffness { bend_nm2, ..alone }),
        ("twist", Stiffness { twist_nm2, ..alone }),
        ("elastic", whole.stiffness),
    ];
    for (trial, (name, stiffness)) in (0u64..).zip(energies.into_iter().cycle().take(12)) {
        let rod = Rod::stress_free(whole.shape.clone(), stiffness);
        let mut seed = 88172645463325252 + 7919 * trial;
        let nodes: Vec<V3> = rod.shape.iter().map(|x| x + V3::from_fn(|_, _| 2e-3 * noise(&mut seed))).collect();
        let angles: Vec<f64> = (0..n - 1).map(|_| 0.8 * noise(&mut seed)).collect();
        // Frames accepted at the trial shape: the energy is smooth about it.
        let mut reference = rod.rest_frames.clone();
        let mut frames = Frames::new(n);
        frames.update(&reference, &nodes, &angles);
        frames.accept(&mut reference);
        let at = |nodes: &[V3], angles: &[f64]| {
            let mut frames = Frames::new(n);
            frames.update(&reference, nodes, angles);
            let mut g = vec![0.0; 4 * n];
            rod.gradient(&mut frames, angles, &mut g);
            (rod.energy(&frames, angles), g)
        };
        let (_, gradient) = at(&nodes, &angles);
        let mut hessian = Band::new(4 * n);
        rod.hessian(&frames, &angles, &mut hessian);
        let slots = 4 * n - 1;
        let mut differences = vec![vec![0.0; slots]; slots];
        let (mut worst_g, mut largest_g) = (0f64, 0f64);
        for q in 0..slots {
            let step = if q % 4 == 3 { 1e-5 } else { 1e-7 };
            let moved = |sign: f64| {
                let (mut x, mut a) = (nodes.clone(), angles.clone());
                if q % 4 == 3 {
                    a[q / 4] += sign * step
                } else {
                    x[q / 4][q % 4] += sign * step
                }
                at(&x, &a)
            };
            let ((ep, gp), (em, gm)) = (moved(1.0), moved(-1.0));
            worst_g = worst_g.max(((ep - em) / (2.0 * step) - gradient[q]).abs() * scale(q));
            largest_g = largest_g.max(gradient[q].abs() * scale(q));
            for p in 0..slots {
                differences[p][q] = (gp[p] - gm[p]) / (2.0 * step);
            }
        }
        let (mut worst_h, mut largest_h) = (0f64, 0f64);
        for p in 0..slots {
            for q in 0..slots {
                let symmetric = 0.5 * (differences[p][q] + differences[q][p]);
                let weight = scale(p) * scale(q);
                worst_h = worst_h.max((symmetric - hessian.get(p, q)).abs() * weight);
                largest_h = largest_h.max(hessian.get(p, q).abs() * weight);
            }
        }
        prove(&format!("{name} forces against finite differences, relative"), worst_g / largest_g, 1e-6);
        prove(&format!("{name} Hessian against finite differences, relative"), worst_h / largest_h, 1e-6);
    }
}
