//! The shapes of the flagella for the page's view of the robot.
//!
//! In the frame that turns with its shaft, a flagellum changes slowly at any speed. So the page stores few shapes in that
//! frame, interpolates linearly between them, and turns them by the angle of the shaft.

use super::table::{bytes, single};
use serde_json::{Value, json};
use sim::body::shaft::Shaft;
use sim::params::Robot;
use study::trial::{Shape, Shapes};

/// Resolution of the coordinates, m.
const UNIT_M: f64 = 1e-5;

/// With a budget below this, bytes per trial, every second node is left out.
const TIGHT: usize = 150_000;

/// Returns the shapes as data of the page's script, in about `text_bytes` bytes; without shapes, the helices at rest.
pub(super) fn page(shapes: &Shapes, robot: &Robot, text_bytes: usize) -> Value {
    let feet = robot.shaft_feet();
    let rest = [Shape { time_s: 0.0, turns: [0.0; 2], lines: at_rest(robot) }];
    let rigid = shapes.is_empty();
    let frames = if rigid { &rest[..] } else { &shapes.all[..] };
    let nodes = frames[0].lines[0].len();
    let stride = if text_bytes < TIGHT && !rigid { 2 } else { 1 };
    // The tip is always drawn.
    let kept: Vec<usize> = (0..nodes).filter(|i| i % stride == 0 || i + 1 == nodes).collect();
    let frame_bytes = kept.len() * 2 * 3 * 2 * 4 / 3;
    let count = frames.len().min((text_bytes / frame_bytes).max(2));
    let last = frames.len() - 1;
    let chosen: Vec<&Shape> = (0..count).map(|i| &frames[i * last / (count - 1).max(1)]).collect();
    let mut coordinates = Vec::with_capacity(chosen.len() * kept.len() * 6);
    for frame in &chosen {
        for line in frame.in_shafts(&feet) {
            for &i in &kept {
                coordinates.extend(line[i].iter().map(|part| ((part / UNIT_M).round() as i16).to_le_bytes()));
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

fn rate_hz(times: &[f64]) -> f64 {
    match times {
        [first, .., last] if last > first => (times.len() - 1) as f64 / (last - first),
        _ => 0.0,
    }
}

/// Returns both helices at rest with the shafts at zero, body axes.
pub(crate) fn at_rest(robot: &Robot) -> [Vec<[f64; 3]>; 2] {
    let feet = robot.shaft_feet();
    [0, 1].map(|k| {
        let nodes = robot.flagellum.helix(k).nodes(robot.flagellum.edges());
        let shaft = Shaft::new(feet[k], robot.flagellum.phase_deg[k].to_radians());
        nodes.into_iter().map(|node| shaft.point_to_body(node).into()).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use base64::Engine;
    use base64::prelude::BASE64_STANDARD;
    use std::f64::consts::TAU;

    /// Rigid helices turned by `turns`.
    fn lines(robot: &Robot, turns: [f64; 2]) -> [Vec<[f64; 3]>; 2] {
        let feet = robot.shaft_feet();
        [0, 1].map(|k| {
            let nodes = robot.flagellum.helix(k).nodes(robot.flagellum.edges());
            let shaft = Shaft::new(feet[k], turns[k] * TAU);
            nodes.into_iter().map(|node| shaft.point_to_body(node).into()).collect()
        })
    }

    fn coordinates(page: &Value) -> Vec<i16> {
        let data = BASE64_STANDARD.decode(page["i16"].as_str().unwrap()).unwrap();
        data.as_chunks().0.iter().map(|pair| i16::from_le_bytes(*pair)).collect()
    }

    #[test]
    fn a_rigid_helix_never_changes_in_the_frame_of_its_shaft() {
        let robot = Robot::default();
        let rest = coordinates(&page(&Shapes::new(10), &robot, 1_000_000));
        let mut shapes = Shapes::new(100);
        for i in 0..2000 {
            let time = f64::from(i) * 0.05;
            let turns = [1.5 * time, -0.3 * time];
            shapes.push(time, turns, lines(&robot, turns));
        }
        let large = page(&shapes, &robot, 1_000_000);
        assert_eq!((large["rigid"].as_bool(), large["nodes"].as_u64()), (Some(false), Some(50)));
        for frame in coordinates(&large).chunks_exact(rest.len()) {
            assert!(frame.iter().zip(&rest).all(|(a, b)| (a - b).abs() <= 1));
        }
        let small = page(&shapes, &robot, 20_000);
        assert!(small.to_string().len() < 21_000 && small["nodes"] == 26);
    }
}
