//! Pairs of close edges, and the warm start of a step from the pairs of the step before.
//!
//! Body frame, m. [`super::broad_phase`] finds the pairs.

use super::distance::segment_distance;
use crate::V3;
use serde::{Deserialize, Serialize};

/// Two edges that are close, and the force between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// Rod of the first and of the second edge.
    pub rods: [usize; 2],
    /// The edges.
    pub edges: [usize; 2],
    /// Positions of the closest points on the edges, 0 to 1.
    pub at: [f64; 2],
    /// Unit normal from the second to the first, body frame. It keeps its side, so edges that a prediction moved
    /// through each other are pushed back.
    pub normal: V3,
    /// Distance of the centre lines along the normal, m; negative when the edges have passed each other.
    pub distance: f64,
    /// Contact force lambda along the normal on the first edge, N.
    pub force: f64,
    /// Friction on the first edge, body frame, N.
    pub friction: V3,
}

/// Nodes of both rods in the body frame.
pub type Lines = [Vec<V3>; 2];

/// Below this distance, m, the direction between centre lines is undefined.
const COINCIDENT: f64 = 1e-12;
/// Cosine of a change of direction, about 100 degrees, beyond which a normal has changed its side. A change near 90
/// degrees is a contact that slides over the end of an edge.
const FLIPPED: f64 = -0.2;
/// A force goes to a new pair at most this many edges away: contact slides less in a step.
const SLIDE_EDGES: f64 = 3.0;
/// Only pairs within this many contact distances show on which side the rods are.
const SIDE_DISTANCES: f64 = 1.5;
/// Pairs fewer edges apart than this, on both rods together, have the same side.
const SIDE_EDGES: usize = 3;
/// Closest points nearer than this many rod radii at the moment of coplanarity have passed through each other.
const PASSED_RADII: f64 = 0.5;

impl Pair {
    pub(super) fn new(lines: &Lines, rods: [usize; 2], edges: [usize; 2]) -> Self {
        let mut pair =
            Self { rods, edges, at: [0.5; 2], normal: V3::zeros(), distance: 0.0, force: 0.0, friction: V3::zeros() };
        pair.refresh(lines);
        pair
    }

    fn ends(&self, lines: &Lines, side: usize) -> [V3; 2] {
        let (line, e) = (&lines[self.rods[side]], self.edges[side]);
        [line[e], line[e + 1]]
    }

    /// Updates closest points, normal and distance at the present shapes; the normal keeps its side.
    pub fn refresh(&mut self, lines: &Lines) {
        let ([p0, p1], [q0, q1]) = (self.ends(lines, 0), self.ends(lines, 1));
        let closest = segment_distance(p0, p1, q0, q1);
        let distance = closest.separation.norm();
        let normal = if distance > COINCIDENT { closest.separation / distance } else { self.normal };
        let flipped = normal.dot(&self.normal) < FLIPPED;
        self.at = [closest.s, closest.t];
        self.normal = if flipped { -normal } else { normal };
        self.distance = if flipped { -distance } else { distance };
    }

    /// Updates the distance with the normal and the closest points held.
    pub fn refresh_held(&mut self, lines: &Lines) {
        self.distance = self.normal.dot(&(self.point(lines, 0) - self.point(lines, 1)));
    }

    /// Returns the closest point on the first or second edge, m.
    pub fn point(&self, lines: &Lines, side: usize) -> V3 {
        let [a, b] = self.ends(lines, side);
        a + (b - a) * self.at[side]
    }

    /// Returns the distance at the present shapes between the present closest points, m.
    pub fn true_distance(&self, lines: &Lines) -> f64 {
        let ([p0, p1], [q0, q1]) = (self.ends(lines, 0), self.ends(lines, 1));
        let closest = segment_distance(p0, p1, q0, q1);
        let distance = closest.separation.norm();
        if closest.separation.dot(&self.normal) < FLIPPED * distance { -distance } else { distance }
    }

    /// Returns the couple of the friction on either edge about its own centre line, body frame, N m.
    ///
    /// Friction acts half way between the centre lines, with the arm -n D/2 from the first and n D/2 from the second,
    /// so the pair's forces and moments sum to zero.
    pub fn couple(&self) -> V3 {
        self.normal.cross(&self.friction) * (-0.5 * self.distance)
    }

