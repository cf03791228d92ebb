//! Time of the parts of a sweep, one flagellum of the published robot.
//!
//! `cargo bench -p sim --bench kernels`

use divan::{Bencher, black_box};
use sim::V3;
use sim::fluid::far::{Sources, Targets, gauss_rule};
use sim::fluid::mobility::mobility;
use sim::fluid::near::NearBand;
use sim::params::{Precision, Robot};
use sim::rod::{Rod, frames::Frames};

fn main() {
    divan::main();
}

fn rod() -> Rod {
    let flagellum = Robot::published().flagellum;
    Rod::stress_free(flagellum.helix(0).nodes(49), flagellum.stiffness())
}

#[divan::bench]
fn elastic_forces(bencher: Bencher) {
    let rod = rod();
    let mut frames = Frames::new(rod.nodes());
    let angles = vec![0.1; rod.edges()];
    let mut gradient = vec![0.0; 4 * rod.nodes()];
    bencher.bench_local(|| {
        frames.update(&rod.rest_frames, black_box(&rod.shape), &angles);
        rod.gradient(&frames, &angles, &mut gradient);
    });
}

#[divan::bench]
fn frames(bencher: Bencher) {
    let rod = rod();
    let mut frames = Frames::new(rod.nodes());
    let angles = vec![0.1; rod.edges()];
    bencher.bench_local(|| frames.update(&rod.rest_frames, black_box(&rod.shape), &angles));
}

#[divan::bench(args = [Precision::Single, Precision::Double])]
fn far_flow_of_both_rods(bencher: Bencher, precision: Precision) {
    let rod = rod();
    let density = vec![V3::new(0.1, 0.2, 0.3); rod.nodes()];
    let (mut sources, mut targets) = (Sources::default(), Targets::new(rod.nodes(), precision));
    for _ in 0..2 {
        sources.push_edges(0..rod.edges(), gauss_rule(2), |i| rod.shape[i], |i| density[i]);
    }
    bencher.bench_local(|| {
        targets.set(black_box(&rod.shape));
        targets.add_flow(&sources, 3.09e-3);
    });
}

#[divan::bench]
fn near_band_assembly(bencher: Bencher) {
    let rod = rod();
    let mut near = NearBand::new(rod.nodes(), 2, 2);
    bencher.bench_local(|| near.assemble(black_box(&rod.shape), 3.09e-3, 1.0));
}

#[divan::bench]
fn near_band_product(bencher: Bencher) {
    let rod = rod();
    let mut near = NearBand::new(rod.nodes(), 2, 2);
    near.assemble(&rod.shape, 3.09e-3, 1.0);
    let density = vec![V3::new(0.1, 0.2, 0.3); rod.nodes()];
    bencher.bench_local(|| near.multiply(black_box(&density)));
}

#[divan::bench]
fn dense_mobility(bencher: Bencher) {
    let rod = rod();
    bencher.bench_local(|| mobility(black_box(&[rod.shape.as_slice()]), 3.09e-3, 1.0));
}
