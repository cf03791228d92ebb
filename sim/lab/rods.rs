//! The line model of rigid flagella against their resolved surfaces, for rods of several radii and distances.
//!
//! `cargo run --release -p sim --example rods` prints the tables of `sim/docs/accuracy.md` and writes nothing; with
//! `-- csv` it prints `tests/data/surface/rods.csv`. Twenty minutes on two cores.
//!
//! The surfaces are resolved by the method of fundamental solutions: point forces inside the rods, such that the surfaces
//! do not slip in the sense of least squares. It shares no code with the model: neither a centre line with a density nor a
//! regularisation. Two flagella see each other's flow by reflections. Geometry, frames and signs are those of
//! `tests/data/surface/README.md`, with whose cases the first table compares it.

use nalgebra::linalg::Cholesky;
use nalgebra::{DMatrix, DVector, Dyn, Rotation3};
use sim::V3;
use sim::params::{HeadShape, Robot};
use sim::resistance::resistance;
use std::f64::consts::{PI, TAU};

/// Depth of the point forces below the surface, and distances of rings of points along the rod, in rod radii.
const DEPTH: f64 = 0.5;
const SOURCE_RING: f64 = 0.8;
const SURFACE_RING: f64 = 0.6;
/// Points of a ring.
const SOURCES: usize = 6;
const SURFACE: usize = 10;
/// Reflections between two flagella.
const REFLECTIONS: usize = 14;
/// Angles of each flagellum over which loads are averaged.
const ANGLES: usize = 4;
/// Speeds, rpm.
const SPEEDS: [[f64; 2]; 3] = [[90.0, 90.0], [50.0, 10.0], [-90.0, 90.0]];

/// A pair of flagella, m.
#[derive(Clone, Copy)]
struct Pair {
    rod_radius: f64,
    helix_radius: f64,
    pitch: f64,
    axial_length: f64,
    distance: f64,
    height: f64,
}

const PUBLISHED: Pair = Pair {
    rod_radius: 0.003,
    helix_radius: 0.00889,
    pitch: 0.076,
    axial_length: 0.1962,
    distance: 0.045,
    height: 0.0375,
};

/// Force and moment about the joint of the fluid on a flagellum, and its torque about its shaft: N and N m.
#[derive(Clone, Copy, Default)]
struct Load {
    force: V3,
    moment: V3,
    torque: f64,
}

impl Load {
    fn of(forces: impl Iterator<Item = (V3, V3)>, foot: V3) -> Self {
        let mut load = Self::default();
        for (x, force) in forces {
            load.force += force;
            load.moment += x.cross(&force);
            load.torque += (x - foot).cross(&force).z;
        }
        load
    }

    fn plus(self, other: Self, share: f64) -> Self {
        Self {
            force: self.force + other.force * share,
            moment: self.moment + other.moment * share,
            torque: self.torque + other.torque * share,
        }
    }
}

/// A flagellum whose foot is the origin and whose angle is zero: its surface, and point forces below it.
struct Resolved {
    surface: Vec<V3>,
    sources: Vec<V3>,
    /// Velocities at the surface per force.
    flow: DMatrix<f64>,
    normal: Cholesky<f64, Dyn>,
}

impl Resolved {
    fn new(pair: &Pair) -> Self {
        let surface = points(pair, pair.rod_radius, SURFACE_RING, SURFACE, &[PI / 6.0, PI / 3.0]);
        let sources = points(pair, pair.rod_radius * (1.0 - DEPTH), SOURCE_RING, SOURCES, &[PI / 4.0]);
        let flow = stokeslets(&surface, &sources);
        let normal = Cholesky::new(flow.tr_mul(&flow)).expect("independent forces");
        Self { surface, sources, flow, normal }
    }

    /// Returns the forces on the fluid for velocities of the surface. The normal equations are corrected by their residual.
    fn forces(&self, velocity: &DVector<f64>) -> DVector<f64> {
        let mut forces = self.normal.solve(&self.flow.tr_mul(velocity));
        for _ in 0..2 {
            let left = velocity - &self.flow * &forces;
            forces += self.normal.solve(&self.flow.tr_mul(&left));
        }
        forces
    }
}

