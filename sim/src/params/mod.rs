//! Every parameter of a robot, its fluid and the solver: unit, default, source, effect of a bad value.
//!
//! Keys carry their unit where they have one; everything is SI. The defaults are the robot `physical`: the
//! published robot (Hao, Zalavadia, Jawed, RoboSoft 2024, arXiv 2405.02291, "the publication" below) with round rods.
//! [`Robot::published`] has the laboratory's choices, which reproduce the published angles. [`Robot::validate`] names
//! the key and the reason of an impossible value; unknown keys fail when a file is read.
//!
//! At 90 rpm the Reynolds number rho_f omega R r/mu is about 0.3, above the 0.1 that the publication
//! states: Stokes flow is an approximation there.

mod built_in;
mod closure;
mod head;
mod solver;
mod tank;
mod validate;

pub use built_in::BUILT_IN;
pub use closure::Closure;
pub use head::{Head, HeadShape};
pub use solver::{Precision, SolverSettings};
pub use tank::{Face, Tank};
pub(crate) use validate::within;

use crate::functions::{exp, pow, powi};
use crate::rod::{
    Stiffness,
    helix::{Handedness, Helix},
    spin::SpinDrag,
};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// An impossible parameter.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} = {value}: {reason}")]
pub struct ParamError {
    /// Dotted key, as in the file.
    pub key: &'static str,
    /// Its value.
    pub value: f64,
    /// Why it is impossible, and what is possible.
    pub reason: String,
}

/// The robot, its fluid and the solver's settings.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Robot {
    /// The rigid base on its ball joint.
    pub base: Base,
    /// Both flagella.
    pub flagellum: Flagellum,
    /// The fluid.
    pub fluid: Fluid,
    /// The effect of the base on the fluid.
    pub head: Head,
    /// The tank around it; without one the fluid is unbounded.
    pub tank: Option<Tank>,
    /// Ball joint and tether.
    pub joint: Joint,
    /// Contact between flagella.
    pub contact: Contact,
    /// Time steps and tolerances.
    pub solver: SolverSettings,
}

/// The base: a cylinder that holds both motors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Base {
    /// Mass in kg (0.094, publication). Only the righting moment depends on it.
    pub mass_kg: f64,
    /// Radius in m (0.0135, publication). The base's drag grows with its cube.
    pub radius_m: f64,
    /// Height from the joint down to the shafts' feet in m (0.0375, publication): the lever of lateral forces.
    pub height_m: f64,
    /// Distance of the shafts in m (0.045, publication). If it is too small, the flagella touch at rest.
    pub motor_distance_m: f64,
    /// Principal moments of inertia about x_B, y_B, z_B in kg m2 (1.63e-5, 1.63e-5, 0.91e-5, from a commented table of the
    /// publication's source). Their effect lasts only milliseconds.
    pub inertia_kg_m2: [f64; 3],
    /// Mass centre below the joint in m (0.002, publication): an effective value, since m g r_m includes everything that
    /// hangs from the joint. With zero, nothing rights the robot.
    pub mass_centre_below_joint_m: f64,
    /// Coefficient C_r of the base's rotational drag 2 pi mu C_r r_h^3 (2.3, publication).
    pub rotational_drag: f64,
    /// Acceleration of gravity in m/s2 (9.80665).
    pub gravity_m_s2: f64,
    /// Whether the flagella's net weight acts on the base too (false: `mass_centre_below_joint_m` already includes it).
    /// Their elastic rods carry it in any case. The published pitch decides: at (50, 10), the pitch is -1.62 degrees
    /// with this weight and -4.23 without it, against 3.29 in the publication's simulation and 4.96 in its experiment
    /// (|pitch|; `published`, closure `full`, 120 s). The closure `paper` has no such weight.
    pub flagella_weight_on_base: bool,
}

impl Default for Base {
    fn default() -> Self {
        Self {
            mass_kg: 0.094,
            radius_m: 0.0135,
            height_m: 0.0375,
            motor_distance_m: 0.045,
            inertia_kg_m2: [1.63e-5, 1.63e-5, 0.91e-5],
            mass_centre_below_joint_m: 0.002,
            rotational_drag: 2.3,
            gravity_m_s2: 9.80665,
            flagella_weight_on_base: false,
        }
    }
}

/// A flagellum: a round elastic rod, at rest a helix.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Flagellum {
    /// Radius of the rod in m (0.003: the publication prints 6 mm as a radius, but its pitch angles
    /// match 3 mm and come out three times too large with 6 mm). The bending stiffness grows with its fourth power.
    pub rod_radius_m: f64,
    /// Radius of the helix in m (0.00889, publication).
    pub helix_radius_m: f64,
    /// Pitch in m (0.076, publication).
    pub pitch_m: f64,
    /// Length along the axis in m (0.1962, publication).
    pub axial_length_m: f64,
    /// Winding of flagellum 1 and 2 (right, publication).
    pub handedness: [Handedness; 2],
    /// Angle of helix 1 and 2 about +z_B at zero motor angle, in degrees (0). For a rig it must be fitted, because the motor
    /// angle is zero where the encoder began to count.
    pub phase_deg: [f64; 2],
    /// Young's modulus in Pa (1.255e6, publication). Lower values let the flagella bend, buckle and bundle.
    pub young_pa: f64,
    /// Poisson's ratio (0.5, publication).
    pub poisson: f64,
    /// Density in kg/m3 (1450, publication). Only the weight less buoyancy matters.
    pub density_kg_m3: f64,
    /// Length of an edge in m (0.005, the publication's 5 mm). Mean forces at 5 mm are within 1.5 % of those at 1.25
    /// mm. Their error decreases about as its square; the cost of a step grows about as its power -1.4. Above a twelfth
    /// of a coil the helix is not resolved.
    pub edge_length_m: f64,
}

