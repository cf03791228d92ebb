//! Pairs of edges that are close, and a broad phase that finds them.
//!
//! Body frame, m. Pairs of the two rods, and of one rod with itself beyond the arc length within which
//! its own helix is closer than two radii.

use super::distance::segment_distance;
use crate::V3;
use crate::rod::Rod;
use pulp::{Simd, WithSimd};
use serde::{Deserialize, Serialize};

/// Two edges that are close, and the force between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// Rod of the first and of the second edge.
    pub rods: [usize; 2],
    /// The edges.
    pub edges: [usize; 2],
    /// Where on the edges the closest points are, 0 to 1.
    pub at: [f64; 2],
    /// Unit normal from the second to the first, body frame. It keeps its side, so a predictor that
    /// went through is pushed back.
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

impl Pair {
    fn new(lines: &Lines, rods: [usize; 2], edges: [usize; 2]) -> Self {
        let mut pair =
            Self { rods, edges, at: [0.5; 2], normal: V3::zeros(), distance: 0.0, force: 0.0, friction: V3::zeros() };
        pair.refresh(lines);
        pair
    }

    fn ends(&self, lines: &Lines, side: usize) -> [V3; 2] {
        let (line, e) = (&lines[self.rods[side]], self.edges[side]);
        [line[e], line[e + 1]]
    }

    /// Closest points and normal at the present shapes; the normal keeps its side.
    pub fn refresh(&mut self, lines: &Lines) {
        let ([p0, p1], [q0, q1]) = (self.ends(lines, 0), self.ends(lines, 1));
        let closest = segment_distance(p0, p1, q0, q1);
        let distance = closest.separation.norm();
        let normal = if distance > 1e-12 { closest.separation / distance } else { self.normal };
        let flipped = normal.dot(&self.normal) < -0.2;
        self.at = [closest.s, closest.t];
        self.normal = if flipped { -normal } else { normal };
        self.distance = if flipped { -distance } else { distance };
    }

    /// Distance along the frozen normal between the frozen points.
    pub fn refresh_frozen(&mut self, lines: &Lines) {
        self.distance = self.normal.dot(&(self.point(lines, 0) - self.point(lines, 1)));
    }

    /// The closest point of a side.
    pub fn point(&self, lines: &Lines, side: usize) -> V3 {
        let [a, b] = self.ends(lines, side);
        a + (b - a) * self.at[side]
    }

    /// Distance at the present shapes, with the closest points found anew.
    pub fn true_distance(&self, lines: &Lines) -> f64 {
        let ([p0, p1], [q0, q1]) = (self.ends(lines, 0), self.ends(lines, 1));
        let closest = segment_distance(p0, p1, q0, q1);
        let distance = closest.separation.norm();
        if closest.separation.dot(&self.normal) < -0.2 * distance { -distance } else { distance }
    }

    /// Nodes of the pair with their weights: (rod, node, weight), positive on the first edge.
    pub fn weights(&self) -> [(usize, usize, f64); 4] {
        let ([a, b], [e, f], [s, t]) = (self.rods, self.edges, self.at);
        [(a, e, 1.0 - s), (a, e + 1, s), (b, f, t - 1.0), (b, f + 1, -t)]
    }

    fn same_edges(&self, other: &Pair) -> bool {
        self.rods == other.rods && self.edges == other.edges
    }
}

/// Finds pairs and the least distance.
#[derive(Clone, Debug)]
pub struct BroadPhase {
    /// Edges of one rod closer than this in number are neighbours.
    exclusion: [usize; 2],
    middles: [[Vec<f64>; 3]; 2],
    longest: f64,
    /// How much farther than asked a search looks, m.
    skin: f64,
    searched: [Option<Searched>; 3],
}

/// What a search of a pair of rods left: as long as the rods have not moved far, no other edges are close.
#[derive(Clone, Debug)]
struct Searched {
    lines: Lines,
    /// All other edges were farther apart than this, m.
    apart: f64,
    candidates: Vec<[usize; 2]>,
}

/// The rods with each other and with themselves.
const ROD_PAIRS: [[usize; 2]; 3] = [[0, 1], [0, 0], [1, 1]];
const LANES: usize = 8;
/// Padding of the midpoint arrays lies this far away, m.
const AWAY: f64 = 1e6;

