//! Walls and free surfaces: the images against their conditions, Blake's formula, a sphere and a rod near a wall.

use crate::common::{noise, prove};
use nalgebra::{DMatrix, DVector, Matrix3, UnitQuaternion};
use sim::V3;
use sim::fluid::head::{POINTS, surface_points};
use sim::fluid::walls::{Images, Plane, Walls};
use sim::fluid::{
    Line, coarse::Coarse, far::gauss_rule, mobility::mobility, reflections::Reflections, stokeslet_factor,
    tank::TankFlow,
};
use sim::params::{HeadShape, Robot, Tank};
use sim::resistance::resistance;
use std::f64::consts::PI;

fn stokeslet(x: V3, y: V3, epsilon: f64) -> Matrix3<f64> {
    let d = x - y;
    let r = (d.norm_squared() + epsilon * epsilon).sqrt();
    Matrix3::identity() * (1.0 / r + epsilon * epsilon / r.powi(3)) + d * d.transpose() / r.powi(3)
}

fn floor() -> Walls {
    Walls::new(vec![Plane { axis: 2, at: 0.0, side: 1.0 }], None)
}

#[test]
fn flow_vanishes_at_a_wall() {
    let mut seed = 5;
    let mut worst = 0f64;
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let plane = Plane { axis, at: 0.3, side };
            let walls = Walls::new(vec![plane], None);
            for epsilon in [0.0, 0.01, 0.2] {
                for _ in 0..50 {
                    let mut point = || V3::new(noise(&mut seed), noise(&mut seed), noise(&mut seed));
                    let (mut x, mut y) = (point(), point());
                    y[axis] = plane.at + side * (0.02 + y[axis].abs());
                    x[axis] = plane.at;
                    assert!(plane.height(y) > 0.0 && walls.clearance(y) == plane.height(y));
                    let direct = stokeslet(x, y, epsilon);
                    worst = worst.max((direct + walls.tensor(x, y, epsilon)).amax() / direct.amax());
                }
            }
        }
    }
    prove("no slip at a wall, plain and regularised, over the force's own flow", worst, 1e-13);
}

#[test]
fn plain_images_are_those_of_blake() {
    // Blake 1971: (d_ij/R + R_i R_j/R^3) reversed, and 2 h (d_ja d_ak - d_j3 d_3k) d/dR_k of h R_i/R^3 - (d_i3/R + R_i R_3/R^3).
    let blake = |x: V3, y: V3| {
        let (h, d) = (y.z, V3::new(x.x - y.x, x.y - y.y, x.z + y.z));
        let r = d.norm();
        let delta = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
        Matrix3::from_fn(|i, j| {
            let sign = if j == 2 { -1.0 } else { 1.0 };
            let doublet = h * (delta(i, j) / r.powi(3) - 3.0 * d[i] * d[j] / r.powi(5));
            let stokeslet = -delta(i, 2) * d[j] / r.powi(3) + (delta(i, j) * d.z + d[i] * delta(2, j)) / r.powi(3)
                - 3.0 * d[i] * d.z * d[j] / r.powi(5);
            -(delta(i, j) / r + d[i] * d[j] / r.powi(3)) + 2.0 * h * sign * (doublet - stokeslet)
        })
    };
    let (walls, mut seed, mut worst) = (floor(), 11, 0f64);
    for _ in 0..200 {
        let mut point = || V3::new(noise(&mut seed), noise(&mut seed), 0.01 + noise(&mut seed).abs());
        let (x, y) = (point(), point());
        let reference = blake(x, y);
        worst = worst.max((walls.tensor(x, y, 0.0) - reference).amax() / reference.amax());
    }
    prove("images against Blake's formula, relative", worst, 1e-12);
}

