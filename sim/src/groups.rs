//! The four dimensionless groups that transfer a map of speeds to other robots, and robots with given groups.
//!
//! The publication (Hao, Zalavadia, Jawed, RoboSoft 2024, arXiv 2405.02291) names them: omega mu l^4/(E I), d/l,
//! pitch/L and R/L with the contour length l and the axial length L of a flagellum. Without inertia of the fluid, two
//! robots with the same groups, the same ratios of all other lengths to L, and the same moments over mu omega l^3 have
//! the same angles at the same speeds.

use crate::functions::{hypot, powi};
use crate::params::Robot;
use crate::rod::Stiffness;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// The speed of the motors in [`Groups::stiffness`], rpm: the largest of the published map.
pub const SPEED_RPM: f64 = 90.0;

/// The four groups of a robot, dimensionless.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Groups {
    /// omega mu l^4/(E I) at [`SPEED_RPM`]: viscous over elastic forces. Larger values mean softer flagella.
    pub stiffness: f64,
    /// Distance of the shafts over the contour length, d/l.
    pub spacing: f64,
    /// Pitch of the helix over its axial length, pitch/L.
    pub pitch: f64,
    /// Radius of the helix over its axial length, R/L.
    pub radius: f64,
}

impl Groups {
    /// Returns the groups of a robot.
    pub fn of(robot: &Robot) -> Self {
        let flagellum = &robot.flagellum;
        let contour = flagellum.helix(0).contour_length();
        Self {
            stiffness: viscous(robot.fluid.viscosity(), contour) / flagellum.stiffness().bend_nm2,
            spacing: robot.base.motor_distance_m / contour,
            pitch: flagellum.pitch_m / flagellum.axial_length_m,
            radius: flagellum.helix_radius_m / flagellum.axial_length_m,
        }
    }

    /// Returns the robot with these groups that is otherwise similar to `like`, `size` times as large in a fluid
    /// `viscosity` times as viscous.
    ///
    /// L gives the pitch and radius of the helix and so the contour length l; l gives the distance of the shafts and
    /// Young's modulus. All other lengths keep their ratio to L. The righting moment, the tether, the friction of the
    /// joint and the inertia (over omega) keep their ratio to mu omega l^3. The net weight of a rod per length keeps
    /// its ratio to mu omega l. The mass centre sets the righting moment, the density of the rods their net weight. A
    /// turn of the helix has at least as many edges as in `like`. A glycerol mixture is replaced by its viscosity and
    /// density.
    ///
    /// The robot may be impossible, see [`Robot::validate`].
    pub fn robot(&self, like: &Robot, size: f64, viscosity: f64) -> Robot {
        let mut robot = like.clone();
        robot.fluid.viscosity_pa_s = viscosity * like.fluid.viscosity();
        robot.fluid.density_kg_m3 = like.fluid.density();
        robot.fluid.glycerol = None;

        let (old, new) = (&like.flagellum, &mut robot.flagellum);
        new.axial_length_m *= size;
        new.rod_radius_m *= size;
        new.pitch_m = self.pitch * new.axial_length_m;
        new.helix_radius_m = self.radius * new.axial_length_m;
        let contour = new.helix(0).contour_length();
        let longer = contour / old.helix(0).contour_length();
        let round = Stiffness::solid_round(new.rod_radius_m, 1.0, new.poisson);
        new.young_pa = viscous(robot.fluid.viscosity_pa_s, contour) / (self.stiffness * round.bend_nm2);
        let net_density = old.density_kg_m3 - robot.fluid.density_kg_m3;
        new.density_kg_m3 = robot.fluid.density_kg_m3 + net_density * viscosity * longer / (size * size);
        let turn = |radius: f64, pitch: f64| hypot(TAU * radius, pitch);
        let shorter_turn = turn(new.helix_radius_m, new.pitch_m) / turn(old.helix_radius_m, old.pitch_m);
        new.edge_length_m *= size.min(shorter_turn);

        robot.base.motor_distance_m = self.spacing * contour;
        robot.base.radius_m *= size;
        robot.base.height_m *= size;
        robot.head.radius_m *= size;
        robot.head.length_m *= size;
        robot.head.centre_m = robot.head.centre_m.map(|m| m * size);
        robot.contact.tolerance_m *= size;
        robot.contact.slip_speed_m_s *= size;
        if let Some(tank) = &mut robot.tank {
            tank.length_m *= size;
            tank.width_m *= size;
            tank.height_m *= size;
            tank.joint_m = tank.joint_m.map(|m| m * size);
            tank.joint_depth_m *= size;
        }

        let moments = viscosity * powi(longer, 3);
        robot.base.mass_centre_below_joint_m *= moments;
        robot.base.inertia_kg_m2 = robot.base.inertia_kg_m2.map(|inertia| inertia * moments);
        robot.joint.tether_full_nm_per_rad *= moments;
        robot.joint.tether_lumped_nm_per_rad *= moments;
        robot.joint.viscous_nms *= moments;
        robot.joint.coulomb_nm *= moments;
        robot
    }
}