impl Default for Flagellum {
    fn default() -> Self {
        Self {
            rod_radius_m: 0.003,
            helix_radius_m: 0.00889,
            pitch_m: 0.076,
            axial_length_m: 0.1962,
            handedness: [Handedness::Right; 2],
            phase_deg: [0.0; 2],
            young_pa: 1.255e6,
            poisson: 0.5,
            density_kg_m3: 1450.0,
            edge_length_m: 0.005,
        }
    }
}

impl Flagellum {
    /// Returns the natural shape of flagellum 0 or 1.
    pub fn helix(&self, which: usize) -> Helix {
        Helix {
            radius: self.helix_radius_m,
            pitch: self.pitch_m,
            axial_length: self.axial_length_m,
            handedness: self.handedness[which],
        }
    }

    /// Returns whether motors at these speeds make both flagella push towards the base: they then mesh over all of their
    /// length.
    pub fn mesh(&self, speeds: [f64; 2]) -> bool {
        (0..2).all(|k| match self.handedness[k] {
            Handedness::Right => speeds[k] < 0.0,
            Handedness::Left => speeds[k] > 0.0,
        })
    }

    /// Returns the number of edges: the contour length over the wanted edge length, rounded.
    pub fn edges(&self) -> usize {
        (self.helix(0).contour_length() / self.edge_length_m).round() as usize
    }

    /// Returns EA, EI and GJ.
    pub fn stiffness(&self) -> Stiffness {
        Stiffness::solid_round(self.rod_radius_m, self.young_pa, self.poisson)
    }
}

/// The fluid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Fluid {
    /// Dynamic viscosity in Pa s (1.0, publication).
    pub viscosity_pa_s: f64,
    /// Density in kg/m3 (1260, publication).
    pub density_kg_m3: f64,
    /// Glycerol and water instead of the two values above.
    pub glycerol: Option<Glycerol>,
    /// Drag on the rods' spin about their own centre lines, as a share of a round rod's couple 4 pi mu a^2 per metre
    /// (`physical`: 1, a round rod; `published`: 0). The drag on changes of the spin in the shaft's frame is at least
    /// [`crate::rod::spin::LEAST_SPIN_DRAG`] of this couple.
    pub spin_drag: f64,
    /// Regularisation of the Stokeslets in rod radii (`physical`: 1.6487, `published`: 1.03; the publication gives
    /// none). A line of regularised Stokeslets has the drag of a round rod whose radius is exp(-1/2) times the
    /// regularisation eps. In slender-body theory, the drag per metre across a rod of radius a and length 2L is 8 pi
    /// mu/(2 ln(2L/a) + 1), and 8 pi mu/(2 ln(2L/eps) + 2) for the line; along it, 8 pi mu/(4 ln(2L/a) - 2) and 8 pi
    /// mu/(4 ln(2L/eps)).
    pub regularisation_radii: f64,
}

impl Default for Fluid {
    fn default() -> Self {
        Self {
            viscosity_pa_s: 1.0,
            density_kg_m3: 1260.0,
            glycerol: None,
            spin_drag: 1.0,
            regularisation_radii: 1.6487,
        }
    }
}

/// A mixture of glycerol and water at a temperature (Cheng 2008, Ind. Eng. Chem. Res. 47, 3285).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Glycerol {
    /// Mass of glycerol over mass of the mixture, 0 to 1.
    pub mass_fraction: f64,
    /// Temperature in degrees Celsius, 0 to 100.
    pub temperature_c: f64,
}

impl Glycerol {
    /// Returns the dynamic viscosity in Pa s.
    pub fn viscosity_pa_s(&self) -> f64 {
        let (c, t) = (self.mass_fraction, self.temperature_c);
        let glycerol = 12.1 * exp((-1233.0 + t) * t / (9900.0 + 70.0 * t));
        let water = 1.790e-3 * exp((-1230.0 - t) * t / (36100.0 + 360.0 * t));
        let a = 0.705 - 0.0017 * t;
        let b = (4.9 + 0.036 * t) * pow(a, 2.5);
        let alpha = 1.0 - c + a * b * c * (1.0 - c) / (a * c + b * (1.0 - c));
        pow(water, alpha) * pow(glycerol, 1.0 - alpha)
    }