    /// Returns the four nodes of the pair as (rod, node, weight): the nodes' shares of a unit force on the pair,
    /// positive on the first edge.
    pub fn weights(&self) -> [(usize, usize, f64); 4] {
        let ([a, b], [e, f], [s, t]) = (self.rods, self.edges, self.at);
        [(a, e, 1.0 - s), (a, e + 1, s), (b, f, t - 1.0), (b, f + 1, -t)]
    }
}

/// Returns the pairs of a new step with the forces of the old ones as their start.
///
/// A force goes to the nearest new pair, as contact slides along the edges. Normals keep their side. `edge`: length of an
/// edge, m; `contact_distance`: distance of the centre lines at which rods touch, m.
pub fn warm_start(old: &[Pair], mut new: Vec<Pair>, edge: f64, contact_distance: f64) -> Vec<Pair> {
    for pair in &mut new {
        align_normal(old, pair, contact_distance);
    }
    for before in old.iter().filter(|p| p.force > 0.0) {
        let position = |p: &Pair, side: usize| p.edges[side] as f64 + p.at[side];
        let nearest = (new.iter().enumerate())
            .filter(|(_, p)| p.rods == before.rods)
            .map(|(i, p)| {
                let slid = (0..2).map(|k| (position(p, k) - position(before, k)).abs()).sum::<f64>();
                (slid + (p.distance - contact_distance).max(0.0) / edge, i)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((distance, i)) = nearest
            && distance < SLIDE_EDGES
        {
            new[i].force += before.force;
            new[i].friction += before.friction;
        }
    }
    new
}

/// Adds pairs that have come close within a step. Returns how many of them overlap by more than `overlap` (m).
pub fn extend(pairs: &mut Vec<Pair>, new: Vec<Pair>, contact_distance: f64, overlap: f64) -> usize {
    let mut overlapping = 0;
    for mut pair in new {
        if pairs.iter().any(|p| p.rods == pair.rods && p.edges == pair.edges) {
            continue;
        }
        align_normal(pairs, &mut pair, contact_distance);
        overlapping += usize::from(pair.distance < contact_distance - overlap);
        pairs.push(pair);
    }
    overlapping
}

/// Flips the normal of a pair to the side of its nearest known neighbour, so that edges that passed each other are pushed
/// back.
fn align_normal(known: &[Pair], pair: &mut Pair, contact_distance: f64) {
    let nearest = (known.iter())
        .filter(|p| p.rods == pair.rods && p.distance.abs() < SIDE_DISTANCES * contact_distance)
        .map(|p| (p.edges[0].abs_diff(pair.edges[0]) + p.edges[1].abs_diff(pair.edges[1]), p))
        .filter(|(steps, _)| *steps < SIDE_EDGES)
        .min_by_key(|(steps, _)| *steps);
    if let Some((_, p)) = nearest
        && p.normal.dot(&pair.normal) < FLIPPED
    {
        pair.normal = -pair.normal;
        pair.distance = -pair.distance;
    }
}

/// Returns whether two edges went through each other between two shapes of the lines.
///
/// On the way they become coplanar while their closest points are within half a rod radius.
pub fn passed_through(before: &Lines, after: &Lines, pairs: &[Pair], radius: f64) -> bool {
    let volume = |lines: &Lines, p: &Pair| {
        let ([a, b], [c, d]) = (p.ends(lines, 0), p.ends(lines, 1));
        (b - a).cross(&(d - c)).dot(&(a - c))
    };
    pairs.iter().any(|p| {
        let (v0, v1) = (volume(before, p), volume(after, p));
        if v0 * v1 >= 0.0 {
            return false;
        }
        let share = v0 / (v0 - v1);
        let at = |side: usize, end: usize| {
            let (x, y) = (p.ends(before, side)[end], p.ends(after, side)[end]);
            x + (y - x) * share
        };
        let closest = segment_distance(at(0, 0), at(0, 1), at(1, 0), at(1, 1));
        closest.separation.norm() < PASSED_RADII * radius
    })
}