/// Returns points on a tube about the helix with round ends.
fn points(pair: &Pair, radius: f64, ring: f64, count: usize, polar: &[f64]) -> Vec<V3> {
    let Pair { rod_radius, helix_radius, pitch, axial_length, .. } = *pair;
    let turn = (TAU * helix_radius).hypot(pitch);
    let rings = (axial_length / pitch * turn / (ring * rod_radius)).ceil() as usize;
    let frame = |z: f64| {
        let a = TAU * z / pitch;
        let centre = V3::new(helix_radius * a.cos(), -helix_radius * a.sin(), -z);
        let tangent = V3::new(-helix_radius * a.sin(), -helix_radius * a.cos(), -pitch / TAU).normalize();
        let normal = V3::new(a.cos(), -a.sin(), 0.0);
        (centre, tangent, normal, tangent.cross(&normal))
    };
    let mut points = Vec::new();
    let mut circle = |z: f64, outwards: f64, polar: f64, shift: f64| {
        let (centre, tangent, normal, binormal) = frame(z);
        for k in 0..count {
            let angle = TAU * (k as f64 + shift) / count as f64;
            let across = normal * angle.cos() + binormal * angle.sin();
            points.push(centre + across * (radius * polar.cos()) + tangent * (outwards * radius * polar.sin()));
        }
    };
    for i in 0..=rings {
        circle(axial_length * i as f64 / rings as f64, 0.0, 0.0, 0.5 * (i % 2) as f64);
    }
    for (z, outwards) in [(0.0, -1.0), (axial_length, 1.0)] {
        polar.iter().for_each(|polar| circle(z, outwards, *polar, 0.25));
    }
    for (z, outwards) in [(0.0, -1.0), (axial_length, 1.0)] {
        let (centre, tangent, ..) = frame(z);
        points.push(centre + tangent * (outwards * radius));
    }
    points
}

/// Returns the velocities at `at` for point forces at `sources`, viscosity 1 Pa s.
fn stokeslets(at: &[V3], sources: &[V3]) -> DMatrix<f64> {
    let mut flow = DMatrix::zeros(3 * at.len(), 3 * sources.len());
    for (j, y) in sources.iter().enumerate() {
        for (i, x) in at.iter().enumerate() {
            let r = x - y;
            let d = r.norm();
            let block = (nalgebra::Matrix3::identity() / d + r * r.transpose() / d.powi(3)) / (8.0 * PI);
            flow.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&block);
        }
    }
    flow
}

/// Rotates vectors about z.
fn rotated(vectors: &DVector<f64>, turn: &Rotation3<f64>) -> DVector<f64> {
    let each = (0..vectors.len() / 3).map(|i| turn * V3::from_column_slice(&vectors.as_slice()[3 * i..3 * i + 3]));
    DVector::from_vec(each.flat_map(|v| [v.x, v.y, v.z]).collect())
}

/// Returns the loads on each of the flagella when flagellum `turning` alone turns at 1 rad/s, and the residual slip over the
/// fastest point. `angles`: of each flagellum; one for a single flagellum.
fn resolved_loads(pair: &Pair, flagellum: &Resolved, angles: &[f64], turning: usize) -> (Vec<Load>, f64) {
    let count = angles.len();
    let feet = [1.0, -1.0].map(|side| V3::new(side * 0.5 * pair.distance, 0.0, -pair.height));
    let turns: Vec<_> = angles.iter().map(|angle| Rotation3::from_axis_angle(&V3::z_axis(), *angle)).collect();
    let placed = |points: &[V3], k: usize| -> Vec<V3> { points.iter().map(|x| feet[k] + turns[k] * x).collect() };
    let surfaces: Vec<_> = (0..count).map(|k| placed(&flagellum.surface, k)).collect();
    let sources: Vec<_> = (0..count).map(|k| placed(&flagellum.sources, k)).collect();
    let across: Vec<_> =
        if count == 2 { (0..2).map(|k| stokeslets(&surfaces[k], &sources[1 - k])).collect() } else { Vec::new() };
    let wanted: Vec<DVector<f64>> = (0..count)
        .map(|k| {
            let spin = if k == turning { V3::z() } else { V3::zeros() };
            DVector::from_vec(surfaces[k].iter().flat_map(|x| <[f64; 3]>::from(spin.cross(&(x - feet[k])))).collect())
        })
        .collect();
    let mut forces = vec![DVector::zeros(3 * flagellum.sources.len()); count];
    for _ in 0..if count == 2 { REFLECTIONS } else { 1 } {
        for k in 0..count {
            let seen = if count == 2 { &wanted[k] - &across[k] * &forces[1 - k] } else { wanted[k].clone() };
            let own = flagellum.forces(&rotated(&seen, &turns[k].inverse()));
            forces[k] = rotated(&own, &turns[k]);
        }
    }
    let mut slip = 0f64;
    let mut fastest = 0f64;
    for k in 0..count {
        let own = rotated(&(&flagellum.flow * rotated(&forces[k], &turns[k].inverse())), &turns[k]);
        let other = if count == 2 { &across[k] * &forces[1 - k] } else { DVector::zeros(own.len()) };
        let left = own + other - &wanted[k];
        slip = slip.max((left.norm_squared() / surfaces[k].len() as f64).sqrt());
        fastest = (surfaces[k].iter().map(|x| (x - feet[k]).xy().norm())).fold(fastest, f64::max);
    }
    let load = |k: usize| {
        let each = sources[k].iter().enumerate();
        // The fluid acts on the rod with the opposite of what the rod's forces do to the fluid.
        Load::of(each.map(|(i, x)| (*x, -V3::from_column_slice(&forces[k].as_slice()[3 * i..3 * i + 3]))), feet[k])
    };
    ((0..count).map(load).collect(), slip / fastest)
}

