//! Helpers of the tests: rows of their table, and the reference data of another program.
//!
//! `cargo test -p sim -- --nocapture | grep '^|'` prints the table.
#![allow(dead_code)]

use sim::V3;
use sim::body::{closure::Closure, shaft::MotorState};
use sim::params::Robot;
use sim::rod::frames::Frames;
use sim::step::state::State;
use sim::step::{Solver, StepControl, StepError, StepReport};
use std::collections::HashMap;
use std::f64::consts::PI;

/// Adds a row to the table and asserts that the measured value is within its bound.
pub fn prove(check: &str, measured: f64, bound: f64) {
    let holds = measured <= bound;
    println!("| {check} | {measured:.2e} | {bound:.1e} | {} |", if holds { "holds" } else { "FAILS" });
    assert!(holds, "{check}: {measured:e} above {bound:e}");
}

/// Pseudo-random numbers in -0.5..0.5.
pub fn noise(seed: &mut u64) -> f64 {
    *seed ^= *seed << 13;
    *seed ^= *seed >> 7;
    *seed ^= *seed << 17;
    (*seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
}

/// Runs a robot from rest at constant speeds, calling `each` after every step.
pub fn run_steps(
    robot: &Robot,
    closure: Closure,
    rpm: [f64; 2],
    end: f64,
    mut each: impl FnMut(&Solver, &State, &StepReport),
) -> Result<(), StepError> {
    let mut solver = Solver::new(robot, closure).expect("parameters");
    let mut state = solver.at_rest();
    let motors = |t: f64| rpm.map(|r| MotorState { angle: r * PI / 30.0 * t, speed: r * PI / 30.0 });
    let mut control = StepControl::default();
    while state.time < end {
        let report = control.advance(&mut solver, &mut state, end, &motors)?;
        each(&solver, &state, &report);
    }
    Ok(())
}

/// Frames of flagellum `k` and the gradient of its elastic energy, four slots a node.
pub fn frames_and_gradient(solver: &Solver, state: &State, k: usize) -> (Frames, Vec<f64>) {
    let (rod, shape) = (&solver.model().rods[k], &state.rods[k].shape);
    let mut frames = Frames::new(rod.nodes());
    frames.update(&state.rods[k].frames, &shape.nodes, &shape.angles);
    let mut gradient = vec![0.0; 4 * rod.nodes()];
    rod.gradient(&mut frames, &shape.angles, &mut gradient);
    (frames, gradient)
}

fn read(folder: &str, name: &str) -> String {
    let path = format!("{}/../tests/data/{folder}/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// A table with named columns, such as a time series.
pub struct Series {
    columns: HashMap<String, usize>,
    rows: Vec<Vec<f64>>,
}

impl Series {
    /// Reads a file of the other program's reference data.
    pub fn read(name: &str) -> Self {
        Self::open("peer", name)
    }

    /// Reads a file of a folder of `tests/data`.
    pub fn open(folder: &str, name: &str) -> Self {
        let text = read(folder, name);
        let mut lines = text.lines().filter(|l| !l.starts_with('#'));
        let header = lines.next().expect("a header");
        let columns = header.split(',').enumerate().map(|(i, c)| (c.to_string(), i)).collect();
        let rows = lines.map(|l| l.split(',').map(|v| v.parse().expect("a number")).collect()).collect();
        Self { columns, rows }
    }

    /// One column.
    pub fn column(&self, name: &str) -> Vec<f64> {
        let at = self.columns[name];
        self.rows.iter().map(|r| r[at]).collect()
    }

    /// Mean of a column over from < t <= to.
    pub fn mean(&self, name: &str, from: f64, to: f64) -> f64 {
        let (values, times) = (self.column(name), self.column("t_s"));
        let picked: Vec<f64> = (values.iter().zip(&times))
            .filter(|(_, t)| **t > from + 1e-9 && **t <= to + 1e-9)
            .map(|(v, _)| *v)
            .collect();
        picked.iter().sum::<f64>() / picked.len() as f64
    }
}

/// Rows of a static solve: nodes of each rod, velocities, force densities.
pub fn static_solve(name: &str) -> (Vec<Vec<V3>>, Vec<V3>, Vec<V3>) {
    let (mut lines, mut velocity, mut force) = (Vec::<Vec<V3>>::new(), vec![], vec![]);
    for row in read("peer", name).lines().filter(|l| l.starts_with(|c: char| c.is_ascii_digit())) {
        let v: Vec<f64> = row.split(',').map(|c| c.parse().expect("a number")).collect();
        if lines.len() < v[0] as usize {
            lines.push(vec![]);
        }
        lines.last_mut().expect("a rod").push(V3::new(v[2], v[3], v[4]));
        velocity.push(V3::new(v[5], v[6], v[7]));
        force.push(V3::new(v[9], v[10], v[11]));
    }
    (lines, velocity, force)
}

/// First node positions of both rods in a file of nodes.
pub fn first_nodes(name: &str) -> [Vec<V3>; 2] {
    let mut rods = [vec![], vec![]];
    for row in read("peer", name).lines().filter(|l| l.starts_with(|c: char| c.is_ascii_digit())) {
        let v: Vec<f64> = row.split(',').map(|c| c.parse().expect("a number")).collect();
        rods[v[0] as usize - 1].push(V3::new(v[2], v[3], v[4]));
    }
    rods
}

/// A vector of the reference data in our axes: theirs has +x from clamp to tip and their rod 1 where
/// our flagellum 2 is, so x_B = y, y_B = -z, z_B = -x.
pub fn to_body(v: [f64; 3]) -> [f64; 3] {
    [v[1], -v[2], -v[0]]
}
