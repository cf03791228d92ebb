//! How far the thrust, torque and drag of the measured helix with the longest pitch depend on edges and regularisation.
//!
//! `cargo run --release -p sim --example helices` prints the table of `sim/docs/accuracy.md`. The helix is the third of
//! `tests/data/helices/measured.csv` (Rodenborn et al. 2013), in units of its radius and of the viscosity.

use sim::V3;
use sim::fluid::mobility::rigid_resistance;
use sim::rod::helix::{Handedness, Helix};
use std::f64::consts::PI;

const HELIX: Helix = Helix { radius: 1.0, pitch: 15.241, axial_length: 20.634921, handedness: Handedness::Right };
const ROD_RADIUS: f64 = 0.063016;
/// Thrust, torque and drag.
const MEASURED: [f64; 3] = [7.845, 68.07, 34.12];

fn main() {
    println!(
        "| regularisation r | edge r | edges | drag on the spin | thrust | torque | drag | against the measured |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for (regularisation, edge, spin_drag) in [
        (1.6487, 3.2974, 1.0),
        (1.6487, 1.6487, 1.0),
        (1.6487, 0.8244, 1.0),
        (1.6487, 0.4122, 1.0),
        (1.6487, 0.8244, 0.0),
        (1.03, 0.515, 1.0),
        (2.0, 1.0, 1.0),
        (2.5, 1.25, 1.0),
    ] {
        let edges = (HELIX.contour_length() / (edge * ROD_RADIUS)).ceil() as usize;
        let couple = spin_drag * 4.0 * PI * ROD_RADIUS * ROD_RADIUS;
        let nodes = HELIX.nodes(edges);
        let matrix =
            rigid_resistance(&[&nodes], V3::zeros(), regularisation * ROD_RADIUS, 1.0, couple).expect("regular");
        let found = [-matrix[(2, 5)], matrix[(5, 5)], matrix[(2, 2)]];
        let [thrust, torque, drag] = found;
        let [a, b, c] = [0, 1, 2].map(|i| 100.0 * (found[i] / MEASURED[i] - 1.0));
        println!(
            "| {regularisation} | {edge:.2} | {edges} | {spin_drag} | {thrust:.3} | {torque:.2} | {drag:.2} | {a:+.1}, {b:+.1}, {c:+.1} % |"
        );
    }
    let [thrust, torque, drag] = MEASURED;
    println!("| measured | | | | {thrust} | {torque} | {drag} | |");
}