    /// Returns the density in kg/m3, without the small contraction on mixing.
    pub fn density_kg_m3(&self) -> f64 {
        let t = self.temperature_c;
        let glycerol = 1277.0 - 0.654 * t;
        let water = 1000.0 * (1.0 - pow((t - 4.0).abs() / 622.0, 1.7));
        self.mass_fraction * glycerol + (1.0 - self.mass_fraction) * water
    }
}

impl Fluid {
    /// Returns the dynamic viscosity in Pa s, of the mixture if there is one.
    pub fn viscosity(&self) -> f64 {
        self.glycerol.map_or(self.viscosity_pa_s, |g| g.viscosity_pa_s())
    }

    /// Returns the density in kg/m3, of the mixture if there is one.
    pub fn density(&self) -> f64 {
        self.glycerol.map_or(self.density_kg_m3, |g| g.density_kg_m3())
    }
}

/// The ball joint and the sensor's cable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Joint {
    /// Tether stiffness K of the energy K tau^2/2 in N m/rad for the `full` closure, see [`crate::body::joint`].
    /// Calibrated once, so that |yaw| is 180 degrees at (90, 90) rpm after 120 s: the mean over starting phases for
    /// `physical` (5.006e-4; `biflag simulate host/plans/tether.toml` prints -180.01), the value with equal
    /// starting phases for `published` (3.599e-4). Nothing else is fitted. With zero, the robot never stops spinning.
    pub tether_full_nm_per_rad: f64,
    /// The same for the `lumped` closure (`physical`: 5.100e-4, `published`: 3.645e-4).
    pub tether_lumped_nm_per_rad: f64,
    /// Viscous friction of the joint in N m s (0).
    pub viscous_nms: f64,
    /// Coulomb friction of the joint in N m (0), smoothed below about 0.01 degrees a second.
    pub coulomb_nm: f64,
}

impl Default for Joint {
    fn default() -> Self {
        Self { tether_full_nm_per_rad: 5.006e-4, tether_lumped_nm_per_rad: 5.100e-4, viscous_nms: 0.0, coulomb_nm: 0.0 }
    }
}

impl Joint {
    /// Returns the tether stiffness of a closure in N m/rad; `paper` has none, as printed.
    pub fn tether(&self, closure: Closure) -> f64 {
        match closure {
            Closure::Full => self.tether_full_nm_per_rad,
            Closure::Lumped => self.tether_lumped_nm_per_rad,
            Closure::Paper | Closure::Held => 0.0,
        }
    }
}

/// Contact between the rods, see [`crate::contact`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Contact {
    /// Whether rods touch (true). If not, they pass through each other.
    pub enabled: bool,
    /// Largest penetration in m (1e-5); the contact stiffness follows from it. A smaller value costs little.
    pub tolerance_m: f64,
    /// Coefficient of friction of the rods' surfaces, see [`crate::contact::friction`] (0: wet silicone in glycerin). With
    /// friction some steps of flagella that unwrap cannot be solved.
    pub friction: f64,
    /// Sliding speed in m/s below which friction sticks (1e-4).
    pub slip_speed_m_s: f64,
}

impl Default for Contact {
    fn default() -> Self {
        Self { enabled: true, tolerance_m: 1e-5, friction: 0.0, slip_speed_m_s: 1e-4 }
    }
}

impl Robot {
    /// Returns the regularisation of the Stokeslets in m.
    pub fn epsilon(&self) -> f64 {
        self.fluid.regularisation_radii * self.flagellum.rod_radius_m
    }

    /// Returns the feet of the shafts in the body frame, m: flagellum 1 at +d/2.
    pub fn shaft_feet(&self) -> [crate::V3; 2] {
        let (d, h) = (0.5 * self.base.motor_distance_m, self.base.height_m);
        [crate::V3::new(d, 0.0, -h), crate::V3::new(-d, 0.0, -h)]
    }

    /// Returns the local drag coefficient of the base in N m s: 2 pi mu C_r r_h^3, or zero if its head is `none` or a
    /// body in the flow.
    pub fn base_drag(&self) -> f64 {
        if self.head.shape != HeadShape::Local {
            return 0.0;
        }
        2.0 * PI * self.fluid.viscosity() * self.base.rotational_drag * powi(self.base.radius_m, 3)
    }

    /// Returns the couple of the fluid on a round rod that spins about its centre line, N m s per metre and radian:
    /// 4 pi mu a^2.
    pub fn round_spin_drag(&self) -> f64 {
        4.0 * PI * self.fluid.viscosity() * powi(self.flagellum.rod_radius_m, 2)
    }

    /// Returns the drag on the spin of the flagella.
    pub fn spin_drag(&self) -> SpinDrag {
        SpinDrag::new(self.round_spin_drag(), self.fluid.spin_drag)
    }

    /// Returns the weight less buoyancy of the rod in N/m, downwards.
    pub fn net_weight(&self) -> f64 {
        let area = PI * powi(self.flagellum.rod_radius_m, 2);
        (self.flagellum.density_kg_m3 - self.fluid.density()) * area * self.base.gravity_m_s2
    }
}