/// Returns omega mu l^4 in N m2, from the viscosity (Pa s) and the contour length (m).
fn viscous(viscosity: f64, contour: f64) -> f64 {
    SPEED_RPM * PI / 30.0 * viscosity * powi(contour, 4)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-12 * a.abs().max(b.abs()), "{a} {b}");
    }

    fn assert_same(a: &Groups, b: &Groups) {
        for (a, b) in [(a.stiffness, b.stiffness), (a.spacing, b.spacing), (a.pitch, b.pitch), (a.radius, b.radius)] {
            assert_near(a, b);
        }
    }

    #[test]
    fn published_groups_are_those_of_the_publication() {
        let groups = Groups::of(&Robot::published());
        let contour: f64 = (TAU * 0.00889).hypot(0.076) * 0.1962 / 0.076;
        let bend = 1.255e6 * PI * 0.003f64.powi(4) / 4.0;
        assert_near(groups.stiffness, 3.0 * PI * contour.powi(4) / bend);
        assert_near(groups.spacing, 0.045 / contour);
        assert_near(groups.pitch, 0.076 / 0.1962);
        assert_near(groups.radius, 0.00889 / 0.1962);
        assert_same(&groups, &Groups::of(&Robot::default()));
    }

    #[test]
    fn a_robot_has_the_groups_that_it_was_made_with() {
        let like = Robot::default();
        let groups = Groups { stiffness: 900.0, spacing: 0.3, pitch: 0.3, radius: 0.06 };
        let robot = groups.robot(&like, 2.0, 3.0);
        robot.validate().unwrap();
        assert_same(&Groups::of(&robot), &groups);
        assert_near(robot.flagellum.axial_length_m, 2.0 * like.flagellum.axial_length_m);
        assert_near(robot.flagellum.rod_radius_m, 2.0 * like.flagellum.rod_radius_m);
        assert_near(robot.fluid.viscosity_pa_s, 3.0 * like.fluid.viscosity_pa_s);
        let contour = |robot: &Robot| robot.flagellum.helix(0).contour_length();
        let scale = |robot: &Robot| robot.fluid.viscosity() * contour(robot).powi(3);
        let righting =
            |robot: &Robot| robot.base.mass_kg * robot.base.gravity_m_s2 * robot.base.mass_centre_below_joint_m;
        let weight = |robot: &Robot| robot.net_weight() / (robot.fluid.viscosity() * contour(robot));
        assert_near(righting(&robot) / scale(&robot), righting(&like) / scale(&like));
        assert_near(weight(&robot), weight(&like));
        assert_near(
            robot.joint.tether_full_nm_per_rad / scale(&robot),
            like.joint.tether_full_nm_per_rad / scale(&like),
        );
        let edges_a_turn = |robot: &Robot| robot.flagellum.edges() as f64 * groups_pitch(robot);
        assert!(edges_a_turn(&robot) > 0.98 * edges_a_turn(&like));
    }

    fn groups_pitch(robot: &Robot) -> f64 {
        Groups::of(robot).pitch
    }

    #[test]
    fn its_own_groups_give_the_robot_itself() {
        let like = Robot::published();
        let robot = Groups::of(&like).robot(&like, 1.0, 1.0);
        assert_near(robot.flagellum.young_pa, like.flagellum.young_pa);
        assert_near(robot.base.motor_distance_m, like.base.motor_distance_m);
        assert_near(robot.flagellum.density_kg_m3, like.flagellum.density_kg_m3);
        assert_eq!(robot.flagellum.edges(), like.flagellum.edges());
    }
}
