//! The tank: a box of fluid that stands about the robot.

use super::validate::{refuse, within};
use super::{ParamError, Robot};
use crate::V3;
use serde::{Deserialize, Serialize};

/// A face of the tank, named by its outward normal in world axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Face {
    /// The side at the least x.
    #[serde(rename = "-x")]
    MinusX,
    /// The side at the largest x.
    #[serde(rename = "+x")]
    PlusX,
    /// The side at the least y.
    #[serde(rename = "-y")]
    MinusY,
    /// The side at the largest y.
    #[serde(rename = "+y")]
    PlusY,
    /// The floor.
    #[serde(rename = "-z")]
    MinusZ,
    /// A lid on the fluid.
    #[serde(rename = "+z")]
    PlusZ,
}

impl Face {
    /// All faces of a box.
    pub const ALL: [Self; 6] = [Self::MinusX, Self::PlusX, Self::MinusY, Self::PlusY, Self::MinusZ, Self::PlusZ];

    /// Returns the axis of the face's normal, and the normal's direction along it: -1 or 1.
    pub fn normal(self) -> (usize, f64) {
        let place = self as usize;
        (place / 2, if place.is_multiple_of(2) { -1.0 } else { 1.0 })
    }
}

/// A box of fluid, its edges along the world's axes. It stands still; the robot turns in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tank {
    /// Length along x in m, between the inner sides of the walls.
    pub length_m: f64,
    /// Width along y in m.
    pub width_m: f64,
    /// Height of the fluid along z in m, from the floor to its surface.
    pub height_m: f64,
    /// Position of the joint along x and y in m, from the sides at the least x and the least y.
    pub joint_m: [f64; 2],
    /// Depth of the joint below the surface in m.
    pub joint_depth_m: f64,
    /// Faces that are walls without slip (the four sides and the floor). A face that is neither a wall nor a free
    /// surface is open: the fluid has no bounds there.
    #[serde(default = "sides_and_floor")]
    pub walls: Vec<Face>,
    /// Whether the top is a free surface (true): plane, without shear.
    #[serde(default = "yes")]
    pub free_surface: bool,
}

fn sides_and_floor() -> Vec<Face> {
    Face::ALL.into_iter().filter(|face| *face != Face::PlusZ).collect()
}

fn yes() -> bool {
    true
}

impl Tank {
    /// Returns the tank of the publication, filled to its brim, with the robot in the middle, as in
    /// `host/plans/robot-tank.toml`.
    pub fn published() -> Self {
        Self {
            length_m: 1.22,
            width_m: 0.45,
            height_m: 0.515,
            joint_m: [0.61, 0.225],
            joint_depth_m: 0.14,
            walls: sides_and_floor(),
            free_surface: true,
        }
    }

    /// Returns the position of a face along its axis, in m from the joint.
    pub fn place(&self, face: Face) -> f64 {
        match face {
            Face::MinusX => -self.joint_m[0],
            Face::PlusX => self.length_m - self.joint_m[0],
            Face::MinusY => -self.joint_m[1],
            Face::PlusY => self.width_m - self.joint_m[1],
            Face::MinusZ => self.joint_depth_m - self.height_m,
            Face::PlusZ => self.joint_depth_m,
        }
    }

    /// Returns the corners of the tank with the least and the largest coordinates, world axes from the joint, m.
    fn corners(&self) -> [V3; 2] {
        [[Face::MinusX, Face::MinusY, Face::MinusZ], [Face::PlusX, Face::PlusY, Face::PlusZ]]
            .map(|faces| V3::from(faces.map(|face| self.place(face))))
    }

    /// Returns the corners of the box in the tank that holds a robot with a tilt of at most about 30 degrees, m.
    pub fn space_of(&self, robot: &Robot) -> [V3; 2] {
        let length = robot.base.height_m + robot.flagellum.axial_length_m;
        let beside = 0.5 * length + 0.5 * robot.base.motor_distance_m;
        let [low, high] = self.corners();
        [low.sup(&V3::new(-beside, -beside, -length)), high.inf(&V3::new(beside, beside, 0.0))]
    }

    /// Checks sizes, faces and that the upright robot fits at every yaw with at least an edge's length of fluid about it.
    pub(super) fn validate(&self, robot: &Robot) -> Result<(), ParamError> {
        let sizes =
            [("tank.length_m", self.length_m), ("tank.width_m", self.width_m), ("tank.height_m", self.height_m)];
        for (key, size) in sizes {
            within(key, size, 1e-3, 1e3)?;
        }
        for (i, face) in self.walls.iter().enumerate() {
            if self.walls[..i].contains(face) {
                return refuse("tank.walls", i as f64, format!("face {i} is named before"));
            }
        }
        if self.free_surface && self.walls.contains(&Face::PlusZ) {
            return refuse("tank.free_surface", 1.0, "the top cannot be a wall and a free surface");
        }
        if !self.free_surface && self.walls.is_empty() {
            return refuse("tank.walls", 0.0, "the tank has neither a wall nor a free surface: leave [tank] out");
        }
        let margin = robot.flagellum.edge_length_m;
        let (base, flagellum) = (&robot.base, &robot.flagellum);
        let swept = 0.5 * base.motor_distance_m + flagellum.helix_radius_m + flagellum.rod_radius_m;
        let head = &robot.head;
        let head_reach = head.centre().xy().norm() + head.radius_m;
        let beside = if head.is_resolved() { swept.max(head_reach) } else { swept } + margin;
        for (axis, (size, joint)) in [self.length_m, self.width_m].into_iter().zip(self.joint_m).enumerate() {
            if !(joint >= beside && size - joint >= beside) {
                let name = ["x", "y"][axis];
                let reason = format!(
                    "the robot turns within {beside:.2e} m of the joint: along {name} there is room between {beside:.2e} and {:.2e}",
                    size - beside
                );
                return refuse("tank.joint_m", joint, reason);
            }
        }
        let below = base.height_m + flagellum.axial_length_m + flagellum.rod_radius_m + margin;
        let room = self.height_m - below;
        let above = if head.is_resolved() { (head.centre_m[2] + head.half_length()).max(0.0) } else { 0.0 };
        if !(self.joint_depth_m >= above && self.joint_depth_m <= room) {
            let reason = format!(
                "the robot reaches {below:.2e} m down and {above:.2e} m up from the joint: there is room between {above:.2e} and {room:.2e}"
            );
            return refuse("tank.joint_depth_m", self.joint_depth_m, reason);
        }
        Ok(())
    }
}
