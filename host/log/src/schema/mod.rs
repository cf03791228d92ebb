//! The message types of the log, and their channels.
//!
//! The types are generated from the files in `proto`, and checked in, because their generator takes longer to compile
//! than the rest of this crate. A test detects when a file has changed; then `BIFLAG_WRITE_GOLDEN=1 cargo test
//! --release -p biflag-log --features generate schema` writes the types again. Without that variable the same test
//! compares them with the generator's output, as `make proof` does.

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
    ($($id:literal, $topic:literal, $variant:ident($body:ty), $package:ident::$name:ident, $descriptors:expr;)*) => {
        $(impl LogMessage for $package::$name {
            const CHANNEL: ChannelSpec = ChannelSpec {
                id: $id,
                topic: $topic,
                schema: concat!(stringify!($package), ".", stringify!($name)),
                descriptors: $descriptors,
            };
        })*

        /// Every channel that this program knows.
        pub const CHANNELS: &[ChannelSpec] = &[$($package::$name::CHANNEL),*];

        /// The content of a message.
        #[derive(Clone, PartialEq, Debug)]
        pub enum Body {
            $(#[doc = concat!("`", $topic, "`.")] $variant($body),)*
            /// A channel that this program does not know, or a message that cannot be decoded.
            Other(Vec<u8>),
        }

        impl Body {
            /// Encodes the message; the inverse of the decoding in [`crate::Reader`].
            pub fn encode(&self) -> Vec<u8> {
                match self {
                    $(Self::$variant(message) => message.encode_to_vec(),)*
                    Self::Other(bytes) => bytes.clone(),
                }
            }

            /// Decodes a message. Returns its bytes as an error if they do not fit its channel's type.
            pub(super) fn decode(topic: &str, schema: &str, data: Vec<u8>) -> Result<Self, Vec<u8>> {
                let known = match channel(topic).filter(|spec| spec.schema == schema).map(|spec| spec.id) {
                    $(Some($id) => <$body>::decode(&*data).map(Self::$variant),)*
                    _ => return Ok(Self::Other(data)),
                };
                known.map_err(|_| data)
            }
        }
    };
}

// Number, name, body and type of each channel.
channels! {
    1, "/raw", Raw(biflag::RawBytes), biflag::RawBytes, BIFLAG;
    2, "/telemetry", Telemetry(Box<biflag::Telemetry>), biflag::Telemetry, BIFLAG;
    3, "/attitude", Attitude(foxglove::FrameTransform), foxglove::FrameTransform, FRAME_TRANSFORM;
    4, "/command", Command(biflag::Command), biflag::Command, BIFLAG;
    5, "/dropout", Dropout(biflag::Dropout), biflag::Dropout, BIFLAG;
    6, "/event", Event(biflag::Event), biflag::Event, BIFLAG;
    7, "/truth", Truth(biflag::Truth), biflag::Truth, BIFLAG;
    8, "/forces", Forces(biflag::Forces), biflag::Forces, BIFLAG;
    9, "/flagella", Flagella(foxglove::SceneUpdate), foxglove::SceneUpdate, SCENE_UPDATE;
    10, "/flagella_points", FlagellaPoints(foxglove::PointCloud), foxglove::PointCloud, POINT_CLOUD;
    11, "/nodes", Nodes(biflag::Nodes), biflag::Nodes, BIFLAG;
    12, "/steering", Steering(Box<biflag::Steering>), biflag::Steering, BIFLAG;
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
