//! All unknowns of a step in one vector, for the acceleration of the iteration.
//!
//! Edge lengths are separate entries in addition to the nodes: a combination of iterates acts on directions and lengths
//! separately.

use super::body::BodySolve;
use super::flagellum::Flagellum;
use super::model::Model;
use crate::V3;
use crate::contact::pairs::Pair;
use crate::functions::positive_part;
use crate::rod::CLAMPED;

/// Displacement equivalent to an edge's angle of one radian, in radii of the helix.
const TWIST_WEIGHT: f64 = 0.3;
/// Displacement equivalent to a change of the clamp's force density by 1 N/m: this times the step over the viscosity.
const DENSITY_WEIGHT: f64 = 0.1;
/// Distance from the joint at which the base's rate counts as a velocity, m: about the flagella's length.
const RATE_WEIGHT: f64 = 0.2;

/// Returns the unknowns: of each rod free nodes, edge lengths, angles and clamp densities; the base's rate; the pairs'
/// forces. SI.
pub fn pack(flagella: &[Flagellum; 2], body: &BodySolve, pairs: &[Pair]) -> Vec<f64> {
    let mut out = Vec::with_capacity(16 * flagella[0].shape.nodes.len());
    for flagellum in flagella {
        let shape = &flagellum.shape;
        out.extend(shape.nodes[CLAMPED..].iter().flat_map(|x| [x.x, x.y, x.z]));
        out.extend(shape.nodes[CLAMPED - 1..].windows(2).map(|p| (p[1] - p[0]).norm()));
        out.extend(&shape.angles[1..]);
        out.extend(shape.clamp_density.iter().flat_map(|f| [f.x, f.y, f.z]));
    }
    out.extend(body.body.rate.iter());
    out.extend(pairs.iter().map(|p| p.force));
    out
}

/// Returns weights that make the unknowns of a step of `length` s comparable, in m per unit. Forces follow from the
/// other unknowns and have weight zero.
pub fn weights(model: &Model, length: f64, pairs: usize) -> Vec<f64> {
    let mut out = Vec::new();
    let twist = TWIST_WEIGHT * model.radius();
    let density = DENSITY_WEIGHT * length / model.robot.fluid.viscosity();
    for rod in &model.rods {
        let free = rod.nodes() - CLAMPED;
        out.extend(std::iter::repeat_n(1.0, 4 * free));
        out.extend(std::iter::repeat_n(twist, free));
        out.extend(std::iter::repeat_n(density, 3 * CLAMPED));
    }
    out.extend(std::iter::repeat_n(RATE_WEIGHT * length, 3));
    out.extend(std::iter::repeat_n(0.0, pairs));
    out
}

/// Sets the unknowns; the base's rate only if it is one.
pub fn unpack(values: &[f64], two_way: bool, flagella: &mut [Flagellum; 2], body: &mut BodySolve, pairs: &mut [Pair]) {
    let mut values = values.iter().copied();
    let mut next = || values.next().unwrap_or(0.0);
    for flagellum in flagella {
        let shape = &mut flagellum.shape;
        let nodes: Vec<V3> = shape.nodes[CLAMPED..].iter().map(|_| V3::new(next(), next(), next())).collect();
        let mut end = shape.nodes[CLAMPED - 1];
        let mut before = end;
        for (slot, node) in shape.nodes[CLAMPED..].iter_mut().zip(&nodes) {
            let edge = node - before;
            before = *node;
            end += edge * (next() / edge.norm());
            *slot = end;
        }
        shape.angles[1..].fill_with(&mut next);
        for density in &mut shape.clamp_density {
            *density = V3::new(next(), next(), next());
        }
    }
    let rate = V3::new(next(), next(), next());
    if two_way {
        body.set_rate(rate);
    }
    for pair in pairs {
        pair.force = positive_part(next());
    }
}
