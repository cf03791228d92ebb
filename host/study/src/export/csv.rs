//! Writes tables as CSV: header lines that begin with `#`, then the names of the columns, then the rows.

use super::table::{Table, Values};
use std::fmt::Write as _;
use std::io::{Result, Write};

pub(super) fn write(table: &Table, target: impl Write) -> Result<()> {
    let mut writer = Writer::new(table, target)?;
    writer.rows(table)?;
    writer.close()
}

/// Writes a table in parts.
pub(crate) struct Writer<W: Write> {
    rows: csv::Writer<W>,
}

impl<W: Write> Writer<W> {
    /// Writes the header of tables like this one.
    pub fn new(table: &Table, mut target: W) -> Result<Self> {
        for line in &table.header {
            writeln!(target, "# {}", line.replace(['\n', '\r'], " "))?;
        }
        for column in table.columns.iter().filter(|column| !column.about.is_empty()) {
            let unit = if column.unit.is_empty() { String::new() } else { format!(" [{}]", column.unit) };
            writeln!(target, "# {}{unit}: {}", column.name, column.about)?;
        }
        let mut rows = csv::Writer::from_writer(target);
        rows.write_record(table.columns.iter().map(|column| column.name.as_ref()))?;
        Ok(Self { rows })
    }

    /// Writes rows of the same columns.
    pub fn rows(&mut self, table: &Table) -> Result<()> {
        let mut text = String::new();
        for row in 0..table.rows() {
            for column in &table.columns {
                text.clear();
                self.rows.write_field(cell(&column.values, row, &mut text))?;
            }
            self.rows.write_record(None::<&[u8]>)?;
        }
        Ok(())
    }

    /// Ends the table.
    pub fn close(mut self) -> Result<()> {
        self.rows.flush()
    }
}

/// Returns a value as text, which is written to `text` if it is a number.
fn cell<'a>(values: &'a Values, row: usize, text: &'a mut String) -> &'a str {
    // Writing to a text cannot fail.
    let _ = match values {
        Values::Real(values) | Values::Exact(values) if values[row].is_nan() => Ok(()),
        // Nine decimals exceed the resolution of every sensor and avoid the noise of binary fractions.
        Values::Real(values) => write!(text, "{}", (values[row] * 1e9).round() / 1e9),
        Values::Exact(values) => write!(text, "{}", values[row]),
        Values::Int(values) => write!(text, "{}", values[row]),
        Values::Text(values) => return &values[row],
    };
    text
}
