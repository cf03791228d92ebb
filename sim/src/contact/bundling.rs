//! Whether the flagella are apart, touch, or are wound round each other.

use super::pairs::Lines;
use crate::V3;
use crate::functions::atan2;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// State of the pair of flagella.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Bundling {
    /// No contact with each other.
    #[default]
    Apart,
    /// Contact with each other, with the helix axes side by side or crossing once. Contact of a flagellum with itself does
    /// not count.
    Touching,
    /// Contact, with the helix axes wound round each other.
    Bundled,
}

/// Winding of the axes beyond which flagella in contact count as bundled. Axes that merely cross wind half a time.
pub const BUNDLED_TURNS: f64 = 0.75;

impl Bundling {
    /// Returns the state for the presence of contact and the winding of the axes, see [`winding`].
    pub fn classify(contact: bool, winding: f64) -> Self {
        match (contact, winding.abs() >= BUNDLED_TURNS) {
            (false, _) => Self::Apart,
            (true, false) => Self::Touching,
            (true, true) => Self::Bundled,
        }
    }
}

/// Returns the axis of a helix: means of its nodes over one coil of `edges` edges.
fn axis(line: &[V3], edges: usize) -> Vec<V3> {
    line.windows(edges + 1)
        .map(|w| {
            let ends = (w[0] + w[edges]) * 0.5;
            w[1..edges].iter().fold(ends, |a, b| a + b) / edges as f64
        })
        .collect()
}

/// Returns how many times the helix axes of the two lines wind round each other, right-handed positive.
///
/// `coil`: edges of one coil of the helix. An axis is a mean over one coil, so it is one coil shorter than its line;
/// lines shorter than a coil give 0.
pub fn winding(lines: &Lines, coil: usize) -> f64 {
    let shortest = lines[0].len().min(lines[1].len());
    if coil == 0 || shortest < coil + 2 {
        return 0.0;
    }
    let (a, b) = (axis(&lines[0], coil), axis(&lines[1], coil));
    let mean = (a[a.len() - 1] - a[0]) + (b[b.len() - 1] - b[0]);
    let length = mean.norm();
    if length.is_nan() || length <= 0.0 {
        return 0.0;
    }
    let along = mean / length;
    let across: Vec<V3> = (a.iter().zip(&b))
        .map(|(p, q)| {
            let d = p - q;
            d - along * d.dot(&along)
        })
        .collect();
    across.windows(2).map(|d| atan2(along.dot(&d[0].cross(&d[1])), d[0].dot(&d[1]))).sum::<f64>() / TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_double_helix_winds_as_often_as_it_turns() {
        let line = |phase: f64| -> Vec<V3> {
            (0..=90)
                .map(|i| {
                    // Axes that wind once in 60 edges, each of a helix of 10 edges a coil.
                    let (slow, fast) = (TAU * i as f64 / 60.0 + phase, TAU * i as f64 / 10.0);
                    V3::new(slow.cos() + 0.3 * fast.cos(), slow.sin() + 0.3 * fast.sin(), 0.5 * i as f64)
                })
                .collect()
        };
        let turns = winding(&[line(0.0), line(std::f64::consts::PI)], 10);
        assert!((turns - 80.0 / 60.0).abs() < 0.02, "{turns}");
        assert_eq!(Bundling::classify(true, turns), Bundling::Bundled);
        assert_eq!(Bundling::classify(false, turns), Bundling::Apart);
    }
}