/// Returns the same of the line model, and the reciprocity error of its resistance.
fn line_loads(pair: &Pair, angles: &[f64], turning: usize) -> (Vec<Load>, f64) {
    let mut robot = Robot::default();
    robot.head.shape = HeadShape::None;
    robot.fluid.viscosity_pa_s = 1.0;
    robot.flagellum.rod_radius_m = pair.rod_radius;
    robot.flagellum.helix_radius_m = pair.helix_radius;
    robot.flagellum.pitch_m = pair.pitch;
    robot.flagellum.axial_length_m = pair.axial_length;
    robot.base.motor_distance_m = pair.distance;
    robot.base.height_m = pair.height;
    let found = resistance(&robot, angles).expect("parameters");
    let mut motion = DVector::zeros(found.matrix.nrows());
    motion[6 * (turning + 1) + 5] = 1.0;
    let all = -(&found.matrix * motion);
    let load = |k: usize| {
        let part = |side: usize| all.fixed_rows::<3>(6 * (k + 1) + side).into_owned();
        let (force, about_foot) = (part(0), part(3));
        Load { force, moment: about_foot + robot.shaft_feet()[k].cross(&force), torque: about_foot.z }
    };
    ((0..angles.len()).map(load).collect(), found.reciprocity_error)
}

/// Loads of both flagella, averaged over their angles, for each speed of 1 rad/s alone.
type Means = [[Load; 2]; 2];

fn means(of: impl Fn(&[f64], usize) -> (Vec<Load>, f64)) -> (Means, f64) {
    let mut means = Means::default();
    let mut worst = 0f64;
    let share = 1.0 / (ANGLES * ANGLES) as f64;
    for (one, two) in (0..ANGLES * ANGLES).map(|n| (n / ANGLES, n % ANGLES)) {
        let angles = [one, two].map(|step| TAU * step as f64 / ANGLES as f64);
        for turning in 0..2 {
            let (loads, error) = of(&angles, turning);
            worst = worst.max(error);
            for (mean, load) in means[turning].iter_mut().zip(loads) {
                *mean = mean.plus(load, share);
            }
        }
    }
    (means, worst)
}

/// Returns the loads at speeds, rpm.
fn at_speeds(means: &Means, rpm: [f64; 2]) -> [Load; 2] {
    let speeds = rpm.map(|rpm| rpm * PI / 30.0);
    [0, 1].map(|k| Load::default().plus(means[0][k], speeds[0]).plus(means[1][k], speeds[1]))
}