#[test]
fn images_are_incompressible_and_reciprocal() {
    let planes = vec![
        Plane { axis: 0, at: -0.6, side: 1.0 },
        Plane { axis: 1, at: 0.6, side: -1.0 },
        Plane { axis: 2, at: -0.6, side: 1.0 },
    ];
    let walls = Walls::new(planes, Some(0.7));
    let (mut seed, mut divergence, mut reciprocity) = (3, 0f64, 0f64);
    for _ in 0..100 {
        let mut point = || V3::new(noise(&mut seed), noise(&mut seed), noise(&mut seed));
        let (x, y) = (point(), point());
        let tensor = walls.tensor(x, y, 0.1);
        reciprocity = reciprocity.max((tensor - walls.tensor(y, x, 0.1).transpose()).amax() / tensor.amax());
        let step = 1e-4;
        let mut sum = V3::zeros();
        for axis in 0..3 {
            let mut shift = V3::zeros();
            shift[axis] = step;
            let change = walls.tensor(x + shift, y, 0.1) - walls.tensor(x - shift, y, 0.1);
            sum += change.row(axis).transpose() / (2.0 * step);
        }
        divergence = divergence.max(sum.amax() / tensor.amax());
    }
    prove("images: divergence by differences, 1/m, over the flow", divergence, 1e-5);
    prove("images: forces and velocities change places, relative", reciprocity, 1e-13);
}

#[test]
fn a_free_surface_has_no_normal_velocity_and_no_shear() {
    let planes = vec![Plane { axis: 2, at: -0.4, side: 1.0 }, Plane { axis: 1, at: 0.3, side: -1.0 }];
    let surface = 0.1;
    let walls = Walls::new(planes, Some(surface));
    let (mut seed, mut normal, mut shear, step) = (7, 0f64, 0f64, 1e-3);
    for epsilon in [0.0, 0.05] {
        for _ in 0..100 {
            let (dx, dy) = (noise(&mut seed), 0.2 * noise(&mut seed));
            let y = V3::new(noise(&mut seed), 0.2 * noise(&mut seed), -0.15 + 0.4 * noise(&mut seed));
            let flow = |z: f64| {
                let x = V3::new(dx, dy, z);
                stokeslet(x, y, epsilon) + walls.tensor(x, y, epsilon)
            };
            let (at, above, below) = (flow(surface), flow(surface + step), flow(surface - step));
            normal = normal.max(at.row(2).amax() / at.amax());
            let change = (above - below) / (2.0 * step);
            shear = shear.max(change.fixed_rows::<2>(0).amax() / at.amax());
        }
    }
    prove("free surface: normal velocity over the flow", normal, 1e-13);
    prove("free surface: shear, 1/m, over the flow", shear, 1e-10);
}

#[test]
fn flow_midway_between_two_walls() {
    let facing = [1.0, -1.0].map(|side| Plane { axis: 1, at: -side, side });
    let (one, two) = (Walls::new(vec![facing[0]], None), Walls::new(facing.to_vec(), None));
    let (at, along) = (V3::zeros(), |walls: &Walls| walls.tensor(V3::zeros(), V3::zeros(), 0.0)[(0, 0)]);
    assert_eq!(two.clearance(at), 1.0);
    prove("one wall: flow along it at the force, against Lorentz's 9/16", (along(&one) / -0.75 - 1.0).abs(), 1e-12);
    // Faxen 1922: 1.004 radii over the distance, 4/3 of it in units of 1/(8 pi mu).
    let faxen = -1.004 * 4.0 / 3.0;
    let error = (along(&two) / faxen - 1.0).abs();
    println!("midway between two walls: superposed images against Faxen, {error:.3}");
    let mut reflections = Reflections::new(&two, &two, [V3::repeat(-0.5), V3::repeat(0.5)]).expect("two walls");
    let mut rest = [V3::zeros()];
    reflections.set_points(&[at]);
    let mut moments = Vec::new();
    reflections.add_moments(0, &[V3::x()], &mut moments);
    reflections.add_flow(&moments, &mut rest);
    let error = ((along(&two) + rest[0].x) / faxen - 1.0).abs();
    prove("midway between two walls: images and reflections against Faxen", error, 0.01);
}

/// Evenly spread points on a sphere of radius 1 about the origin.
fn sphere(points: usize) -> Vec<V3> {
    let golden = PI * (3.0 - 5f64.sqrt());
    (0..points)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / points as f64;
            let (r, angle) = ((1.0 - z * z).sqrt(), golden * i as f64);
            V3::new(r * angle.cos(), r * angle.sin(), z)
        })
        .collect()
}

/// Drag of points that move together at unit velocity along `axis`, viscosity 1.
fn drag(points: &[V3], walls: &Walls, epsilon: f64, axis: usize) -> f64 {
    let n = points.len();
    let mut matrix = DMatrix::zeros(3 * n, 3 * n);
    for (i, x) in points.iter().enumerate() {
        for (j, y) in points.iter().enumerate() {
            let block = stokeslet(*x, *y, epsilon) + walls.tensor(*x, *y, epsilon);
            matrix.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&(block * stokeslet_factor(1.0)));
        }
    }
    let velocity = DVector::from_fn(3 * n, |row, _| if row % 3 == axis { 1.0 } else { 0.0 });
    let force = matrix.lu().solve(&velocity).expect("regular");
    (0..n).map(|i| force[3 * i + axis]).sum()
}

