//! Writes tables as CSV: header lines that begin with `#`, then the names of the columns, then the rows.

use super::table::{Table, Values};
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
        let mut text = Vec::new();
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
fn cell<'a>(values: &'a Values, row: usize, text: &'a mut Vec<u8>) -> &'a [u8] {
    // Writing to memory cannot fail.
    let _ = match values {
        Values::Real(values) | Values::Exact(values) if values[row].is_nan() => Ok(()),
        // Nine decimals exceed the resolution of every sensor and avoid the noise of binary fractions.
        Values::Real(values) if values[row].abs() < 1e6 => return decimal((values[row] * 1e9).round(), text),
        Values::Real(values) | Values::Exact(values) => write!(text, "{}", values[row]),
        Values::Int(values) => write!(text, "{}", values[row]),
        Values::Text(values) => return values[row].as_bytes(),
    };
    text
}

/// Writes a whole number of billionths, of at most 15 digits, as a decimal number.
fn decimal(billionths: f64, text: &mut Vec<u8>) -> &[u8] {
    const UNIT: u64 = 1_000_000_000;
    let (all, mut digits) = (billionths.abs() as u64, itoa::Buffer::new());
    text.extend(billionths.is_sign_negative().then_some(b'-'));
    text.extend(digits.format((all / UNIT) as u32).as_bytes());
    let part = all % UNIT;
    if part > 0 {
        text.push(b'.');
        text.extend(&digits.format((UNIT + part) as u32).as_bytes()[1..]);
        let end = text.iter().rposition(|digit| *digit != b'0');
        text.truncate(end.map_or(0, |last| last + 1));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// A double has 15 digits, so none but these are the shortest that are read as it again.
        #[test]
        fn numbers_have_the_fewest_digits(sign in prop::bool::ANY, places in 0..16u32, digits in 0..1_000_000_000_000_000u64) {
            let billionths = (digits / 10u64.pow(places.min(15))) as f64 * if sign { -1.0 } else { 1.0 };
            let text = String::from_utf8(decimal(billionths, &mut Vec::new()).to_vec()).unwrap();
            prop_assert_eq!(text, format!("{}", billionths / 1e9));
        }
    }
}
