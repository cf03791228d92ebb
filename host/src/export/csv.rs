//! Writes tables as CSV: header lines that begin with `#`, then the names of the columns, then the rows.

use super::table::{Table, Values};
use std::io::{Result, Write};

pub(super) fn write(table: &Table, mut target: impl Write) -> Result<()> {
    for line in &table.header {
        writeln!(target, "# {}", line.replace(['\n', '\r'], " "))?;
    }
    for column in table.columns.iter().filter(|column| !column.about.is_empty()) {
        writeln!(target, "# {}: {}", column.name, column.about)?;
    }
    let mut writer = csv::Writer::from_writer(target);
    writer.write_record(table.columns.iter().map(|column| column.name))?;
    for row in 0..table.rows() {
        writer.write_record(table.columns.iter().map(|column| cell(&column.values, row)))?;
    }
    writer.flush()
}

fn cell(values: &Values, row: usize) -> String {
    match values {
        Values::Real(values) if values[row].is_nan() => String::new(),
        // Nine decimals exceed the resolution of every sensor and avoid the noise of binary fractions.
        Values::Real(values) => ((values[row] * 1e9).round() / 1e9).to_string(),
        Values::Int(values) => values[row].to_string(),
        Values::Text(values) => values[row].clone(),
    }
}
