//! Messages for viewers: the attitude as a frame of reference, the robot in it, and the flagella's nodes as points.

use biflag_log::schema::foxglove::{
    Color, CylinderPrimitive, FrameTransform, LinePrimitive, PackedElementField, Point3, PointCloud, Pose, Quaternion,
    SceneEntity, SceneUpdate, Vector3, line_primitive, packed_element_field::NumericType,
};
use nalgebra::UnitQuaternion;
use prost_types::Timestamp;
use sim::functions::sin_cos;
use sim::params::{Head, Robot};

/// Name of the body's frame in `/attitude`.
const FRAME: &str = "body";

/// Colours of flagellum 1 and 2: red, green and blue, 0 to 1.
pub const FLAGELLA: [[f64; 3]; 2] = [[0.9, 0.45, 0.1], [0.15, 0.45, 0.85]];

/// Colour of the base.
pub const BASE: [f64; 3] = [0.55, 0.57, 0.6];

/// Fields of a point, each with its length in bytes: coordinates in m, the flagellum's number, and its colour.
const FIELDS: [(&str, u32, NumericType); 8] = [
    ("x", 4, NumericType::Float32),
    ("y", 4, NumericType::Float32),
    ("z", 4, NumericType::Float32),
    ("flagellum", 4, NumericType::Float32),
    ("red", 1, NumericType::Uint8),
    ("green", 1, NumericType::Uint8),
    ("blue", 1, NumericType::Uint8),
    ("alpha", 1, NumericType::Uint8),
];

/// Centre lines of both flagella, m.
type Lines = [Vec<[f64; 3]>; 2];

/// Returns the pose of the body's frame.
fn origin() -> Pose {
    Pose { position: Some(Vector3::default()), orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }) }
}

/// Converts a time in ns since 1970.
fn timestamp(ns: u64) -> Timestamp {
    Timestamp { seconds: (ns / 1_000_000_000).cast_signed(), nanos: (ns % 1_000_000_000) as i32 }
}

/// Returns the message for `/attitude`: the body's frame in the world.
pub fn attitude(attitude: &UnitQuaternion<f64>, log_time_ns: u64) -> FrameTransform {
    let q = attitude.quaternion();
    FrameTransform {
        timestamp: Some(timestamp(log_time_ns)),
        parent_frame_id: "world".to_owned(),
        child_frame_id: FRAME.to_owned(),
        translation: Some(Vector3::default()),
        rotation: Some(Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }),
    }
}

/// Returns the head to draw for a robot: its own, or the head of the robot `physical` if it has none in the flow.
pub fn head(robot: &Robot) -> Head {
    if robot.head.is_resolved() { robot.head.clone() } else { Robot::default().head }
}

fn opaque([r, g, b]: [f64; 3]) -> Color {
    Color { r, g, b, a: 1.0 }
}

/// Draws a robot: its base as a cylinder, and its flagella as lines as thick as their rods.
pub struct Drawing {
    rod_radius_m: f64,
    /// Centre lines of the undeformed flagella in their shaft frames, m.
    rest: Lines,
    /// Feet of the shafts in the body frame, m.
    feet: [Vector3; 2],
    base: CylinderPrimitive,
}

impl Drawing {
    /// Draws this robot.
    pub fn new(robot: &Robot) -> Self {
        let flagellum = &robot.flagellum;
        let rest =
            [0, 1].map(|which| flagellum.helix(which).nodes(flagellum.edges()).into_iter().map(Into::into).collect());
        let head = head(robot);
        let [x, y, z] = head.centre_m;
        let width = 2.0 * head.radius_m;
        let base = CylinderPrimitive {
            pose: Some(Pose { position: Some(Vector3 { x, y, z }), ..origin() }),
            size: Some(Vector3 { x: width, y: width, z: 2.0 * head.half_length() }),
            bottom_scale: 1.0,
            top_scale: 1.0,
            color: Some(opaque(BASE)),
        };
        let feet = robot.shaft_feet().map(|foot| Vector3 { x: foot.x, y: foot.y, z: foot.z });
        Self { rod_radius_m: flagellum.rod_radius_m, rest, feet, base }
    }

    /// Returns the message for `/flagella` with these centre lines in the body frame.
    pub fn deformed(&self, log_time_ns: u64, lines: &Lines) -> SceneUpdate {
        self.scene(log_time_ns, lines, &[origin(), origin()])
    }

    /// Returns the message for `/flagella` with undeformed flagella, turned by these angles, rad.
    pub fn rigid(&self, log_time_ns: u64, angles: [f64; 2]) -> SceneUpdate {
        let pose = |flagellum: usize| {
            let (z, w) = sin_cos(0.5 * angles[flagellum]);
            Pose { position: Some(self.feet[flagellum]), orientation: Some(Quaternion { x: 0.0, y: 0.0, z, w }) }
        };
        self.scene(log_time_ns, &self.rest, &[pose(0), pose(1)])
    }

