//! The shapes of the flagella for the page's view of the robot.
//!
//! In the frame that turns with its shaft, a flagellum changes slowly at any speed. So the page stores few shapes in that
//! frame, interpolates linearly between them, and turns them by the angle of the shaft.

use super::table::{bytes, single};
use crate::log::schema::foxglove::SceneUpdate;
use serde_json::{Value, json};
use sim::params::Robot;
use sim::robot::clamp::Shaft;
use std::f64::consts::TAU;

/// At most this many shapes per second: ten per turn at 90 rpm.
const PER_S: f64 = 15.0;

/// Resolution of the coordinates, m.
const UNIT_M: f64 = 1e-5;

/// With less room than this per trial, bytes, every second node is left out.
const TIGHT: usize = 150_000;

/// Both centre lines at a time, body axes, m.
#[derive(Clone, Debug)]
struct Frame {
    time_s: f64,
    turns: [f64; 2],
    lines: [Vec<[f64; 3]>; 2],
}

/// Collects shapes; halves their rate whenever there are more than `most`.
#[derive(Clone, Debug)]
pub(super) struct Shapes {
    most: usize,
    interval_s: f64,
    frames: Vec<Frame>,
}

impl Shapes {
    pub fn new(most: usize) -> Self {
        Self { most: most.max(2), interval_s: 1.0 / PER_S, frames: Vec::new() }
    }

    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Adds a message of `/flagella`. `turns` are the angles of both shafts at that time.
    pub fn push(&mut self, time_s: f64, turns: [f64; 2], scene: &SceneUpdate) {
        if self.frames.last().is_some_and(|last| time_s < last.time_s + self.interval_s - 1e-6) {
            return;
        }
        let mut lines = scene
            .entities
            .iter()
            .flat_map(|entity| &entity.lines)
            .map(|line| line.points.iter().map(|point| [point.x, point.y, point.z]).collect::<Vec<_>>());
        let (Some(first), Some(second)) = (lines.next(), lines.next()) else { return };
        if first.len() < 2 || self.frames.first().is_some_and(|frame| frame.lines[0].len() != first.len()) {
            return;
        }
        if first.len() != second.len() || first.iter().chain(&second).flatten().any(|part| !part.is_finite()) {
            return;
        }
        self.frames.push(Frame { time_s, turns, lines: [first, second] });
        if self.frames.len() > self.most {
            self.interval_s *= 2.0;
            let mut keep = std::iter::repeat([true, false]).flatten();
            self.frames.retain(|_| keep.next() == Some(true));
        }
    }

    /// Returns the data of the page's script in about `text_bytes` of text; without shapes, the helices at rest.
    pub fn page(&self, robot: &Robot, text_bytes: usize) -> Value {
        let feet = robot.shaft_feet();
        let rest;
        let (frames, rigid) = if self.is_empty() {
            rest = [Frame { time_s: 0.0, turns: [0.0; 2], lines: at_rest(robot) }];
            (&rest[..], true)
        } else {
            (&self.frames[..], false)
        };
        let nodes = frames[0].lines[0].len();
        let stride = if text_bytes < TIGHT && !rigid { 2 } else { 1 };
        // The tip is always drawn.
        let kept: Vec<usize> = (0..nodes).filter(|i| i % stride == 0 || i + 1 == nodes).collect();
        let frame_bytes = kept.len() * 2 * 3 * 2 * 4 / 3;
        let count = frames.len().min((text_bytes / frame_bytes).max(2));
        let last = frames.len() - 1;
        let chosen: Vec<&Frame> = (0..count).map(|i| &frames[i * last / (count - 1).max(1)]).collect();
        let mut coordinates = Vec::with_capacity(chosen.len() * kept.len() * 6);
        for frame in &chosen {
            for (k, line) in frame.lines.iter().enumerate() {
                let shaft = Shaft::new(feet[k], frame.turns[k] * TAU);
                for &i in &kept {
                    let seen = shaft.point_to_shaft(line[i].into());
                    coordinates.extend(seen.iter().map(|part| ((part / UNIT_M).round() as i16).to_le_bytes()));
                }
            }
        }
        let times: Vec<f64> = chosen.iter().map(|frame| frame.time_s).collect();
        json!({
            "rigid": rigid,
            "per_s": if rigid { 0.0 } else { rate_hz(&times) },
            "nodes": kept.len(),
            "unit_m": UNIT_M,
            "feet_m": feet.map(|foot| [foot.x, foot.y, foot.z]),
            "time": single(&times),
            "i16": bytes(coordinates.into_iter()),
        })
    }
}

