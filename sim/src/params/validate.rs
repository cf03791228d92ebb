//! Limits of the parameters, with their reasons.

use super::{ParamError, Robot};
use crate::functions::{cos, hypot, powi};
use std::f64::consts::{PI, TAU};

/// Shortest regularisation, in lengths of an edge, for which the series of [`crate::fluid::near`] is good to 1e-11.
const LEAST_EPSILON: f64 = 0.15;

/// Checks a value; the error names its key and the bounds.
pub(crate) fn within(key: &'static str, value: f64, low: f64, high: f64) -> Result<(), ParamError> {
    if value >= low && value <= high {
        return Ok(());
    }
    // Seven digits, without the rounding of a product.
    Err(ParamError { key, value, reason: format!("must be between {} and {}", low as f32, high as f32) })
}

pub(super) fn refuse(key: &'static str, value: f64, reason: impl Into<String>) -> Result<(), ParamError> {
    Err(ParamError { key, value, reason: reason.into() })
}

impl Robot {
    /// Checks every value; the error names the key and says why.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.validate_base()?;
        self.validate_flagellum()?;
        self.validate_fluid()?;
        let rod = self.flagellum.rod_radius_m;
        self.head.validate(&self.shaft_feet(), self.flagellum.helix_radius_m + rod, rod)?;
        if let Some(tank) = &self.tank {
            tank.validate(self)?;
        }
        let (joint, contact, solver) = (&self.joint, &self.contact, &self.solver);
        within("joint.tether_full_nm_per_rad", joint.tether_full_nm_per_rad, 0.0, 1e3)?;
        within("joint.tether_lumped_nm_per_rad", joint.tether_lumped_nm_per_rad, 0.0, 1e3)?;
        within("joint.viscous_nms", joint.viscous_nms, 0.0, 1e3)?;
        within("joint.coulomb_nm", joint.coulomb_nm, 0.0, 1e3)?;
        let r = self.flagellum.rod_radius_m;
        within("contact.tolerance_m", contact.tolerance_m, 1e-5 * r, 0.1 * r)?;
        within("contact.friction", contact.friction, 0.0, 10.0)?;
        within("contact.slip_speed_m_s", contact.slip_speed_m_s, 1e-9, 1.0)?;
        within("solver.step_rad", solver.step_rad, 1e-4, 1.1)?;
        within("solver.step_error", solver.step_error, 1e-7, 1.0)?;
        within("solver.longest_step_s", solver.longest_step_s, 1e-6, 10.0)?;
        within("solver.tolerance", solver.tolerance, 1e-7, 0.1)?;
        within("solver.halvings", solver.halvings as f64, 0.0, 20.0)?;
        within("solver.sweeps", solver.sweeps as f64, 2.0, 1000.0)?;
        within("solver.near_edges", solver.near_edges as f64, 1.0, 20.0)?;
        within("solver.gauss_points", solver.gauss_points as f64, 2.0, 4.0)
    }

    fn validate_base(&self) -> Result<(), ParamError> {
        let base = &self.base;
        within("base.mass_kg", base.mass_kg, 1e-6, 1e3)?;
        within("base.radius_m", base.radius_m, 1e-6, 1.0)?;
        within("base.height_m", base.height_m, 0.0, 10.0)?;
        within("base.motor_distance_m", base.motor_distance_m, 1e-6, 10.0)?;
        for moment in base.inertia_kg_m2 {
            within("base.inertia_kg_m2", moment, 1e-12, 1e3)?;
        }
        within("base.mass_centre_below_joint_m", base.mass_centre_below_joint_m, -1.0, 1.0)?;
        within("base.rotational_drag", base.rotational_drag, 1e-3, 1e3)?;
        within("base.gravity_m_s2", base.gravity_m_s2, 0.0, 1e3)
    }

    fn validate_flagellum(&self) -> Result<(), ParamError> {
        let f = &self.flagellum;
        within("flagellum.rod_radius_m", f.rod_radius_m, 1e-6, 0.1)?;
        within("flagellum.helix_radius_m", f.helix_radius_m, 0.0, 1.0)?;
        within("flagellum.pitch_m", f.pitch_m, 1e-5, 10.0)?;
        within("flagellum.axial_length_m", f.axial_length_m, 1e-4, 10.0)?;
        for phase in f.phase_deg {
            within("flagellum.phase_deg", phase, -360.0, 360.0)?;
        }
        within("flagellum.young_pa", f.young_pa, 1.0, 1e13)?;
        within("flagellum.poisson", f.poisson, -0.99, 0.5)?;
        within("flagellum.density_kg_m3", f.density_kg_m3, 0.0, 3e4)?;
        within("flagellum.edge_length_m", f.edge_length_m, 1e-6, 1.0)?;
        let (r, radius, advance) = (f.rod_radius_m, f.helix_radius_m, f.pitch_m / TAU);
        let curvature_radius = (radius * radius + advance * advance) / radius.max(1e-300);
        if curvature_radius <= r {
            let reason = format!(
                "the helix is curved more tightly ({curvature_radius:.2e} m) than its rod is thick ({r:.2e} m)"
            );
            return refuse("flagellum.helix_radius_m", radius, reason);
        }
        let nearest = (0..=600)
            .map(|i| PI * (1.0 + i as f64 / 200.0))
            .map(|s| (2.0 * radius * radius * (1.0 - cos(s)) + powi(advance * s, 2)).sqrt())
            .fold(f64::INFINITY, f64::min);
        if nearest <= 2.0 * r && f.axial_length_m > 0.5 * f.pitch_m {
            let reason = format!(
                "the helix touches itself: its turns come within {nearest:.2e} m, the rod is {:.2e} m thick",
                2.0 * r
            );
            return refuse("flagellum.pitch_m", f.pitch_m, reason);
        }
        let gap = self.base.motor_distance_m - 2.0 * (radius + r);
        if gap <= 0.0 {
            let reason = format!("the flagella touch when they turn: needs more than {:.2e} m", 2.0 * (radius + r));
            return refuse("base.motor_distance_m", self.base.motor_distance_m, reason);
        }
        let turn = hypot(TAU * radius, f.pitch_m);
        if f.edge_length_m > turn / 12.0 && radius > 0.1 * r {
            let reason = format!("too long to resolve the helix: at most a twelfth of a turn, {:.2e} m", turn / 12.0);
            return refuse("flagellum.edge_length_m", f.edge_length_m, reason);
        }
        let edges = f.helix(0).contour_length() / f.edge_length_m;
        if !(5.5..1000.5).contains(&edges) {
            let reason = format!("gives {edges:.0} edges a flagellum: needs 6 to 1000");
            return refuse("flagellum.edge_length_m", f.edge_length_m, reason);
        }
        Ok(())
    }

    fn validate_fluid(&self) -> Result<(), ParamError> {
        let fluid = &self.fluid;
        within("fluid.viscosity_pa_s", fluid.viscosity_pa_s, 1e-6, 1e6)?;
        within("fluid.density_kg_m3", fluid.density_kg_m3, 0.0, 3e4)?;
        if let Some(mixture) = fluid.glycerol {
            within("fluid.glycerol.mass_fraction", mixture.mass_fraction, 0.0, 1.0)?;
            within("fluid.glycerol.temperature_c", mixture.temperature_c, 0.0, 100.0)?;
        }
        within("fluid.spin_drag", fluid.spin_drag, 0.0, 10.0)?;
        within("fluid.regularisation_radii", fluid.regularisation_radii, 0.1, 10.0)?;
        // Edges come out a little longer or shorter than asked for.
        let edge = self.flagellum.helix(0).contour_length() / self.flagellum.edges() as f64;
        let share = self.epsilon() / edge;
        if share < LEAST_EPSILON {
            let reason = format!(
                "edges of {edge:.2e} m are more than {:.1} times the regularisation {:.2e} m: the force density would be rough",
                1.0 / LEAST_EPSILON,
                self.epsilon()
            );
            return refuse("flagellum.edge_length_m", self.flagellum.edge_length_m, reason);
        }
        Ok(())
    }
}