    fn scene(&self, log_time_ns: u64, lines: &Lines, poses: &[Pose; 2]) -> SceneUpdate {
        let line = |((line, pose), colour): ((&Vec<[f64; 3]>, &Pose), Color)| LinePrimitive {
            r#type: line_primitive::Type::LineStrip.into(),
            pose: Some(*pose),
            thickness: 2.0 * self.rod_radius_m,
            points: line.iter().map(|&[x, y, z]| Point3 { x, y, z }).collect(),
            color: Some(colour),
            ..LinePrimitive::default()
        };
        let entity = |id: &str| SceneEntity {
            timestamp: Some(timestamp(log_time_ns)),
            frame_id: FRAME.to_owned(),
            id: id.to_owned(),
            frame_locked: true,
            ..SceneEntity::default()
        };
        let flagella = lines.iter().zip(poses).zip(FLAGELLA.map(opaque)).map(line).collect();
        SceneUpdate {
            entities: vec![
                SceneEntity { lines: flagella, ..entity("flagella") },
                SceneEntity { cylinders: vec![self.base], ..entity("base") },
            ],
            ..SceneUpdate::default()
        }
    }
}

/// Returns the message for `/flagella_points`: the nodes.
pub fn points(log_time_ns: u64, lines: &Lines) -> PointCloud {
    let mut data = Vec::new();
    for ((number, line), colour) in [1.0, 2.0].into_iter().zip(lines).zip(FLAGELLA.map(opaque)) {
        let colour = [colour.r, colour.g, colour.b, colour.a].map(|part| (part * 255.0).round() as u8);
        for &[x, y, z] in line {
            data.extend([x, y, z, number].into_iter().flat_map(|value| (value as f32).to_le_bytes()));
            data.extend(colour);
        }
    }
    let mut point_stride = 0;
    let fields = FIELDS.map(|(name, length, kind)| {
        let offset = point_stride;
        point_stride += length;
        PackedElementField { name: name.to_owned(), offset, r#type: kind.into() }
    });
    PointCloud {
        timestamp: Some(timestamp(log_time_ns)),
        frame_id: FRAME.to_owned(),
        pose: Some(origin()),
        point_stride,
        fields: fields.into(),
        data,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_the_nodes_of_the_lines() {
        let lines = [vec![[0.1, 0.2, -0.3]], vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]];
        let cloud = points(1_500_000_000, &lines);
        assert_eq!((cloud.point_stride, cloud.data.len()), (20, 60));
        let values: Vec<_> = cloud.data[..16].as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        assert_eq!(values, [0.1, 0.2, -0.3, 1.0]);
        assert_eq!((&cloud.data[16..20], &cloud.data[56..]), (&[230, 115, 26, 255][..], &[38, 115, 217, 255][..]));
        let offsets: Vec<_> = cloud.fields.iter().map(|field| field.offset).collect();
        assert_eq!(offsets, [0, 4, 8, 12, 16, 17, 18, 19]);
        let update = Drawing::new(&Robot::default()).deformed(1_500_000_000, &lines);
        let [line1, line2] = update.entities[0].lines.as_slice() else { panic!("two lines") };
        assert_eq!((line1.points.len(), line2.points.len(), line1.thickness), (1, 2, 0.006));
        assert_eq!(update.entities[0].timestamp.as_ref().unwrap().nanos, 500_000_000);
    }

    /// At a quarter of a turn, flagellum 1 begins on the positive y side of its shaft, which is at positive x.
    #[test]
    fn rigid_flagella_turn_about_their_shafts() {
        let robot = Robot::default();
        let update = Drawing::new(&robot).rigid(0, [std::f64::consts::FRAC_PI_2, 0.0]);
        let [flagella, base] = update.entities.as_slice() else { panic!("flagella and base") };
        let clamp = |number: usize| {
            let line = &flagella.lines[number];
            let (pose, point) = (line.pose.as_ref().unwrap(), &line.points[0]);
            let (q, foot) = (pose.orientation.as_ref().unwrap(), pose.position.as_ref().unwrap());
            let turned =
                crate::attitude::rotation([q.w, q.x, q.y, q.z]) * nalgebra::Vector3::new(point.x, point.y, point.z);
            [turned.x + foot.x, turned.y + foot.y, turned.z + foot.z]
        };
        let (half, radius) = (0.5 * robot.base.motor_distance_m, robot.flagellum.helix(0).radius);
        let expected = [[half, radius, -robot.base.height_m], [radius - half, 0.0, -robot.base.height_m]];
        for (number, expected) in expected.iter().enumerate() {
            let near = clamp(number).iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12);
            assert!(near, "{:?} is not {expected:?}", clamp(number));
        }
        let base = base.cylinders[0];
        let (centre, size) = (base.pose.unwrap().position.unwrap(), base.size.unwrap());
        assert_eq!((centre.z + 0.5 * size.z, size.x), (0.0, 0.027));
    }
}