#[test]
fn sphere_near_a_wall() {
    // Half the spacing of the points; all of it scaled to the drag of a sphere of radius 1, 2 % smaller than they make.
    let points = sphere(300);
    let epsilon = 0.5 * (4.0 * PI / points.len() as f64).sqrt();
    let free = drag(&points, &Walls::default(), epsilon, 0) / (6.0 * PI);
    prove("sphere of points: drag against 6 pi mu a", (free - 1.0).abs(), 0.02);
    let (unit, epsilon) = (points.iter().map(|x| x / free).collect::<Vec<V3>>(), epsilon / free);
    for h in [1.5, 2.0, 3.0, 6.0] {
        let raised: Vec<V3> = unit.iter().map(|x| x + V3::new(0.0, 0.0, h)).collect();
        let k = 1.0 / h;
        // Faxen 1923.
        let along = 1.0 / (1.0 - 9.0 / 16.0 * k + k.powi(3) / 8.0 - 45.0 / 256.0 * k.powi(4) - k.powi(5) / 16.0);
        // Brenner 1961, exact.
        let alpha = f64::acosh(h);
        let across = 4.0 / 3.0
            * alpha.sinh()
            * (1..60)
                .map(|n| {
                    let m = n as f64;
                    let top = 2.0 * ((2.0 * m + 1.0) * alpha).sinh() + (2.0 * m + 1.0) * (2.0 * alpha).sinh();
                    let bottom = 4.0 * ((m + 0.5) * alpha).sinh().powi(2) - ((2.0 * m + 1.0) * alpha.sinh()).powi(2);
                    m * (m + 1.0) / ((2.0 * m - 1.0) * (2.0 * m + 3.0)) * (top / bottom - 1.0)
                })
                .sum::<f64>();
        for (name, axis, theory) in [("along", 0, along), ("towards", 2, across)] {
            let drag = drag(&raised, &floor(), epsilon, axis) / (6.0 * PI);
            let check = format!("sphere {h} radii from a wall: drag {name} it against theory");
            prove(&check, (drag / theory - 1.0).abs(), 0.03);
        }
    }
}

#[test]
fn rod_beside_a_wall() {
    // Forces a metre on a long cylinder of radius a with its axis at height h over a wall, alpha = arcosh(h/a): across
    // the axis along the wall 4 pi mu/alpha, towards it 4 pi mu/(alpha - tanh alpha) (Jeffrey and Onishi 1981), along the
    // axis 2 pi mu/alpha.
    let (radius, edges, length) = (0.003, 100, 0.5);
    let epsilon = radius * 0.5f64.exp();
    for h in [0.012, 0.025, 0.05] {
        let line: Vec<V3> = (0..=edges).map(|i| V3::new(length * i as f64 / edges as f64, 0.0, h)).collect();
        let mut matrix = mobility(&[&line], epsilon, 1.0);
        let mut images = Images::default();
        images.assemble(&floor(), &line, &line, epsilon);
        let edge = length / edges as f64;
        for j in 0..line.len() {
            let weight = if j == 0 || j == edges { 0.5 * edge } else { edge };
            for b in 0..3 {
                let mut forces = vec![V3::zeros(); line.len()];
                forces[j][b] = weight;
                images.multiply(0, &forces);
                for i in 0..line.len() {
                    for a in 0..3 {
                        matrix[(3 * i + a, 3 * j + b)] += images.flow(i)[a] * stokeslet_factor(1.0);
                    }
                }
            }
        }
        let factored = matrix.lu();
        let alpha = f64::acosh(h / radius);
        let theories = [2.0 * PI / alpha, 4.0 * PI / alpha, 4.0 * PI / (alpha - alpha.tanh())];
        for (axis, (name, theory)) in
            ["along its axis", "sideways", "towards the wall"].iter().zip(theories).enumerate()
        {
            let velocity = DVector::from_fn(3 * line.len(), |row, _| if row % 3 == axis { 1.0 } else { 0.0 });
            let density = factored.solve(&velocity).expect("regular")[3 * (edges / 2) + axis];
            let check = format!("rod {:.1} radii from a wall, {name}: drag a metre against theory", h / radius);
            prove(&check, (density / theory - 1.0).abs(), 0.03);
        }
    }
}

