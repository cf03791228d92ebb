//! The tables of a sweep, with one row per point.

use super::compute::{Origin, Outcome, Record, Steady};
use super::key::{Group, Key};
use super::point::{Point, Sweep};
use crate::export::table::{Rows, Table};
use crate::text::word;
use sim::groups::Groups;
use sim::params::Robot;
use sim::steady::phase::Ratio;
use sim::trial::quantity::{FLAGELLA, Place, columns as quantities};

/// The description of the columns of varying keys.
pub const VARIES: &str = "key of the robot's file, which varies";

/// A row.
struct Row {
    name: String,
    speeds_rpm: [f64; 2],
    /// Value of each axis of the plan.
    values: Vec<f64>,
    groups: [f64; 4],
    multiples: [f64; 4],
    /// The columns of [`ROBOT`].
    robot: [f64; ROBOT.len()],
    outcome: Outcome,
}

/// A column of real numbers: name, unit, description, and value; a missing value is NaN.
type Real<T> = (&'static str, &'static str, &'static str, fn(&T) -> f64);

const GROUPS: [Real<Row>; 8] = [
    ("group_stiffness", "1", "omega mu l^4/(E I) at 90 rpm, l: contour length of a flagellum", |row| row.groups[0]),
    ("group_spacing", "1", "distance of the shafts over the contour length, d/l", |row| row.groups[1]),
    ("group_pitch", "1", "pitch of the helix over its axial length, pitch/L", |row| row.groups[2]),
    ("group_radius", "1", "radius of the helix over its axial length, R/L", |row| row.groups[3]),
    ("group_stiffness_relative", "1", "group_stiffness over that of the robot `published`", |row| row.multiples[0]),
    ("group_spacing_relative", "1", "group_spacing over that of the robot `published`", |row| row.multiples[1]),
    ("group_pitch_relative", "1", "group_pitch over that of the robot `published`", |row| row.multiples[2]),
    ("group_radius_relative", "1", "group_radius over that of the robot `published`", |row| row.multiples[3]),
];

/// The columns that describe the robot.
pub const ROBOT: [Real<Robot>; 11] = [
    ("axial_length_m", "m", "axial length of a flagellum, L", |robot| robot.flagellum.axial_length_m),
    ("contour_length_m", "m", "contour length of a flagellum, l", |robot| robot.flagellum.helix(0).contour_length()),
    ("pitch_m", "m", "pitch of the helix", |robot| robot.flagellum.pitch_m),
    ("helix_radius_m", "m", "radius of the helix, R", |robot| robot.flagellum.helix_radius_m),
    ("rod_radius_m", "m", "radius of the rod", |robot| robot.flagellum.rod_radius_m),
    ("motor_distance_m", "m", "distance of the shafts, d", |robot| robot.base.motor_distance_m),
    ("young_pa", "Pa", "Young's modulus, E", |robot| robot.flagellum.young_pa),
    ("bend_nm2", "N m2", "bending stiffness, E I", |robot| robot.flagellum.stiffness().bend_nm2),
    ("viscosity_pa_s", "Pa s", "dynamic viscosity, mu", |robot| robot.fluid.viscosity()),
    (
        "righting_nm",
        "N m",
        "righting moment at a tilt of 90 degrees: mass, gravity and the height of the joint",
        |robot| robot.base.mass_kg * robot.base.gravity_m_s2 * robot.base.mass_centre_below_joint_m,
    ),
    ("tether_nm_per_rad", "N m/rad", "stiffness of the tether", |robot| robot.joint.tether_full_nm_per_rad),
];

impl Row {
    /// Does not keep the robot itself, which is larger than the row.
    fn new(point: Point, outcome: Outcome) -> Self {
        let robot = point.robot.as_ref();
        let groups = robot.map(Groups::of).map(|groups| Group::ALL.map(|group| group.of(&groups)));
        Self {
            name: point.name.to_string(),
            speeds_rpm: point.speeds_rpm,
            groups: groups.unwrap_or([f64::NAN; 4]),
            multiples: point.multiples,
            robot: ROBOT.map(|(.., value)| robot.map_or(f64::NAN, value)),
            values: point.values,
            outcome,
        }
    }
}

/// Returns the table of these results.
pub fn table(sweep: &Sweep, records: Vec<Record>) -> Table {
    let rows = records.into_iter().map(|record| Row::new(sweep.point(record.index), record.outcome));
    let rows: Vec<Row> = rows.collect();
    let rows = Rows(&rows);
    let mut columns = vec![
        rows.text("point", "name of the point: hash of its inputs and of the version of the model's results", |row| {
            row.name.clone()
        }),
        rows.exact("w1_rpm", "rpm", "speed of flagellum 1, counter-clockwise seen from above", |row| row.speeds_rpm[0]),
        rows.exact("w2_rpm", "rpm", "speed of flagellum 2", |row| row.speeds_rpm[1]),
    ];
    for (at, axis) in sweep.plan.axes.iter().enumerate() {
        if let Key::Robot(key) = &axis.key {
            columns.push(rows.exact(key.replace('.', "_"), unit(key), VARIES, |row| row.values[at]));
        }
    }
    columns.extend(GROUPS.map(|(name, unit, about, value)| rows.exact(name, unit, about, value)));
    for (at, (name, unit, about, _)) in ROBOT.into_iter().enumerate() {
        columns.push(rows.exact(name, unit, about, |row| row.robot[at]));
    }
    let mut steady = |name: String, unit, about: String, value: &dyn Fn(&Row, &Steady) -> f64| {
        let value = |row: &Row| row.outcome.as_ref().map_or(f64::NAN, |steady| value(row, steady));
        columns.push(rows.exact(name, unit, about, value));
    };
    let quantities: Vec<_> = quantities(FLAGELLA).filter(|column| column.is_in(Place::Sweep)).collect();
    for column in &quantities {
        steady(column.name.clone(), column.quantity.unit, column.about(), &|_, s| s.values[column.index()]);
    }
    // A single starting phase has no spread if other phases may give other values.
    let least = |row: &Row| 1 + u32::from(Ratio::of(row.speeds_rpm).is_some());
    for column in quantities.iter().filter(|column| column.is_angle()) {
        let about = "largest less smallest value of the starting phases; 0 where they do not matter, empty if only one was tried".to_owned();
        steady(column.spread(), "deg", about, &|row, s| {
            if s.phases >= least(row) { s.spreads[column.index()] } else { f64::NAN }
        });
    }
    for column in &quantities {
        let Some(name) = column.error() else { continue };
        let about = format!("standard error of {}; empty if unknown", column.name);
        steady(name, column.quantity.unit, about, &|_, s| s.standard_errors[column.index()].unwrap_or(f64::NAN));
    }
    let phases = rows.int("phases", "1", "number of starting phases; 0 if the point failed", |row| {
        row.outcome.as_ref().map_or(0, |steady| steady.phases.into())
    });
    columns.push(phases);
    columns.push(rows.text(
        "kind",
        "`steady`: the motion repeats; `beating`: it was not found to, but its means are known; `not_found`: they are not; \
         `overturned`: the base turned over, and the angles are empty",
        |row| kind(&row.outcome),
    ));
    let status = |row: &Row| if row.outcome.is_err() { "failed" } else { "ok" }.to_owned();
    columns.push(rows.text("status", "`ok`, or `failed`: then all results are empty", status));
    let reason = |row: &Row| row.outcome.as_ref().err().cloned().unwrap_or_default();
    columns.push(rows.text("reason", "why the point failed", reason));
    let plan = &sweep.plan;
    let header = vec![
        format!("biflag sweep {}, version {} of the model's results", plan.name, sweep.results),
        format!("robot {}, method {}, at most {} s", plan.robot.name, word(&plan.method), plan.run_s),
        "angles rotate body axes into world axes: yaw about z, then pitch about y, then roll about x".to_owned(),
    ];
    Table { header, columns }
}

/// Returns the table of the costs of these results, each with the number of its origin.
pub fn cost_table(records: &[(u32, Record)], origins: &[Origin]) -> Table {
    let rows = Rows(records);
    let sweeps = "sweeps of the solver over all starting phases; 0 if the point failed";
    let origin = |of: u32| &origins[of as usize];
    let columns = vec![
        rows.text("point", "name of the point, as in the table of the sweep", |(_, record)| record.name.to_string()),
        rows.exact("processor_s", "s", "processor time", |(_, record)| record.cost.processor_s),
        rows.int("sweeps", "1", sweeps, |(_, record)| record.cost.sweeps as i64),
        rows.text("kind", "kind of the steady state; empty if the point failed", |(_, record)| kind(&record.outcome)),
        rows.text("host", "computer on which the point was computed", |(of, _)| origin(*of).host.clone()),
        rows.text("program", "version and commit of the program", |(of, _)| origin(*of).program.clone()),
    ];
    Table { header: vec!["what the points of a sweep cost, and where they were computed".to_owned()], columns }
}

fn kind(outcome: &Outcome) -> String {
    outcome.as_ref().map_or("", |steady| steady.kind.name()).to_owned()
}

/// Returns the unit of a key of the robot's file, from its name.
fn unit(key: &str) -> &'static str {
    const UNITS: [(&str, &str); 17] = [
        ("_nm_per_rad", "N m/rad"),
        ("_kg_m3", "kg/m3"),
        ("_pa_s", "Pa s"),
        ("_m_s2", "m/s2"),
        ("_m_s", "m/s"),
        ("_nms", "N m s"),
        ("_nm", "N m"),
        ("_kg", "kg"),
        ("_pa", "Pa"),
        ("_rad", "rad"),
        ("_deg", "deg"),
        ("temperature_c", "degC"),
        ("_step_s", "s"),
        ("_m", "m"),
        ("_n", "N"),
        ("_radii", "1"),
        ("", "1"),
    ];
    UNITS.into_iter().find(|(end, _)| key.ends_with(end)).map_or("1", |(_, unit)| unit)
}

#[cfg(test)]
mod tests {
    use super::super::key::numbers;
    use super::*;

    #[test]
    fn units_follow_from_the_keys() {
        for (key, wanted) in [
            ("fluid.viscosity_pa_s", "Pa s"),
            ("flagellum.young_pa", "Pa"),
            ("flagellum.pitch_m", "m"),
            ("contact.slip_speed_m_s", "m/s"),
            ("base.gravity_m_s2", "m/s2"),
            ("fluid.density_kg_m3", "kg/m3"),
            ("joint.tether_full_nm_per_rad", "N m/rad"),
            ("joint.viscous_nms", "N m s"),
            ("solver.longest_step_s", "s"),
            ("solver.sweeps", "1"),
            ("flagellum.poisson", "1"),
        ] {
            assert_eq!(unit(key), wanted, "{key}");
        }
        let robot = toml::Value::try_from(Robot::default()).unwrap();
        for key in numbers(&robot) {
            let has_unit = key.ends_with("_m") || key.ends_with("_s") || key.ends_with("_kg");
            assert!(!has_unit || unit(&key) != "1", "{key}");
        }
    }
}
