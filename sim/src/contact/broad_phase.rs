//! The search for close edges: midpoints first, Verlet lists between searches.
//!
//! Body frame, m. It covers edges of different rods, and edges of the same rod beyond the arc length within which its
//! own helix is closer than 2.5 radii. A rod's list with itself is checked in the shaft frame, where the rod does not
//! turn.

use super::distance::segment_distance;
use super::pairs::{Lines, Pair};
use crate::V3;
use crate::functions::powi;
use crate::lanes::{PADDING, Wide, Wide3};
use crate::rod::Rod;
use crate::simd::{Kernel, Simd, dispatch};

/// Finds pairs of close edges, and the least distance.
#[derive(Clone, Debug)]
pub struct BroadPhase {
    /// For each rod, its own edges fewer than this many apart never count as close.
    exclusion: [usize; 2],
    /// Midpoints of the edges of each rod, m, padded.
    middles: [[Vec<f64>; 3]; 2],
    /// Longest edge, m.
    longest: f64,
    /// Skin of a list, m: the list reaches this much farther than asked, and stays valid until the rods have moved that
    /// far.
    skin: f64,
    /// One for each of [`ROD_PAIRS`].
    lists: [Option<NeighbourList>; 3],
    /// The nearest edges of both rods in the last search: their distance bounds the least distance.
    nearest: [usize; 2],
}

/// A Verlet list of two rods: as long as they have moved less than the skin, no other edges are close.
#[derive(Clone, Debug)]
struct NeighbourList {
    /// Shapes for which it was made: both rods in the body frame, or one rod in its own frame and an empty line.
    shapes: [Vec<V3>; 2],
    /// Pairs of edges that were close.
    edges: Vec<[usize; 2]>,
    /// Lower bound of the distance of all other pairs, m.
    cutoff: f64,
}

/// The rods with each other and with themselves.
const ROD_PAIRS: [[usize; 2]; 3] = [[0, 1], [0, 0], [1, 1]];
/// Edges of a rod whose own helix brings them within this many radii never count as close.
const OWN_RADII: f64 = 2.5;
/// Padding of the midpoint arrays lies this far away, m.
const AWAY: f64 = 1e6;

impl BroadPhase {
    /// Returns the search for two rods of radius `radius` (m) with these shapes at rest.
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
                        c.separation.norm() < OWN_RADII * radius
                    })
                })
                .max()
                .unwrap_or(0);
            smooth.max(own) + 1
        });
        let middles = [0, 1].map(|k| {
            let padded = rods[k].edges().div_ceil(PADDING) * PADDING;
            std::array::from_fn(|_| vec![AWAY; padded])
        });
        Self { exclusion, middles, longest: 0.0, skin: radius, lists: [None, None, None], nearest: [0; 2] }
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

    /// Returns the pairs of edges whose distance is below `limit` (m), without forces. `own`: the nodes of each rod in a frame
    /// in which it moves little, such as its shaft frame, m.
    pub fn search(&mut self, lines: &Lines, own: [&[V3]; 2], limit: f64) -> Vec<Pair> {
        for (list, rods) in self.lists.iter_mut().zip(ROD_PAIRS) {
            if list.as_ref().is_some_and(|list| !list.holds(shapes(lines, own, rods), limit)) {
                *list = None;
            }
        }
        if self.lists.iter().all(|list| list.as_ref().is_some_and(|list| list.edges.is_empty())) {
            return Vec::new();
        }
        self.load(lines);
        let mut pairs = Vec::new();
        let reach = powi(limit + self.longest, 2);
        for (which, rods) in ROD_PAIRS.into_iter().enumerate() {
            let list = self.lists[which]
                .take()
                .unwrap_or_else(|| self.list(shapes(lines, own, rods), rods, limit + self.skin));
            for &edges in &list.edges {
                let [a, b] = [0, 1].map(|k| self.middle(rods[k], edges[k]));
                if (a - b).norm_squared() < reach {
                    let pair = Pair::new(lines, rods, edges);
                    if pair.distance < limit {
                        pairs.push(pair);
                    }
                }
            }
            self.lists[which] = Some(list);
        }
        pairs
    }

    fn middle(&self, rod: usize, edge: usize) -> V3 {
        let [x, y, z] = &self.middles[rod];
        V3::new(x[edge], y[edge], z[edge])
    }

    /// Lists the edges of two rods that are closer than `reach` (m). `shapes`: the nodes that [`NeighbourList::holds`]
    /// compares.
    fn list(&self, shapes: [&[V3]; 2], [a, b]: [usize; 2], reach: f64) -> NeighbourList {
        let mut edges = Vec::new();
        let exclusion = (a == b).then_some(self.exclusion[a]);
        let (first, second) = (&self.middles[a], &self.middles[b]);
        let found = |i, j| edges.push([i, j]);
        let search = Close { first, second, exclusion, reach: reach + self.longest, found };
        let cutoff = (dispatch(search) - self.longest).max(reach);
        NeighbourList { shapes: shapes.map(<[V3]>::to_vec), edges, cutoff }
    }

    /// Returns the least distance of the two rods' centre lines, m.
    pub fn least_distance(&mut self, lines: &Lines) -> f64 {
        self.load(lines);
        let apart = |[i, j]: [usize; 2]| {
            let (a, b) = (&lines[0], &lines[1]);
            segment_distance(a[i], a[i + 1], b[j], b[j + 1]).separation.norm()
        };
        let mut candidates: Vec<[usize; 2]> = Vec::new();
        let (first, second) = (&self.middles[0], &self.middles[1]);
        // Slightly more, so that rounding does not lose the nearest pair.
        let reach = (apart(self.nearest) + self.longest) * (1.0 + 1e-12);
        let found = |i, j| candidates.push([i, j]);
        dispatch(Close { first, second, exclusion: None, reach, found });
        let mut least = f64::INFINITY;
        for edges in candidates {
            let distance = apart(edges);
            if distance < least {
                (least, self.nearest) = (distance, edges);
            }
        }
        if self.lists[0].as_ref().is_none_or(|list| list.edges.is_empty()) {
            // Nothing is close: the next search may not need the midpoints.
            self.lists[0] = Some(NeighbourList { shapes: lines.clone(), edges: Vec::new(), cutoff: least });
        }
        least
    }
}

