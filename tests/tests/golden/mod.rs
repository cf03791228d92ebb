//! Public names and values, held by the golden files in `tests/golden`: keys of JSON, columns, channels of logs, names of the
//! Python package, findings and intervals.

mod columns;
mod findings;
mod keys;
mod logs;
mod python;
mod recording;