/// Places and forces of four Gauss points an edge, for a density that is linear on each edge.
fn gauss_points(nodes: &[V3], density: &[V3]) -> (Vec<V3>, Vec<V3>) {
    let points = nodes.windows(2).zip(density.windows(2)).flat_map(|(x, f)| {
        let (edge, change) = (x[1] - x[0], f[1] - f[0]);
        gauss_rule(4)
            .iter()
            .map(move |(at, weight)| (x[0] + edge * *at, (f[0] + change * *at) * (weight * edge.norm())))
    });
    points.unzip()
}

#[test]
fn coarse_points_keep_the_flow_of_a_tank() {
    // Two flagella that turn rigidly, against the images of Gauss points at every node. Nearest node: so far from a wall.
    let robot = Robot::default();
    let (n, feet, epsilon) = (robot.flagellum.edges() + 1, robot.shaft_feet(), robot.epsilon());
    let walls = Walls::of(&Tank::published());
    for (place, shift, strides) in [
        ("in the middle", V3::zeros(), &[(1, 1e-3), (4, 1e-3)][..]),
        ("60 mm from a wall", V3::y() * (0.225 - 0.06889), &[(1, 3e-3), (3, 3e-3)]),
        ("30 mm from a wall", V3::y() * (0.225 - 0.03889), &[(1, 1e-2), (2, 1e-2)]),
        ("5 mm from a wall", V3::y() * (0.225 - 0.01389), &[(1, 1e-2)]),
    ] {
        let lines = feet.map(|foot| -> Vec<V3> {
            robot.flagellum.helix(0).nodes(n - 1).iter().map(|x| x + foot + shift).collect()
        });
        let all: Vec<V3> = lines.concat();
        let velocity = all.iter().enumerate().flat_map(|(i, x)| {
            let u = V3::z().cross(&(x - feet[i / n] - shift));
            [u.x, u.y, u.z]
        });
        let velocity = DVector::from_iterator(6 * n, velocity);
        let solved = mobility(&[&lines[0], &lines[1]], epsilon, 1.0).lu().solve(&velocity).expect("regular");
        let density: Vec<V3> = (0..2 * n).map(|i| solved.fixed_rows::<3>(3 * i).into_owned()).collect();
        let (mut sources, mut strengths) = (vec![], vec![]);
        for (line, density) in lines.iter().zip(density.chunks_exact(n)) {
            let (at, forces) = gauss_points(line, density);
            sources.extend(at);
            strengths.extend(forces);
        }
        let mut fine = Images::default();
        fine.assemble(&walls, &all, &sources, epsilon);
        fine.multiply(0, &strengths);
        let largest = (0..2 * n).fold(0.0, |a, i| fine.flow(i).norm().max(a));
        for (stride, bound) in strides {
            let (coarse, picks) = Coarse::line(n, *stride);
            let points: Vec<V3> = lines.iter().flat_map(|line| picks.iter().map(|i| line[*i])).collect();
            let mut forces = vec![V3::zeros(); points.len()];
            for (k, forces) in forces.chunks_exact_mut(coarse.count).enumerate() {
                let edge = |a: usize, b: usize| 0.5 * (lines[k][a] - lines[k][b]).norm();
                let length = |i: usize| if i == 0 { 0.0 } else { edge(i, i - 1) } + if i == n - 1 { 0.0 } else { edge(i, i + 1) };
                coarse.gather(|i| density[k * n + i] * length(i), forces);
            }
            let mut images = Images::default();
            images.assemble(&walls, &points, &points, epsilon);
            images.multiply(0, &forces);
            let mut flow = vec![V3::zeros(); all.len()];
            for (k, flow) in flow.chunks_exact_mut(n).enumerate() {
                coarse.spread(|c| images.flow(k * coarse.count + c), flow);
            }
            let worst = flow.iter().enumerate().map(|(i, u)| (u - fine.flow(i)).norm()).fold(0.0, f64::max);
            let check = format!("images between nodes {stride} apart, {place}, over their largest flow");
            prove(&check, worst / largest, *bound);
        }
    }
}

