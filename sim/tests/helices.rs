//! Rigid helices with the default regularisation and spin drag, against measurements, slender-body theories and a resolved
//! surface: `tests/data/helices`.

use crate::common::{Series, prove};
use crate::fluid::lighthill;
use sim::V3;
use sim::fluid::mobility::rigid_resistance;
use sim::params::{Fluid, Robot};
use sim::rod::helix::{Handedness, Helix};
use std::f64::consts::PI;

/// Edges over the regularisation: half of it changes no figure by 1 %.
const EDGE: f64 = 1.0;

/// Shape of a helix and thrust, torque and drag, in units of its radius, see the data.
#[derive(Clone, Copy, Debug)]
struct Row {
    pitch: f64,
    axial_length: f64,
    rod_radius: f64,
    values: [f64; 3],
}

impl Row {
    fn helix(&self) -> Helix {
        Helix { radius: 1.0, pitch: self.pitch, axial_length: self.axial_length, handedness: Handedness::Right }
    }
}

fn rows(name: &str) -> Vec<Row> {
    let table = Series::open("helices", name);
    let [pitch, axial_length, rod_radius, thrust, torque, drag] =
        ["pitch", "axial_length", "rod_radius", "thrust", "torque", "drag"].map(|column| table.column(column));
    (0..pitch.len())
        .map(|i| Row {
            pitch: pitch[i],
            axial_length: axial_length[i],
            rod_radius: rod_radius[i],
            values: [thrust[i], torque[i], drag[i]],
        })
        .collect()
}

/// Thrust, torque and drag of the model's helix, in units of its radius.
fn model(row: &Row, fluid: &Fluid, edge: f64) -> [f64; 3] {
    let helix = Helix { radius: 1.0, pitch: row.pitch, axial_length: row.axial_length, handedness: Handedness::Right };
    let epsilon = fluid.regularisation_radii * row.rod_radius;
    let nodes = helix.nodes((helix.contour_length() / (edge * epsilon)).ceil() as usize);
    let couple = fluid.spin_drag * 4.0 * PI * row.rod_radius * row.rod_radius;
    let resistance = rigid_resistance(&[&nodes], V3::zeros(), epsilon, 1.0, couple).expect("regular");
    let found = [-resistance[(2, 5)], resistance[(5, 5)], resistance[(2, 2)]];
    println!("{row:?}: {found:.3?}");
    found
}

const NAMES: [&str; 3] = ["thrust", "torque", "drag"];

#[test]
fn measured_helices() {
    for row in rows("measured.csv") {
        let found = model(&row, &Fluid::default(), EDGE);
        // The helix of the longest pitch was measured 12 % above slender-body theory.
        let bound = if row.pitch > 15.0 { 0.12 } else { 0.1 };
        for ((name, found), measured) in NAMES.iter().zip(found).zip(row.values) {
            let check = format!("rigid helix of pitch {:.2} R: {name} against the measured, relative", row.pitch);
            prove(&check, (found / measured - 1.0).abs(), bound);
        }
    }
}

#[test]
fn longest_measured_helix_of_slender_body_theory() {
    let row = rows("measured.csv")[2];
    let [thrust, _, drag] = model(&row, &Fluid { spin_drag: 0.0, ..Fluid::default() }, EDGE);
    let (thrust_theory, _) = lighthill(&row.helix(), row.rod_radius, 400, |x| V3::z().cross(x));
    let (drag_theory, _) = lighthill(&row.helix(), row.rod_radius, 400, |_| V3::z());
    println!("slender-body theory: thrust {thrust_theory:.3}, drag {:.3}", -drag_theory);
    prove("longest measured helix: thrust against slender-body theory", (thrust / thrust_theory - 1.0).abs(), 0.03);
    prove("longest measured helix: drag against slender-body theory", (drag / -drag_theory - 1.0).abs(), 0.03);
}

#[test]
fn thin_helix_of_three_theories() {
    let [least, most] = rows("theories.csv")[..] else { panic!("two rows") };
    let found = model(&least, &Fluid::default(), EDGE);
    for (c, name) in NAMES.iter().enumerate() {
        let outside = (least.values[c] / found[c] - 1.0).max(found[c] / most.values[c] - 1.0).max(0.0);
        prove(&format!("thin rigid helix: {name} outside of three theories, relative"), outside, 0.02);
    }
}

#[test]
fn published_helix_with_its_surface_resolved() {
    let row = rows("resolved.csv")[0];
    let found = model(&row, &Fluid::default(), EDGE);
    for ((name, found), (resolved, bound)) in
        NAMES.iter().zip(found).zip(row.values.into_iter().zip([0.02, 0.05, 0.02]))
    {
        prove(
            &format!("published rigid helix: {name} against its resolved surface, relative"),
            (found / resolved - 1.0).abs(),
            bound,
        );
    }
    let published = model(&row, &Robot::published().fluid, EDGE)[1] / row.values[1];
    assert!((0.64..0.66).contains(&published), "torque of `published` over the resolved one: {published}");
    let fine = model(&row, &Fluid::default(), 0.5 * EDGE);
    let change = found.iter().zip(fine).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
    prove("published rigid helix: half the edge length, relative", change, 1e-2);
}