impl BroadPhase {
    /// For two rods of radius `radius` m.
    pub fn new(rods: &[Rod; 2], radius: f64) -> Self {
        let exclusion = [0, 1].map(|k| {
            let shape = &rods[k].shape;
            let edges = rods[k].edges();
            let smooth = (std::f64::consts::PI * radius / rods[k].rest_length[0]).ceil() as usize;
            let own = (1..edges)
                .filter(|gap| {
                    (0..edges - gap).any(|i| {
                        let j = i + gap;
                        let c = segment_distance(shape[i], shape[i + 1], shape[j], shape[j + 1]);
                        c.separation.norm() < 2.5 * radius
                    })
                })
                .max()
                .unwrap_or(0);
            smooth.max(own) + 1
        });
        let middles = [0, 1].map(|k| {
            let padded = rods[k].edges().div_ceil(LANES) * LANES;
            std::array::from_fn(|_| vec![AWAY; padded])
        });
        Self { exclusion, middles, longest: 0.0, skin: radius, searched: [None, None, None] }
    }

    fn load(&mut self, lines: &Lines) {
        self.longest = 0.0;
        for (line, middles) in lines.iter().zip(&mut self.middles) {
            for (e, pair) in line.windows(2).enumerate() {
                let middle = (pair[0] + pair[1]) * 0.5;
                self.longest = self.longest.max((pair[1] - pair[0]).norm_squared());
                for axis in 0..3 {
                    middles[axis][e] = middle[axis];
                }
            }
        }
        self.longest = self.longest.sqrt();
    }

    /// Pairs of edges whose distance is below `limit` (m), new and without forces.
    pub fn search(&mut self, lines: &Lines, limit: f64) -> Vec<Pair> {
        for (searched, rods) in self.searched.iter_mut().zip(ROD_PAIRS) {
            if searched.as_ref().is_some_and(|s| !s.holds(lines, rods, limit)) {
                *searched = None;
            }
        }
        if self.searched.iter().all(|s| s.as_ref().is_some_and(|s| s.candidates.is_empty())) {
            return Vec::new();
        }
        self.load(lines);
        let mut pairs = Vec::new();
        let reach = (limit + self.longest).powi(2);
        for (which, rods) in ROD_PAIRS.into_iter().enumerate() {
            let searched = self.searched[which].take().unwrap_or_else(|| self.collect(lines, rods, limit + self.skin));
            for &edges in &searched.candidates {
                let [a, b] = [0, 1].map(|k| self.middle(rods[k], edges[k]));
                if (a - b).norm_squared() < reach {
                    let pair = Pair::new(lines, rods, edges);
                    if pair.distance < limit {
                        pairs.push(pair);
                    }
                }
            }
            self.searched[which] = Some(searched);
        }
        pairs
    }

    fn middle(&self, rod: usize, edge: usize) -> V3 {
        let [x, y, z] = &self.middles[rod];
        V3::new(x[edge], y[edge], z[edge])
    }

    /// Searches two rods for edges closer than `reach`.
    fn collect(&self, lines: &Lines, [a, b]: [usize; 2], reach: f64) -> Searched {
        let mut candidates = Vec::new();
        let exclusion = (a == b).then_some(self.exclusion[a]);
        let (first, second) = (&self.middles[a], &self.middles[b]);
        let found = |i, j| candidates.push([i, j]);
        let search = Close { first, second, exclusion, reach: reach + self.longest, found };
        let apart = (pulp::Arch::new().dispatch(search) - self.longest).max(reach);
        Searched { lines: lines.clone(), apart, candidates }
    }

    /// Least distance of the two rods' centre lines, m, and the edges where it is.
    pub fn least_distance(&mut self, lines: &Lines) -> (f64, [usize; 2]) {
        self.load(lines);
        let mut candidates: Vec<[usize; 2]> = Vec::new();
        let (first, second) = (&self.middles[0], &self.middles[1]);
        let exclusion = None;
        let search = Close { first, second, exclusion, reach: 0.0, found: |_, _| {} };
        let nearest = pulp::Arch::new().dispatch(search);
        let reach = (nearest + self.longest) * (1.0 + 1e-12);
        let found = |i, j| candidates.push([i, j]);
        pulp::Arch::new().dispatch(Close { first, second, exclusion, reach, found });
        (candidates.into_iter())
            .map(|[i, j]| {
                let (a, b) = (&lines[0], &lines[1]);
                (segment_distance(a[i], a[i + 1], b[j], b[j + 1]).separation.norm(), [i, j])
            })
            .fold((f64::INFINITY, [0, 0]), |best, next| if next.0 < best.0 { next } else { best })
    }
}

