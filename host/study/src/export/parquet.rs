//! Writes tables as Apache Parquet, with the header in the file's metadata under the key `about`, and under `columns` unit
//! and description of each column as JSON where the table has units.

use super::table::{Table, Values};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::io::{self, Write};
use std::sync::Arc;

pub(super) fn write(table: &Table, target: impl Write + Send) -> io::Result<()> {
    let mut writer = Writer::new(table, target)?;
    writer.rows(table)?;
    writer.close()
}

/// Writes a table in parts, one row group each.
pub(crate) struct Writer<W: Write + Send> {
    file: SerializedFileWriter<W>,
}

impl<W: Write + Send> Writer<W> {
    /// Starts a file for tables like this one.
    pub fn new(table: &Table, target: W) -> io::Result<Self> {
        Ok(Self { file: start(table, target)? })
    }

    /// Writes rows of the same columns.
    pub fn rows(&mut self, table: &Table) -> io::Result<()> {
        let mut group = self.file.next_row_group()?;
        for column in &table.columns {
            let Some(mut target) = group.next_column()? else { break };
            match &column.values {
                Values::Real(values) | Values::Exact(values) => {
                    let levels: Vec<i16> = values.iter().map(|value| i16::from(!value.is_nan())).collect();
                    let values: Vec<f64> = values.iter().copied().filter(|value| !value.is_nan()).collect();
                    target.typed::<DoubleType>().write_batch(&values, Some(&levels), None)?;
                }
                Values::Int(values) => {
                    target.typed::<Int64Type>().write_batch(values, None, None)?;
                }
                Values::Text(values) => {
                    let values: Vec<ByteArray> = values.iter().map(|text| ByteArray::from(text.as_str())).collect();
                    target.typed::<ByteArrayType>().write_batch(&values, None, None)?;
                }
            }
            target.close()?;
        }
        group.close()?;
        Ok(())
    }

    /// Ends the file.
    pub fn close(self) -> io::Result<()> {
        self.file.close()?;
        Ok(())
    }
}

fn start<W: Write + Send>(table: &Table, target: W) -> Result<SerializedFileWriter<W>, ParquetError> {
    let fields = table.columns.iter().map(|column| {
        let (physical, logical, repetition) = match &column.values {
            Values::Real(_) | Values::Exact(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
            Values::Int(_) => (Physical::INT64, None, Repetition::REQUIRED),
            Values::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String), Repetition::REQUIRED),
        };
        Type::primitive_type_builder(&column.name, physical)
            .with_repetition(repetition)
            .with_logical_type(logical)
            .build()
            .map(Arc::new)
    });
    let schema = Type::group_type_builder("trial").with_fields(fields.collect::<Result<_, _>>()?).build()?;
    let abouts = table.columns.iter().filter(|column| !column.about.is_empty());
    let abouts = abouts.map(|column| format!("{}: {}", column.name, column.about));
    let about: Vec<_> = table.header.iter().cloned().chain(abouts).collect();
    let mut metadata = vec![KeyValue::new("about".to_owned(), about.join("\n"))];
    if table.columns.iter().any(|column| !column.unit.is_empty()) {
        let columns = table.columns.iter().map(|column| {
            let about = serde_json::json!({ "unit": column.unit, "about": column.about });
            (column.name.to_string(), about)
        });
        let columns = serde_json::Value::Object(columns.collect());
        metadata.push(KeyValue::new("columns".to_owned(), columns.to_string()));
    }
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata))
        .build();
    SerializedFileWriter::new(target, Arc::new(schema), Arc::new(properties))
}