fn check_of_the_method() {
    println!("| case | force 1, mN | torque 1, mN m | moment of both, mN m | slip |\n| --- | --- | --- | --- | --- |");
    let flagellum = Resolved::new(&PUBLISHED);
    for (name, rpm) in [("single", vec![90.0]), ("pair", vec![90.0, 90.0]), ("slow pair", vec![50.0, 10.0])] {
        let angles = vec![0.0; rpm.len()];
        let mut sums = vec![Load::default(); rpm.len()];
        let mut worst = 0f64;
        for (turning, rpm) in rpm.iter().enumerate() {
            let (loads, slip) = resolved_loads(&PUBLISHED, &flagellum, &angles, turning);
            worst = worst.max(slip);
            for (sum, load) in sums.iter_mut().zip(loads) {
                *sum = sum.plus(load, rpm * PI / 30.0);
            }
        }
        let moment: V3 = sums.iter().map(|load| load.moment).sum();
        let [f, m] = [sums[0].force, moment].map(|v| v * 1e3);
        println!(
            "| {name} | {:.3}, {:.3}, {:.3} | {:.4} | {:.3}, {:.3}, {:.3} | {worst:.4} |",
            f.x,
            f.y,
            f.z,
            1e3 * sums[0].torque,
            m.x,
            m.y,
            m.z
        );
    }
    println!();
}

fn main() {
    let is_csv = std::env::args().nth(1).is_some_and(|word| word == "csv");
    if is_csv {
        println!(
            "rod_radius,helix_radius,pitch,axial_length,distance,w1_rpm,w2_rpm,yaw_error,tilt_error,thrust_error,torque_error,lateral_error,reciprocity_error,slip"
        );
    } else {
        check_of_the_method();
        println!(
            "Means over both angles; errors of the line model in % of the resolved value: yaw and tilt are those of the moments about the joint, thrust, torque and lateral force those of the faster flagellum, in % of its largest.\n"
        );
        println!(
            "| rod mm | helix mm | pitch mm | distance mm | gap mm | rpm | yaw | tilt | thrust | torque | lateral | reciprocity | slip |"
        );
        println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    }
    let rod = |rod_radius: f64| Pair { rod_radius, ..PUBLISHED };
    for pair in [
        rod(0.003),
        rod(0.0045),
        rod(0.006),
        rod(0.0075),
        Pair { distance: 0.0345, ..PUBLISHED },
        Pair { distance: 0.0285, ..PUBLISHED },
        Pair { helix_radius: 0.0125, pitch: 0.06, distance: 0.05, axial_length: 0.15, ..PUBLISHED },
        Pair { rod_radius: 0.0055, distance: 0.034, ..PUBLISHED },
    ] {
        let flagellum = Resolved::new(&pair);
        let (resolved, slip) = means(|angles, turning| resolved_loads(&pair, &flagellum, angles, turning));
        let (line, reciprocity) = means(|angles, turning| line_loads(&pair, angles, turning));
        for rpm in SPEEDS {
            let (truth, found) = (at_speeds(&resolved, rpm), at_speeds(&line, rpm));
            let moment = |loads: &[Load; 2]| loads[0].moment + loads[1].moment;
            let (m, n) = (moment(&truth), moment(&found));
            let yaw = n.z / m.z - 1.0;
            let tilt = (n.xy() - m.xy()).norm() / m.xy().norm();
            let (a, b) = (truth[0], found[0]);
            let largest = a.force.amax();
            let thrust = (b.force.z - a.force.z) / largest;
            let torque = b.torque / a.torque - 1.0;
            let lateral = (b.force.xy() - a.force.xy()).norm() / a.force.xy().norm();
            let [r, h, p, d] = [pair.rod_radius, pair.helix_radius, pair.pitch, pair.distance].map(|m| 1e3 * m);
            if is_csv {
                println!(
                    "{},{},{},{},{},{},{},{yaw:.5},{tilt:.5},{thrust:.5},{torque:.5},{lateral:.5},{reciprocity:.5},{slip:.5}",
                    pair.rod_radius, pair.helix_radius, pair.pitch, pair.axial_length, pair.distance, rpm[0], rpm[1]
                );
            } else {
                println!(
                    "| {r} | {h} | {p} | {d} | {:.1} | {}, {} | {:+.1} | {:.1} | {:+.1} | {:+.1} | {:.1} | {:.2} | {:.2} |",
                    d - 2.0 * (h + r),
                    rpm[0],
                    rpm[1],
                    100.0 * yaw,
                    100.0 * tilt,
                    100.0 * thrust,
                    100.0 * torque,
                    100.0 * lateral,
                    100.0 * reciprocity,
                    100.0 * slip
                );
            }
        }
    }
}
