//! Lists of a given length in files. serde itself passes over what is too much in an array.

use serde::de::{Deserialize, Deserializer, Error};

/// A list of `N` values.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Exactly<T, const N: usize>(pub [T; N]);

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Exactly<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let list = Vec::deserialize(deserializer)?;
        let count = list.len();
        list.try_into().map(Self).map_err(|_| D::Error::custom(format!("a list of {count} where {N} are expected")))
    }
}

/// For `#[serde(deserialize_with)]` on an optional array.
pub(crate) fn optional<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    deserializer: D,
) -> Result<Option<[T; N]>, D::Error> {
    Ok(Option::<Exactly<T, N>>::deserialize(deserializer)?.map(|list| list.0))
}