impl Searched {
    /// Whether no edges but the candidates can be closer than `limit` (m) now.
    fn holds(&self, lines: &Lines, rods: [usize; 2], limit: f64) -> bool {
        let moved = |k: usize| {
            let squares = lines[k].iter().zip(&self.lines[k]).map(|(a, b)| (a - b).norm_squared());
            squares.fold(0.0, f64::max).sqrt()
        };
        let first = moved(rods[0]);
        let second = if rods[1] == rods[0] { first } else { moved(rods[1]) };
        // A search among numbers that are none found none.
        self.apart.is_finite() && self.apart - first - second > limit
    }
}

/// Calls `found` for midpoints closer than `reach`; returns the least distance (m).
struct Close<'a, F> {
    first: &'a [Vec<f64>; 3],
    second: &'a [Vec<f64>; 3],
    exclusion: Option<usize>,
    reach: f64,
    found: F,
}

impl<F: FnMut(usize, usize)> WithSimd for Close<'_, F> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let Close { first, second, exclusion, reach, found } = self;
        close_midpoints(first, second, exclusion, reach, found)
    }
}

#[inline(always)]
fn close_midpoints(
    first: &[Vec<f64>; 3],
    second: &[Vec<f64>; 3],
    exclusion: Option<usize>,
    reach: f64,
    mut found: impl FnMut(usize, usize),
) -> f64 {
    let limit = reach * reach;
    let mut least = f64::INFINITY;
    for i in 0..first[0].len() {
        let [x, y, z] = [first[0][i], first[1][i], first[2][i]];
        if x == AWAY {
            break;
        }
        let start = match exclusion {
            Some(gap) => i + gap,
            None => 0,
        };
        for block in (start / LANES * LANES..second[0].len()).step_by(LANES) {
            let (bx, by, bz) =
                (&second[0][block..block + LANES], &second[1][block..block + LANES], &second[2][block..block + LANES]);
            let mut squares = [0.0; LANES];
            for k in 0..LANES {
                let (dx, dy, dz) = (bx[k] - x, by[k] - y, bz[k] - z);
                squares[k] = dx * dx + dy * dy + dz * dz;
            }
            if block < start {
                squares[..start - block].fill(f64::INFINITY);
            }
            let mut smallest = squares[0];
            for k in 1..LANES {
                smallest = if squares[k] < smallest { squares[k] } else { smallest };
            }
            least = least.min(smallest);
            if smallest < limit {
                for (k, square) in squares.iter().enumerate() {
                    if *square < limit {
                        found(i, block + k);
                    }
                }
            }
        }
    }
    least.sqrt()
}

/// A new set of pairs for a step: forces are handed over to the nearest new pair, as contact slides
/// along the edges, and normals keep their side.
pub fn hand_over(old: &[Pair], mut new: Vec<Pair>, edge: f64, contact_distance: f64) -> Vec<Pair> {
    for pair in &mut new {
        keep_side(old, pair, contact_distance);
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
            && distance < 3.0
        {
            new[i].force += before.force;
            new[i].friction += before.friction;
        }
    }
    new
}

/// Adds pairs that have come close within a step; returns how many of them overlap by more than `overlap`.
pub fn extend(pairs: &mut Vec<Pair>, new: Vec<Pair>, contact_distance: f64, overlap: f64) -> usize {
    let mut overlapping = 0;
    for mut pair in new {
        if pairs.iter().any(|p| p.same_edges(&pair)) {
            continue;
        }
        keep_side(pairs, &mut pair, contact_distance);
        overlapping += usize::from(pair.distance < contact_distance - overlap);
        pairs.push(pair);
    }
    overlapping
}

fn keep_side(known: &[Pair], pair: &mut Pair, contact_distance: f64) {
    let nearest = (known.iter())
        .filter(|p| p.rods == pair.rods && p.distance.abs() < 1.5 * contact_distance)
        .map(|p| (p.edges[0].abs_diff(pair.edges[0]) + p.edges[1].abs_diff(pair.edges[1]), p))
        .filter(|(steps, _)| *steps < 3)
        .min_by_key(|(steps, _)| *steps);
    if let Some((_, p)) = nearest
        && p.normal.dot(&pair.normal) < -0.2
    {
        pair.normal = -pair.normal;
        pair.distance = -pair.distance;
    }
}

/// Whether two edges went through each other between two shapes of the lines: they become coplanar on
/// the way while their closest points nearly meet.
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
        closest.separation.norm() < 0.5 * radius
    })
}
