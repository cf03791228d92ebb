//! Numbers of a robot file that are probably in another unit than their key's.

use super::source::{number, real};
use sim::params::Robot;
use toml::Table;

/// Names of units, each with its size in the key's unit.
type Units = &'static [(&'static str, f64)];

const LENGTH: Units = &[("mm", 1e-3), ("cm", 1e-2)];
const TETHER: Units = &[("mN m/rad", 1e-3), ("N m/deg", 180.0 / std::f64::consts::PI)];

/// Keys, the usual range of their magnitudes, and units in which a value may be written by mistake. A number outside the range is
/// doubted only if it is inside the range in such a unit. The ranges of lengths are narrow enough to doubt even the centimetres
/// of a table-top robot.
const ROWS: [(&str, [f64; 2], Units); 24] = [
    ("base.mass_kg", [2e-3, 5.0], &[("g", 1e-3)]),
    ("base.radius_m head.radius_m", [1e-3, 0.3], LENGTH),
    ("base.height_m head.length_m", [1e-3, 0.8], LENGTH),
    ("base.motor_distance_m flagellum.pitch_m", [2e-3, 1.0], LENGTH),
    ("base.inertia_kg_m2", [1e-7, 1e-3], &[("g m2", 1e-3), ("kg mm2", 1e-6), ("g cm2", 1e-7), ("g mm2", 1e-9)]),
    ("base.mass_centre_below_joint_m", [5e-5, 0.05], LENGTH),
    ("base.gravity_m_s2", [1.5, 30.0], &[("mm/s2", 1e-3), ("cm/s2", 1e-2), ("ft/s2", 0.3048), ("g", 9.80665)]),
    ("flagellum.rod_radius_m", [1e-4, 0.03], LENGTH),
    ("flagellum.helix_radius_m", [5e-4, 0.1], LENGTH),
    ("flagellum.axial_length_m", [5e-3, 3.0], LENGTH),
    ("flagellum.edge_length_m", [2e-4, 0.1], LENGTH),
    ("flagellum.young_pa", [1e4, 1e12], &[("kPa", 1e3), ("MPa", 1e6), ("GPa", 1e9)]),
    ("flagellum.density_kg_m3 fluid.density_kg_m3", [300.0, 25e3], &[("g/cm3", 1e3)]),
    ("fluid.viscosity_pa_s", [2e-4, 200.0], &[("mPa s", 1e-3)]),
    ("fluid.glycerol.mass_fraction", [0.01, 1.0], &[("%", 1e-2)]),
    ("head.centre_m", [5e-4, 0.5], LENGTH),
    ("tank.length_m tank.width_m tank.height_m tank.joint_m tank.joint_depth_m", [0.01, 5.0], LENGTH),
    ("joint.tether_full_nm_per_rad joint.tether_lumped_nm_per_rad", [2e-5, 0.02], TETHER),
    // Larger values would hold the robot against its motors.
    ("joint.viscous_nms", [1e-9, 5e-3], &[("mN m s", 1e-3)]),
    ("joint.coulomb_nm", [1e-9, 5e-3], &[("mN m", 1e-3)]),
    ("contact.tolerance_m", [1e-8, 1e-3], &[("mm", 1e-3), ("µm", 1e-6)]),
    ("contact.slip_speed_m_s", [1e-7, 0.02], &[("mm/s", 1e-3)]),
    ("solver.step_rad", [1e-4, 1.1], &[("degrees", std::f64::consts::PI / 180.0)]),
    ("solver.longest_step_s", [1e-6, 10.0], &[("ms", 1e-3)]),
];

/// Returns a sentence for each key of a robot file whose number is probably in another unit.
pub(super) fn doubts(text: &str) -> Vec<String> {
    let Ok(table) = text.parse::<Table>() else { return Vec::new() };
    let doubt = |(key, [least, most], units): (&str, [f64; 2], Units)| {
        let (head, rest) = key.split_once('.')?;
        let value = rest.split('.').try_fold(table.get(head)?, |value, key| value.get(key))?;
        let values = value.as_array().map_or(std::slice::from_ref(value), Vec::as_slice);
        let numbers: Vec<f64> = values.iter().map(real).collect::<Option<_>>()?;
        let is_usual = |value: f64| (least..=most).contains(&value.abs());
        // Of several coordinates or moments, the largest is judged.
        let largest =
            numbers.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())).filter(|value| !is_usual(*value))?;
        let fits = units.iter().filter(|(_, size)| is_usual(largest * size));
        // Seven digits, so that a product is as short as its factor.
        let (names, written): (Vec<&str>, Vec<String>) =
            fits.map(|(unit, size)| (*unit, number((largest * size) as f32))).unzip();
        let (names, written) = (names.join(" or "), written.join(" or "));
        (!names.is_empty()).then(|| format!("{key} = {}: is that in {names}? write {written}", number(largest)))
    };
    let keys = ROWS.iter().flat_map(|(keys, usual, units)| keys.split(' ').map(move |key| (key, *usual, *units)));
    keys.filter_map(doubt).chain(of_mixture(&table).unwrap_or_default()).collect()
}

/// Returns sentences about a mixture of glycerol: its temperature, and values that it replaces.
fn of_mixture(table: &Table) -> Option<Vec<String>> {
    let fluid = table.get("fluid")?;
    let celsius = fluid.get("glycerol")?.get("temperature_c").and_then(real);
    let unused = ["viscosity_pa_s", "density_kg_m3"].into_iter().filter(|key| fluid.get(key).is_some());
    let unused = unused.map(|key| format!("fluid.{key} has no effect beside fluid.glycerol: leave one of them out"));
    Some(unused.chain(celsius.and_then(temperature)).collect())
}

