//! The robot at a time of its trial, in front of the camera, over a chart of its yaw.

use super::FilmError;
use super::render::{BASE, CHART, Camera, DIAL, FLAGELLA, Rgb, Solid, V3};
use crate::report::shapes::at_rest;
use nalgebra::UnitQuaternion;
use sim::body::shaft::Shaft;
use sim::params::{Head, Robot};
use std::f64::consts::TAU;
use std::ops::Range;
use study::attitude::Columns;
use study::draw::head;
use study::trial::{Data, Shape, Zeroed};

/// Pieces of the dial's circle.
const DIAL_PIECES: usize = 60;

/// The robot over a trial.
pub(super) struct Scene {
    robot: Robot,
    head: Head,
    /// Times, and both centre lines in the frames that turn with the shafts.
    shapes: Vec<(f64, [Vec<V3>; 2])>,
    turns: Columns<2>,
    angles_deg: Columns<3>,
    camera: Camera,
    width: usize,
    /// Height of the view of the robot, and of the chart below it, pixels.
    heights: [usize; 2],
    /// The yaw in each column of the chart, pixels from its upper edge.
    curve: Vec<f64>,
    shown: Range<f64>,
}

impl Scene {
    pub(super) fn new(data: &Data, zeroed: &Zeroed, shown: Range<f64>, width: u16) -> Result<Self, FilmError> {
        let robot = data.robot()?;
        let feet = robot.shaft_feet();
        let rest = [Shape { time_s: 0.0, turns: [0.0; 2], lines: at_rest(&robot) }];
        let shapes = if data.shapes.is_empty() { &rest[..] } else { data.shapes.all() };
        let width = usize::from(width);
        let heights = [width * 4 / 3, width / 6];
        let reach = robot.base.height_m + robot.flagellum.axial_length_m;
        let target = V3::new(0.0, 0.0, -0.45 * reach);
        let eye = target + V3::new(-0.55, -1.0, 0.38).normalize() * (4.0 * reach);
        let yaw = zeroed.angles_deg.track(0);
        let columns = (0..width).map(|x| shown.start + (shown.end - shown.start) * x as f64 / (width - 1) as f64);
        let yaws: Vec<f64> = columns.map(|time| yaw.at(time).unwrap_or(0.0)).collect();
        Ok(Self {
            shapes: shapes.iter().map(|shape| (shape.time_s, shape.in_shafts(&feet))).collect(),
            turns: data.turns(),
            angles_deg: zeroed.angles_deg.clone(),
            camera: Camera::new(eye, target, 1.2 * reach, [width, heights[0]]),
            curve: curve(&yaws, heights[1]),
            head: head(&robot),
            robot,
            width,
            heights,
            shown,
        })
    }

    /// Returns width and height of the film, pixels.
    pub(super) fn size(&self) -> [u16; 2] {
        [self.width as u16, (self.heights[0] + self.heights[1]) as u16]
    }

    /// Draws the scene at a time of the trial.
    pub(super) fn draw(&self, time_s: f64) -> Vec<Rgb> {
        let mut image = self.camera.draw(&self.solids(time_s));
        image.extend(self.chart(time_s));
        image
    }

    /// Returns what is seen of the robot, world axes.
    fn solids(&self, time_s: f64) -> Vec<Solid> {
        let [yaw, pitch, roll] = self.angles_deg.at(time_s).map(f64::to_radians);
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
        for (k, (foot, line)) in self.robot.shaft_feet().into_iter().zip(self.lines(time_s)).enumerate() {
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

    /// Returns both centre lines, body axes, m: between two shapes of the log, in the frames of the shafts.
    fn lines(&self, time_s: f64) -> [Vec<[f64; 3]>; 2] {
        let after = self.shapes.partition_point(|(time, _)| *time <= time_s).min(self.shapes.len() - 1);
        let [(begin_s, one), (end_s, two)] = [&self.shapes[after.saturating_sub(1)], &self.shapes[after]];
        let length_s = end_s - begin_s;
        let share = if length_s > 0.0 { ((time_s - begin_s) / length_s).clamp(0.0, 1.0) } else { 1.0 };
        let turns = self.turns.at(time_s).map(|turns| if turns.is_finite() { turns } else { 0.0 });
        let feet = self.robot.shaft_feet();
        [0, 1].map(|k| {
            let shaft = Shaft::new(feet[k], turns[k] * TAU);
            let between = |(one, two): (&V3, &V3)| shaft.point_to_body(one * (1.0 - share) + two * share).into();
            one[k].iter().zip(&two[k]).map(between).collect()
        })
    }

    /// Draws the yaw over the film's time: dark up to now, light after it, and a point at it.
    fn chart(&self, time_s: f64) -> Vec<Rgb> {
        let now = ((time_s - self.shown.start) / (self.shown.end - self.shown.start)).clamp(0.0, 1.0)
            * (self.width - 1) as f64;
        let here = self.curve[now as usize];
        let thickness = self.width as f64 / 400.0;
        let pixels = (0..self.heights[1]).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        pixels
            .map(|(x, y)| {
                let neighbours = [x.saturating_sub(1), x, (x + 1).min(self.width - 1)].map(|x| self.curve[x]);
                let (low, high) = (
                    neighbours.iter().copied().fold(f64::INFINITY, f64::min),
                    neighbours.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                );
                let away = (low - y as f64).max(y as f64 - high).max(0.0) + 0.5 * (high - low).min(1.0);
                let point = (x as f64 - now).hypot(y as f64 - here);
                let (ink, colour) = match point < 4.0 * thickness + 0.5 {
                    true => (4.0 * thickness + 0.5 - point, CHART),
                    false => (thickness + 0.5 - away, if x as f64 <= now { CHART } else { DIAL }),
                };
                let ink = ink.clamp(0.0, 1.0) as f32;
                std::array::from_fn(|k| {
                    let background = super::render::BACKGROUND[k];
                    if ink == 0.0 { background } else { background + (colour[k] - background) * ink }
                })
            })
            .collect()
    }
}

/// Returns the heights of a curve within a chart of so many pixels.
fn curve(values: &[f64], height: usize) -> Vec<f64> {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // A yaw that does not change is a line in the middle.
    let range = (high - low).max(1.0);
    let middle = 0.5 * (low + high);
    values.iter().map(|value| height as f64 * (0.5 - 0.7 * (value - middle) / range)).collect()
}
