//! A metadata record as it stands in the log: a flat table of keys and values as text, plain to any reader of MCAP.
//!
//! MCAP guards its chunks with a CRC, but not these records, so each carries one of its own.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::BTreeMap;

/// Keys and values of a record.
pub type Table = BTreeMap<String, String>;

/// A kind of record.
pub trait Meta: Serialize + DeserializeOwned + Default {
    /// Its name in the log.
    const NAME: &'static str;
}

const CRC: &str = "crc32";

/// A record as text, with its CRC.
pub(super) fn to_table<M: Meta>(meta: &M) -> Table {
    let mut table: Table = fields(meta)
        .into_iter()
        .map(|(key, value)| match value {
            Value::String(text) => (key, text),
            other => (key, other.to_string()),
        })
        .collect();
    let crc = crc(M::NAME, &table);
    table.insert(CRC.to_owned(), crc);
    table
}

/// Whether a record is as it was written.
pub(super) fn is_intact(name: &str, table: &Table) -> bool {
    table.get(CRC).is_some_and(|saved| *saved == crc(name, table))
}

/// A record from its text. Keys that are missing take their defaults, others are passed over, so that logs of other
/// versions still read.
pub(super) fn from_table<M: Meta>(table: &Table) -> Option<M> {
    // The default tells which fields are text.
    let mut object = fields(&M::default());
    for (key, value) in &mut object {
        if let Some(text) = table.get(key) {
            *value = if value.is_string() { Value::String(text.clone()) } else { serde_json::from_str(text).ok()? };
        }
    }
    serde_json::from_value(Value::Object(object)).ok()
}

fn fields<M: Meta>(meta: &M) -> serde_json::Map<String, Value> {
    match serde_json::to_value(meta) {
        Ok(Value::Object(object)) => object,
        _ => serde_json::Map::new(),
    }
}

fn crc(name: &str, table: &Table) -> String {
    let pairs = table.iter().filter(|(key, _)| *key != CRC).flat_map(|(key, value)| [key.as_str(), value.as_str()]);
    let mut hasher = crc32fast::Hasher::new();
    for text in std::iter::once(name).chain(pairs) {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    }
    format!("{:08x}", hasher.finalize())
}
