//! Shapes of the flagella over a trial, limited in number.

use nalgebra::Vector3;
use sim::body::shaft::Shaft;
use std::f64::consts::TAU;

/// Maximum number of shapes per second: ten per turn at 90 rpm.
const PER_S: f64 = 15.0;

/// Both centre lines at one time.
#[derive(Clone, PartialEq, Debug)]
pub struct Shape {
    /// Time on the trial's clock.
    pub time_s: f64,
    /// Angles of both shafts, turns.
    pub turns: [f64; 2],
    /// Nodes from the shaft to the tip, body axes, m.
    pub lines: [Vec<[f64; 3]>; 2],
}

impl Shape {
    /// Returns the nodes in the frames that turn with the shafts. In these frames a flagellum changes slowly at any
    /// speed. `feet`: feet of the shafts, body axes, m.
    pub fn in_shafts(&self, feet: &[Vector3<f64>; 2]) -> [Vec<Vector3<f64>>; 2] {
        [0, 1].map(|k| {
            let shaft = Shaft::new(feet[k], self.turns[k] * TAU);
            self.lines[k].iter().map(|&node| shaft.point_to_shaft(node.into())).collect()
        })
    }
}

/// A series of at most `most` shapes, by default none. When it is full, it drops every other shape.
#[derive(Clone, Debug, Default)]
pub struct Shapes {
    most: usize,
    least_s: f64,
    /// The shapes in order of time.
    pub all: Vec<Shape>,
}

impl Shapes {
    /// Creates an empty series.
    pub fn new(most: usize) -> Self {
        Self { most, least_s: 1.0 / PER_S, all: Vec::new() }
    }

    /// Returns whether the series is empty.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Adds the centre lines at one time, and the angles of both shafts. Invalid or unequal lines are ignored.
    pub fn push(&mut self, time_s: f64, turns: [f64; 2], lines: [Vec<[f64; 3]>; 2]) {
        if self.most == 0 || self.all.last().is_some_and(|last| time_s < last.time_s + self.least_s - 1e-6) {
            return;
        }
        let nodes = lines[0].len();
        let fits = nodes >= 2
            && lines[1].len() == nodes
            && self.all.first().is_none_or(|first| first.lines[0].len() == nodes)
            && lines.iter().flatten().flatten().all(|part| part.is_finite());
        if !fits {
            return;
        }
        self.all.push(Shape { time_s, turns, lines });
        if self.all.len() > self.most.max(2) {
            let mut keep = std::iter::repeat([true, false]).flatten();
            self.all.retain(|_| keep.next() == Some(true));
            if let [.., before, last] = self.all.as_slice() {
                self.least_s = last.time_s - before.time_s;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(nodes: usize) -> Vec<[f64; 3]> {
        vec![[0.1; 3]; nodes]
    }

    #[test]
    fn shapes_are_limited_in_number_and_evenly_spaced() {
        let mut shapes = Shapes::new(100);
        for i in 0..2000 {
            shapes.push(f64::from(i) * 0.05, [0.0; 2], [line(50), line(50)]);
        }
        let times: Vec<_> = shapes.all.iter().map(|shape| shape.time_s).collect();
        assert!((50..=100).contains(&times.len()), "{}", times.len());
        assert!(times.windows(3).all(|t| (t[2] - 2.0 * t[1] + t[0]).abs() < 1e-6), "{times:?}");
    }

    #[test]
    fn invalid_or_unequal_lines_are_ignored() {
        let mut shapes = Shapes::new(100);
        shapes.push(0.0, [0.0; 2], [line(3), line(2)]);
        shapes.push(0.1, [0.0; 2], [line(1), line(1)]);
        shapes.push(0.2, [0.0; 2], [line(3), vec![[f64::NAN; 3]; 3]]);
        assert!(shapes.is_empty());
        shapes.push(0.3, [0.0; 2], [line(3), line(3)]);
        shapes.push(0.4, [0.0; 2], [line(4), line(4)]);
        assert_eq!(shapes.all.len(), 1);
        let mut unwanted = Shapes::new(0);
        unwanted.push(0.0, [0.0; 2], [line(3), line(3)]);
        assert!(unwanted.is_empty());
    }
}