/// Returns the nodes for checking a list of two rods: nodes in its own frame for one rod with itself.
fn shapes<'a>(lines: &'a Lines, own: [&'a [V3]; 2], [a, b]: [usize; 2]) -> [&'a [V3]; 2] {
    if a == b { [own[a], &[]] } else { [&lines[a], &lines[b]] }
}

impl NeighbourList {
    /// Returns whether no edges but those listed can be closer than `limit` (m) now. `shapes`: see [`shapes`].
    fn holds(&self, shapes: [&[V3]; 2], limit: f64) -> bool {
        let moved = |k: usize, shift: V3| {
            let squares = shapes[k].iter().zip(&self.shapes[k]).map(|(a, b)| (a - b - shift).norm_squared());
            squares.fold(0.0, |largest, square| if square > largest { square } else { largest }).sqrt()
        };
        let [first, second] = if shapes[1].is_empty() {
            // A shift of the whole rod brings none of its edges closer to each other.
            let middle = shapes[0].len() / 2;
            [moved(0, shapes[0][middle] - self.shapes[0][middle]); 2]
        } else {
            [0, 1].map(|k| moved(k, V3::zeros()))
        };
        // A shape with a NaN in it has no distances.
        self.cutoff.is_finite() && self.cutoff - first - second > limit
    }
}

/// Calls `found` for midpoints closer than `reach` (m) and returns the least distance of all (m).
struct Close<'a, F> {
    first: &'a [Vec<f64>; 3],
    second: &'a [Vec<f64>; 3],
    exclusion: Option<usize>,
    reach: f64,
    found: F,
}

impl<F: FnMut(usize, usize)> Kernel for Close<'_, F> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> f64 {
        let Close { first, second, exclusion, reach, mut found } = self;
        let [x, y, z] = second;
        let limit = Wide::all(simd, reach * reach);
        let mut smallest = Wide::all(simd, f64::INFINITY);
        let mut squares = [0.0; PADDING];
        for i in 0..first[0].len() {
            if first[0][i] == AWAY {
                break;
            }
            let [x0, y0, z0] = [first[0][i], first[1][i], first[2][i]];
            let middle = Wide3([Wide::all(simd, x0), Wide::all(simd, y0), Wide::all(simd, z0)]);
            let start = exclusion.map_or(0, |gap| i + gap);
            for block in (start / S::F64_LANES * S::F64_LANES..x.len()).step_by(S::F64_LANES) {
                let at = [Wide::load(simd, x, block), Wide::load(simd, y, block), Wide::load(simd, z, block)];
                let apart = Wide3(at) - middle;
                let mut square = apart.dot(apart);
                if block < start {
                    square.store(&mut squares, 0);
                    squares[..start - block].fill(f64::INFINITY);
                    square = Wide::load(simd, &squares, 0);
                }
                smallest = square.min(smallest);
                if square.any_below(limit) {
                    square.store(&mut squares, 0);
                    for k in 0..S::F64_LANES {
                        if squares[k] < reach * reach {
                            found(i, block + k);
                        }
                    }
                }
            }
        }
        smallest.least().sqrt()
    }
}
