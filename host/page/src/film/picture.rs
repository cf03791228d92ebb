//! A picture of the robot: base, flagella, and a dial of its yaw.

use super::palette::bytes;
use super::render::{BASE, CHART, Camera, DIAL, FLAGELLA, Rgb, Solid, V3};
use crate::report::shapes::at_rest;
use nalgebra::UnitQuaternion;
use sim::params::{Head, Robot};
use std::f64::consts::TAU;
use study::draw::head;

/// Pieces of the dial's circle.
const DIAL_PIECES: usize = 60;

/// Both centre lines of the flagella, body axes, m.
type Lines = [Vec<[f64; 3]>; 2];

/// A solid as the camera sees it: a line with a width.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Seen {
    /// Its ends, pixels from the upper left.
    pub from: [f64; 2],
    pub to: [f64; 2],
    /// Pixels.
    pub radius: f64,
    /// Round ends, or flat ones.
    pub is_round: bool,
    /// Red, green and blue.
    pub colour: [u8; 3],
    /// Distance from the camera, m.
    pub away_m: f64,
}

/// A robot in front of a camera.
#[derive(Debug)]
pub struct Picture {
    pub(super) robot: Robot,
    head: Head,
    camera: Camera,
    /// Width and height, pixels.
    pub size: [usize; 2],
}

impl Picture {
    /// Places the robot before the camera. `width`: that of the picture, pixels; its height is four thirds of that.
    pub fn new(robot: Robot, width: u16) -> Self {
        let width = usize::from(width);
        let size = [width, width * 4 / 3];
        let reach = robot.base.height_m + robot.flagellum.axial_length_m;
        let target = V3::new(0.0, 0.0, -0.45 * reach);
        let eye = target + V3::new(-0.55, -1.0, 0.38).normalize() * (4.0 * reach);
        Self { camera: Camera::new(eye, target, 1.2 * reach, size), head: head(&robot), robot, size }
    }

    /// Returns red, green and blue of each pixel, row by row from the upper left. `angles_deg`: yaw, pitch, roll; `lines`: the
    /// centre lines of both flagella, body axes, m; `None`: the lines at rest.
    pub fn rgb(&self, angles_deg: [f64; 3], lines: Option<Lines>) -> Vec<u8> {
        let lines = lines.unwrap_or_else(|| at_rest(&self.robot));
        self.draw(&self.solids(angles_deg, lines)).into_iter().flat_map(bytes).collect()
    }

    pub(super) fn draw(&self, solids: &[Solid]) -> Vec<Rgb> {
        self.camera.draw(solids)
    }

    /// Returns how the camera sees solids, from the farthest to the nearest.
    pub(super) fn seen(&self, solids: &[Solid]) -> Vec<Seen> {
        let one = |solid: &Solid| {
            let (from, near, scale) = self.camera.project(solid.from);
            let (to, far, _) = self.camera.project(solid.to);
            let away_m = 0.5 * (near + far);
            Seen {
                from,
                to,
                radius: solid.radius * scale,
                is_round: solid.is_round,
                colour: bytes(solid.colour),
                away_m,
            }
        };
        let mut seen: Vec<Seen> = solids.iter().map(one).collect();
        seen.sort_by(|a, b| b.away_m.total_cmp(&a.away_m));
        seen
    }

    /// Returns the solids of the robot, world axes.
    pub(super) fn solids(&self, angles_deg: [f64; 3], lines: Lines) -> Vec<Solid> {
        let [yaw, pitch, roll] = angles_deg.map(f64::to_radians);
        let attitude = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let world = |[x, y, z]: [f64; 3]| attitude * V3::new(x, y, z);
        let radius = self.head.radius_m;
        let [x, y, z] = self.head.centre_m;
        let half = self.head.half_length();
        let mut solids = vec![
            Solid::cylinder(world([x, y, z - half]), world([x, y, z + half]), radius, BASE),
            Solid::rod(world([0.0; 3]), V3::new(0.0, 0.0, 0.5 * radius), 0.3 * radius, BASE),
        ];
        let rod = self.robot.flagellum.rod_radius_m;
        for (k, (foot, line)) in self.robot.shaft_feet().into_iter().zip(lines).enumerate() {
            let [x, y, z] = [foot.x, foot.y, foot.z];
            let top = 0.2 * z;
            solids.push(Solid::cylinder(world([x, y, z]), world([x, y, top]), 0.4 * radius, FLAGELLA[k]));
            // The bracket of the motor.
            let middle = 0.5 * (z + top);
            solids.push(Solid::rod(world([0.0, 0.0, middle]), world([x, y, middle]), 0.15 * radius, BASE));
            let points: Vec<V3> = line.into_iter().map(world).collect();
            solids.extend(points.first().map(|first| Solid::rod(world([x, y, z]), *first, 0.5 * rod, BASE)));
            solids.extend(points.windows(2).map(|pair| Solid::rod(pair[0], pair[1], rod, FLAGELLA[k])));
        }
        solids.extend(self.dial(yaw));
        solids
    }

    /// Returns a horizontal circle above the robot with a mark at a yaw of zero, and a hand at the robot's yaw.
    fn dial(&self, yaw: f64) -> Vec<Solid> {
        let (size, height) = (2.2 * self.head.radius_m, 0.6 * self.head.radius_m);
        let at = |angle: f64, share: f64| V3::new(share * size * angle.cos(), share * size * angle.sin(), height);
        let flat = |from, to, width, colour| Solid { is_lit: false, ..Solid::rod(from, to, width * size, colour) };
        let piece = TAU / DIAL_PIECES as f64;
        let circle =
            (0..DIAL_PIECES).map(|i| flat(at(i as f64 * piece, 1.0), at((i + 1) as f64 * piece, 1.0), 0.02, DIAL));
        let zero = flat(at(0.0, 0.92), at(0.0, 1.12), 0.03, CHART);
        let hand = flat(at(yaw, 0.1), at(yaw, 0.95), 0.035, CHART);
        circle.chain([zero, hand]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_robot_is_another_picture_and_a_whole_turn_is_the_same() {
        let picture = Picture::new(Robot::default(), 120);
        let [upright, turned, around] = [0.0, 75.0, 360.0].map(|yaw| picture.rgb([yaw, 0.0, 0.0], None));
        assert_eq!(upright.len(), 120 * 160 * 3);
        assert_eq!(upright, around);
        let different = upright.iter().zip(&turned).filter(|(a, b)| a.abs_diff(**b) > 60).count();
        assert!(different > 1000, "{different}");
    }
}
