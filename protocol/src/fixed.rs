//! Numbers as their bytes, little-endian, for `#[serde(with)]`.

macro_rules! unsigned {
    ($name:ident) => {
        pub mod $name {
            use serde::{Deserialize, Deserializer, Serialize, Serializer};

            pub fn serialize<S: Serializer>(number: &$name, serializer: S) -> Result<S::Ok, S::Error> {
                number.to_le_bytes().serialize(serializer)
            }

            pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<$name, D::Error> {
                Deserialize::deserialize(deserializer).map($name::from_le_bytes)
            }
        }
    };
}

macro_rules! signed {
    ($name:ident, $unsigned:ident) => {
        pub mod $name {
            use serde::{Deserializer, Serializer};

            pub fn serialize<S: Serializer>(number: &$name, serializer: S) -> Result<S::Ok, S::Error> {
                super::$unsigned::serialize(&number.cast_unsigned(), serializer)
            }

            pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<$name, D::Error> {
                super::$unsigned::deserialize(deserializer).map($unsigned::cast_signed)
            }
        }
    };
}

unsigned!(u16);
unsigned!(u32);
signed!(i16, u16);
signed!(i32, u32);

pub mod f32 {
    use serde::{Deserializer, Serializer};

    pub fn serialize<S: Serializer>(number: &f32, serializer: S) -> Result<S::Ok, S::Error> {
        super::u32::serialize(&number.to_bits(), serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f32, D::Error> {
        super::u32::deserialize(deserializer).map(f32::from_bits)
    }
}
