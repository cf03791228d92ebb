//! Messages for viewers: the attitude as a frame of reference, and the flagella in it as lines and as points.

use biflag_log::schema::foxglove::{
    Color, FrameTransform, LinePrimitive, PackedElementField, Point3, PointCloud, Pose, Quaternion, SceneEntity,
    SceneUpdate, Vector3, line_primitive, packed_element_field::NumericType,
};
use nalgebra::UnitQuaternion;
use prost_types::Timestamp;

/// Name of the body's frame in `/attitude`.
const FRAME: &str = "body";

/// Colours of flagellum 1 and 2.
const COLOURS: [Color; 2] = [Color { r: 0.9, g: 0.45, b: 0.1, a: 1.0 }, Color { r: 0.15, g: 0.45, b: 0.85, a: 1.0 }];

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
pub(crate) fn attitude(attitude: &UnitQuaternion<f64>, log_time_ns: u64) -> FrameTransform {
    let q = attitude.quaternion();
    FrameTransform {
        timestamp: Some(timestamp(log_time_ns)),
        parent_frame_id: "world".to_owned(),
        child_frame_id: FRAME.to_owned(),
        translation: Some(Vector3::default()),
        rotation: Some(Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }),
    }
}

/// Returns the message for `/flagella`: lines as thick as the rods.
pub(crate) fn scene(log_time_ns: u64, lines: &Lines, rod_radius_m: f64) -> SceneUpdate {
    let line = |(line, colour): (&Vec<[f64; 3]>, Color)| LinePrimitive {
        r#type: line_primitive::Type::LineStrip.into(),
        pose: Some(origin()),
        thickness: 2.0 * rod_radius_m,
        points: line.iter().map(|&[x, y, z]| Point3 { x, y, z }).collect(),
        color: Some(colour),
        ..LinePrimitive::default()
    };
    SceneUpdate {
        entities: vec![SceneEntity {
            timestamp: Some(timestamp(log_time_ns)),
            frame_id: FRAME.to_owned(),
            id: "flagella".to_owned(),
            frame_locked: true,
            lines: lines.iter().zip(COLOURS).map(line).collect(),
            ..SceneEntity::default()
        }],
        ..SceneUpdate::default()
    }
}

/// Returns the message for `/flagella_points`: the nodes.
pub(crate) fn points(log_time_ns: u64, lines: &Lines) -> PointCloud {
    let mut data = Vec::new();
    for ((number, line), colour) in [1.0, 2.0].into_iter().zip(lines).zip(COLOURS) {
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
        let update = scene(1_500_000_000, &lines, 0.003);
        let [line1, line2] = update.entities[0].lines.as_slice() else { panic!("two lines") };
        assert_eq!((line1.points.len(), line2.points.len(), line1.thickness), (1, 2, 0.006));
        assert_eq!(update.entities[0].timestamp.as_ref().unwrap().nanos, 500_000_000);
    }
}
