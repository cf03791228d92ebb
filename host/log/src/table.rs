//! A metadata record as stored in the log: a flat table of text keys and values, which any MCAP reader can show.
//!
//! MCAP protects chunks with a CRC, but not metadata records, so each record contains its own.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::BTreeMap;

/// Keys and values of a record.
pub type Table = BTreeMap<String, String>;

/// A type of metadata record.
pub trait Meta: Serialize + DeserializeOwned + Default {
    /// Name of the record in the log.
    const NAME: &'static str;
}

const CRC: &str = "crc32";

/// Keys of older logs: the record, the old key, and the present key.
const OLDER_KEYS: [(&str, &str, &str); 1] = [("steady", "newton_iterations", "sweeps")];

/// Converts a record to text and adds its CRC.
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

/// Returns whether the CRC of a record holds.
pub(super) fn is_intact(name: &str, table: &Table) -> bool {
    table.get(CRC).is_some_and(|saved| *saved == crc(name, table))
}

/// Returns whether a record has a CRC, like the records of biflag.
pub(super) fn has_crc(table: &Table) -> bool {
    table.contains_key(CRC)
}

/// Converts a record from text. Missing keys take their defaults and unknown ones are ignored, so logs of other
/// versions can be read.
pub(super) fn from_table<M: Meta>(table: &Table) -> Option<M> {
    let older = |now: &str| OLDER_KEYS.iter().find(|(name, _, key)| *name == M::NAME && *key == now);
    // The default value determines which fields are text.
    let mut object = fields(&M::default());
    for (key, value) in &mut object {
        if let Some(text) = table.get(key).or_else(|| table.get(older(key)?.1)) {
            *value = if value.is_string() { Value::String(text.clone()) } else { serde_json::from_str(text).ok()? };
        }
    }
    // Fields missing in the default value are text.
    for (key, text) in table {
        object.entry(key).or_insert_with(|| Value::String(text.clone()));
    }
    serde_json::from_value(Value::Object(object)).ok()
}

fn fields<M: Meta>(meta: &M) -> serde_json::Map<String, Value> {
    if let Ok(Value::Object(object)) = serde_json::to_value(meta) { object } else { serde_json::Map::new() }
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