/// Returns a sentence about a temperature of glycerol that is probably not in °C.
pub(crate) fn temperature(celsius: f64) -> Option<String> {
    let is_usual = |celsius: f64| (5.0..=55.0).contains(&celsius);
    let others = [("°F", (celsius - 32.0) / 1.8), ("K", celsius - 273.15)];
    let (unit, own) = others.into_iter().find(|other| is_usual(other.1))?;
    (!is_usual(celsius)).then(|| format!("temperature of {} °C: is that in {unit}? write {own:.1}", number(celsius)))
}

/// Returns a sentence about the radius that makes an impossible robot possible if it is halved.
pub(super) fn diameter(robot: &Robot) -> Option<String> {
    type Field = fn(&mut Robot) -> &mut f64;
    let radii: [(&str, Field); 3] = [
        ("flagellum.helix_radius_m", |robot| &mut robot.flagellum.helix_radius_m),
        ("flagellum.rod_radius_m", |robot| &mut robot.flagellum.rod_radius_m),
        ("head.radius_m", |robot| &mut robot.head.radius_m),
    ];
    radii.into_iter().find_map(|(key, of)| {
        let (mut halved, mut default) = (robot.clone(), Robot::default());
        *of(&mut halved) *= 0.5;
        let half = *of(&mut halved);
        let is_set = *of(&mut default) != 2.0 * half;
        (is_set && halved.validate().is_ok()).then(|| format!("is {key} the diameter? write {}", number(half)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Shipped;
    use sim::params::BUILT_IN;

    /// The numbers of `physical`, each written in another unit.
    #[test]
    fn number_in_another_unit_is_named_with_its_unit() {
        for (table, key, said) in [
            ("base", "mass_kg = 94", "g? write 0.094"),
            ("base", "radius_m = 13.5", "mm or cm? write 0.0135 or 0.135"),
            ("base", "height_m = 3.75", "mm or cm? write 0.00375 or 0.0375"),
            ("base", "inertia_kg_m2 = [16300, 16300, 9100]", "g mm2? write 1.63e-5"),
            ("base", "mass_centre_below_joint_m = 2", "mm or cm? write 0.002 or 0.02"),
            ("base", "inertia_kg_m2 = [0.0163, 0.0163, 0.0091]", "g m2? write 1.63e-5"),
            ("base", "gravity_m_s2 = 980.665", "cm/s2? write 9.80665"),
            ("base", "gravity_m_s2 = 1", "g? write 9.80665"),
            ("flagellum", "rod_radius_m = 0.3", "mm or cm? write 0.0003 or 0.003"),
            ("flagellum", "helix_radius_m = 8.89", "mm or cm? write 0.00889 or 0.0889"),
            ("flagellum", "pitch_m = 76", "mm or cm? write 0.076 or 0.76"),
            ("flagellum", "axial_length_m = 196.2", "mm or cm? write 0.1962 or 1.962"),
            ("flagellum", "young_pa = 1.255", "MPa or GPa? write 1255000 or 1.255e9"),
            ("flagellum", "young_pa = 1255", "kPa or MPa? write 1255000 or 1.255e9"),
            ("flagellum", "density_kg_m3 = 1.45", "g/cm3? write 1450"),
            ("fluid", "viscosity_pa_s = 1000", "mPa s? write 1"),
            ("fluid", "glycerol = { mass_fraction = 85, temperature_c = 20 }", "%? write 0.85"),
            ("fluid", "glycerol = { mass_fraction = 0.85, temperature_c = 72 }", "°F? write 22.2"),
            ("fluid", "glycerol = { mass_fraction = 0.85, temperature_c = 295.3 }", "K? write 22.2"),
            ("joint", "tether_full_nm_per_rad = 0.5006", "mN m/rad? write 0.0005006"),
            ("joint", "tether_full_nm_per_rad = 8.74e-6", "N m/deg? write 0.0005007651"),
            ("base", "gravity_m_s2 = 32.17", "ft/s2? write 9.805416"),
            ("joint", "viscous_nms = 0.02", "mN m s? write 2e-5"),
            ("joint", "coulomb_nm = 0.01", "mN m? write 1e-5"),
            ("solver", "step_rad = 17.2", "degrees? write 0.30019"),
        ] {
            let found = doubts(&format!("[{table}]\n{key}\n"));
            assert!(matches!(&found[..], [one] if one.contains(&format!(": is that in {said}"))), "{key}: {found:?}");
        }
    }

    #[test]
    fn a_viscosity_beside_a_mixture_is_said_to_have_no_effect() {
        let found = doubts("[fluid]\nviscosity_pa_s = 1.0\nglycerol = { mass_fraction = 0.85, temperature_c = 20 }\n");
        assert!(matches!(&found[..], [one] if one.starts_with("fluid.viscosity_pa_s has no effect")), "{found:?}");
    }

    #[test]
    fn usual_robots_are_not_doubted() {
        for name in BUILT_IN {
            assert_eq!(doubts(&toml::to_string(&Robot::built_in(name).unwrap()).unwrap()), [""; 0], "{name}");
        }
        for file in Shipped::all().filter(|file| file.is_robot()) {
            assert_eq!(doubts(file.text), [""; 0], "{}", file.name);
        }
        for rare in ["young_pa = 4e4", "young_pa = 2e11", "density_kg_m3 = 0", "rod_radius_m = 1e-5"] {
            assert_eq!(doubts(&format!("[flagellum]\n{rare}\n")), [""; 0]);
        }
    }
}
