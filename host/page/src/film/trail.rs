//! The trails of the tips: where they have been in the last seconds, thinner the longer ago.

use super::render::{BACKGROUND, FLAGELLA, Rgb, Solid, V3};

/// Length of a trail, s.
pub(super) const TRAIL_S: f64 = 2.0;

/// Pieces of a trail.
const PIECES: usize = 80;

/// Share of the background in its colour.
const PALE: f32 = 0.45;

/// Returns the trails at a time. `tips`: both tips at a time, world axes, m; `rod_m`: the radius of a flagellum.
pub(super) fn trails(time_s: f64, first_s: f64, rod_m: f64, tips: impl Fn(f64) -> [V3; 2]) -> Vec<Solid> {
    let from_s = (time_s - TRAIL_S).max(first_s);
    let at = |i: usize| from_s + (time_s - from_s) * i as f64 / PIECES as f64;
    let path: Vec<[V3; 2]> = (0..=PIECES).map(|i| tips(at(i))).collect();
    let mut solids = Vec::new();
    for k in 0..2 {
        // A tip at rest leaves none.
        if path.iter().all(|tips| (tips[k] - path[0][k]).norm() < 0.5 * rod_m) {
            continue;
        }
        let colour: Rgb = std::array::from_fn(|i| FLAGELLA[k][i] * (1.0 - PALE) + BACKGROUND[i] * PALE);
        let piece = |(i, ends): (usize, &[[V3; 2]])| {
            let radius = 0.3 * rod_m * (0.2 + 0.8 * (i + 1) as f64 / PIECES as f64);
            Solid { is_lit: false, ..Solid::rod(ends[0][k], ends[1][k], radius, colour) }
        };
        solids.extend(path.windows(2).enumerate().map(piece));
    }
    solids
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tip_that_moves_leaves_a_trail_of_its_last_seconds() {
        let tips = |time: f64| [V3::new(0.01 * time.cos(), 0.01 * time.sin(), -0.2), V3::zeros()];
        let trails = trails(10.0, 0.0, 0.002, tips);
        assert_eq!(trails.len(), PIECES, "the other tip is at rest");
        let (first, last) = (trails[0], trails[PIECES - 1]);
        assert!((first.from - tips(8.0)[0]).norm() < 1e-12 && (last.to - tips(10.0)[0]).norm() < 1e-12);
        assert!(first.radius < 0.25 * last.radius && last.radius == 0.3 * 0.002);
        // Before the first sample there is none.
        let early = super::trails(0.5, 0.4, 0.0001, tips);
        assert!((early[0].from - tips(0.4)[0]).norm() < 1e-12);
    }
}