fn rate_hz(times: &[f64]) -> f64 {
    match times {
        [first, .., last] if last > first => (times.len() - 1) as f64 / (last - first),
        _ => 0.0,
    }
}

/// Both helices at rest with the shafts at zero, body axes.
fn at_rest(robot: &Robot) -> [Vec<[f64; 3]>; 2] {
    let feet = robot.shaft_feet();
    [0, 1].map(|k| {
        let nodes = robot.flagellum.helix(k).nodes(robot.flagellum.edges());
        nodes.into_iter().map(|node| (feet[k] + node).into()).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::schema::foxglove::{LinePrimitive, Point3, SceneEntity};
    use base64::Engine;
    use base64::prelude::BASE64_STANDARD;

    /// Rigid helices turned by `turns`.
    fn scene(robot: &Robot, turns: [f64; 2]) -> SceneUpdate {
        let feet = robot.shaft_feet();
        let line = |k: usize| LinePrimitive {
            points: robot
                .flagellum
                .helix(k)
                .nodes(robot.flagellum.edges())
                .iter()
                .map(|node| {
                    let p = Shaft::new(feet[k], turns[k] * TAU).point_to_body(*node);
                    Point3 { x: p.x, y: p.y, z: p.z }
                })
                .collect(),
            ..LinePrimitive::default()
        };
        let entity = SceneEntity { lines: vec![line(0), line(1)], ..SceneEntity::default() };
        SceneUpdate { entities: vec![entity], ..SceneUpdate::default() }
    }

    fn coordinates(page: &Value) -> Vec<i16> {
        let data = BASE64_STANDARD.decode(page["i16"].as_str().unwrap()).unwrap();
        data.as_chunks().0.iter().map(|pair| i16::from_le_bytes(*pair)).collect()
    }

    #[test]
    fn a_rigid_helix_never_changes_in_the_frame_of_its_shaft() {
        let robot = Robot::default();
        let rest = coordinates(&Shapes::new(10).page(&robot, 1_000_000));
        let mut shapes = Shapes::new(100);
        for i in 0..2000 {
            let time = f64::from(i) * 0.05;
            let turns = [1.5 * time, -0.3 * time];
            shapes.push(time, turns, &scene(&robot, turns));
        }
        assert!((50..=100).contains(&shapes.frames.len()), "{}", shapes.frames.len());
        let page = shapes.page(&robot, 1_000_000);
        assert_eq!((page["rigid"].as_bool(), page["nodes"].as_u64()), (Some(false), Some(50)));
        for frame in coordinates(&page).chunks_exact(rest.len()) {
            assert!(frame.iter().zip(&rest).all(|(a, b)| (a - b).abs() <= 1));
        }
        let small = shapes.page(&robot, 20_000);
        assert!(small.to_string().len() < 21_000 && small["nodes"] == 26);
    }

    #[test]
    fn anything_but_a_pair_of_lines_is_ignored() {
        let robot = Robot::default();
        let mut shapes = Shapes::new(100);
        shapes.push(0.0, [0.0; 2], &SceneUpdate::default());
        let mut broken = scene(&robot, [0.0; 2]);
        broken.entities[0].lines[1].points.pop();
        shapes.push(0.1, [0.0; 2], &broken);
        broken = scene(&robot, [0.0; 2]);
        broken.entities[0].lines[0].points[3].x = f64::NAN;
        shapes.push(0.2, [0.0; 2], &broken);
        assert!(shapes.is_empty());
        assert_eq!(shapes.page(&robot, 1000)["rigid"], true);
    }
}
