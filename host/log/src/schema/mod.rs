//! The message types of the log, and their channels.
//!
//! The types are generated from the files in `proto`, and checked in, because their generator takes longer to compile
//! than the rest of this crate. A test detects when a file has changed; then `BIFLAG_WRITE_GOLDEN=1 cargo test
//! --release -p biflag-log --features generate schema` writes the types again. Without that variable the same test
//! compares them with the generator's output, as `make proof` does.

#[cfg(test)]
mod current;

use prost::Message;

/// Messages of the robot.
#[allow(missing_docs, clippy::doc_markdown)]
pub mod biflag {
    include!("generated/biflag.rs");
}

/// Messages that viewers know.
#[allow(missing_docs, clippy::doc_markdown)]
pub mod foxglove {
    include!("generated/foxglove.rs");
}

/// A channel of the log.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ChannelSpec {
    /// Number in the file. It is fixed, so messages can be decoded even if the chunk that declares the channels is
    /// damaged.
    pub id: u16,
    /// Name.
    pub topic: &'static str,
    /// Name of the message type.
    pub schema: &'static str,
    /// Description of the message type: a binary FileDescriptorSet.
    pub descriptors: &'static [u8],
}

/// A message type with its own channel.
pub trait LogMessage: Message + Default {
    /// The channel.
    const CHANNEL: ChannelSpec;
}

const BIFLAG: &[u8] = include_bytes!("generated/biflag.binpb");
const FRAME_TRANSFORM: &[u8] = include_bytes!("generated/FrameTransform.binpb");
const SCENE_UPDATE: &[u8] = include_bytes!("generated/SceneUpdate.binpb");
const POINT_CLOUD: &[u8] = include_bytes!("generated/PointCloud.binpb");

macro_rules! channels {
    ($($id:literal, $topic:literal, $type:ty, $schema:literal, $descriptors:expr;)*) => {
        $(impl LogMessage for $type {
            const CHANNEL: ChannelSpec =
                ChannelSpec { id: $id, topic: $topic, schema: $schema, descriptors: $descriptors };
        })*

        /// Every channel that this program knows.
        pub const CHANNELS: &[ChannelSpec] = &[$(<$type as LogMessage>::CHANNEL),*];
    };
}

channels! {
    1, "/raw", biflag::RawBytes, "biflag.RawBytes", BIFLAG;
    2, "/telemetry", biflag::Telemetry, "biflag.Telemetry", BIFLAG;
    3, "/attitude", foxglove::FrameTransform, "foxglove.FrameTransform", FRAME_TRANSFORM;
    4, "/command", biflag::Command, "biflag.Command", BIFLAG;
    5, "/dropout", biflag::Dropout, "biflag.Dropout", BIFLAG;
    6, "/event", biflag::Event, "biflag.Event", BIFLAG;
    7, "/truth", biflag::Truth, "biflag.Truth", BIFLAG;
    8, "/forces", biflag::Forces, "biflag.Forces", BIFLAG;
    9, "/flagella", foxglove::SceneUpdate, "foxglove.SceneUpdate", SCENE_UPDATE;
    10, "/flagella_points", foxglove::PointCloud, "foxglove.PointCloud", POINT_CLOUD;
    11, "/nodes", biflag::Nodes, "biflag.Nodes", BIFLAG;
    12, "/steering", biflag::Steering, "biflag.Steering", BIFLAG;
}

/// Returns the channel called `topic`, if this program knows it.
pub fn channel(topic: &str) -> Option<&'static ChannelSpec> {
    CHANNELS.iter().find(|channel| channel.topic == topic)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_unique_and_their_types_have_descriptors() {
        for (i, channel) in CHANNELS.iter().enumerate() {
            assert!(CHANNELS[..i].iter().all(|other| other.id != channel.id && other.topic != channel.topic));
            let set = prost_types::FileDescriptorSet::decode(channel.descriptors).unwrap();
            let (package, name) = channel.schema.rsplit_once('.').unwrap();
            assert!(
                set.file
                    .iter()
                    .any(|file| file.package() == package && file.message_type.iter().any(|kind| kind.name() == name)),
                "{} has no descriptor",
                channel.schema
            );
        }
    }

    /// Readers such as PlotJuggler build a type only from the log, file by file.
    #[test]
    fn descriptors_list_dependencies_first() {
        for channel in CHANNELS {
            let set = prost_types::FileDescriptorSet::decode(channel.descriptors).unwrap();
            for (i, file) in set.file.iter().enumerate() {
                for needed in &file.dependency {
                    let before = set.file[..i].iter().any(|earlier| earlier.name() == needed);
                    assert!(before, "{}: {} needs {needed}, which does not come before it", channel.topic, file.name());
                }
            }
        }
    }
}