#[test]
fn tank_flow_is_that_of_all_images() {
    // A turned and tilted robot with a head, with some forces, at two places in the tank.
    let attitude = UnitQuaternion::from_euler_angles(0.1, -0.2, 2.5);
    let mut robot = Robot::default();
    robot.head.shape = HeadShape::Cylinder;
    let head: Vec<V3> = surface_points(&robot.head, POINTS).iter().map(|p| p.at).collect();
    let mut seed = 17;
    for (place, joint_m, joint_depth_m) in
        [("in the middle", [0.61, 0.225], 0.14), ("near a wall and the surface", [0.7, 0.1], 0.03)]
    {
        let tank = Tank { joint_m, joint_depth_m, ..Tank::published() };
        let walls = Walls::of(&tank);
        let lines = robot.shaft_feet().map(|foot| {
            let nodes: Vec<V3> = robot.flagellum.helix(0).nodes(49).iter().map(|x| x + foot).collect();
            let shift = noise(&mut seed);
            let density =
                (0..50).map(|i| V3::new((0.4 * i as f64 + shift).cos(), (0.4 * i as f64).sin(), shift)).collect();
            Line { nodes, density }
        });
        let forces: Vec<f64> = (0..3 * head.len())
            .map(|i| (0.1 + 0.03 * noise(&mut seed)) * [1.0, -0.5, 0.8][i % 3] / head.len() as f64)
            .collect();
        let at_rest = lines.clone().map(|line| line.nodes);
        let mut flow = TankFlow::new(&robot, &tank, &at_rest, &head);
        flow.begin(&lines, &attitude);
        flow.update(&lines, &forces, &attitude);

        let (mut sources, mut strengths) = (vec![], vec![]);
        for line in &lines {
            let (at, forces) = gauss_points(&line.nodes, &line.density);
            sources.extend(at.iter().map(|x| attitude * x));
            strengths.extend(forces.iter().map(|f| attitude * f));
        }
        for (x, f) in head.iter().zip(forces.chunks_exact(3)) {
            sources.push(attitude * x);
            strengths.push(attitude * V3::from_column_slice(f));
        }
        let targets: Vec<V3> = at_rest.concat().iter().chain(&head).map(|x| attitude * x).collect();
        let mut images = Images::default();
        images.assemble(&walls, &targets, &sources, robot.epsilon());
        images.multiply(0, &strengths);
        let mut reflections = Reflections::new(&walls, &walls, tank.space_of(&robot)).expect("several walls");
        let mut rest = vec![V3::zeros(); sources.len() + targets.len()];
        let forces = [strengths, vec![V3::zeros(); targets.len()]].concat();
        reflections.set_points(&[sources.clone(), targets.clone()].concat());
        let mut moments = Vec::new();
        reflections.add_moments(0, &forces, &mut moments);
        reflections.add_flow(&moments, &mut rest);
        let exact = |i: usize| {
            attitude.inverse_transform_vector(&(images.flow(i) + rest[sources.len() + i])) * stokeslet_factor(1.0)
        };
        let largest = (0..targets.len()).fold(0.0, |a, i| exact(i).norm().max(a));
        let worst = |flow: &[V3], start: usize| {
            flow.iter().enumerate().map(|(i, u)| (u - exact(start + i)).norm()).fold(0.0, f64::max) / largest
        };
        prove(&format!("tank's flow at the flagella, {place}"), worst(&flow.flow[..100], 0), 0.01);
        prove(&format!("tank's flow at the head, {place}"), worst(flow.at_head(), 100), 0.01);
    }
}

#[test]
fn a_robot_anywhere_in_a_tank_dissipates() {
    // Superposed images alone would let it gain energy sideways, even in the middle of the publication's tank.
    for (joint_m, joint_depth_m) in
        [([0.61, 0.225], 0.14), ([0.3, 0.15], 0.14), ([0.61, 0.1], 0.25), ([0.07, 0.07], 0.05)]
    {
        let robot = Robot { tank: Some(Tank { joint_m, joint_depth_m, ..Tank::published() }), ..Robot::default() };
        let found = resistance(&robot, &[0.0, 0.0]).expect("parameters");
        let least = found.matrix.symmetric_eigenvalues().min();
        println!(
            "joint at {joint_m:?}: least eigenvalue {least:.1e}, reciprocity error {:.1e}",
            found.reciprocity_error
        );
        assert!(least > 0.0, "{joint_m:?}: {least:e}");
        prove("tank: reciprocity error of the resistance", found.reciprocity_error, 0.015);
    }
}
