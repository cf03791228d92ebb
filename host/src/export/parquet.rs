//! Writes tables as Apache Parquet, with the header in the file's metadata under the key `about`.

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
    try_write(table, target).map_err(io::Error::other)
}

fn try_write(table: &Table, target: impl Write + Send) -> Result<(), ParquetError> {
    let fields = table.columns.iter().map(|column| {
        let (physical, logical, repetition) = match &column.values {
            Values::Real(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
            Values::Int(_) => (Physical::INT64, None, Repetition::REQUIRED),
            Values::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String), Repetition::REQUIRED),
        };
        Type::primitive_type_builder(column.name, physical)
            .with_repetition(repetition)
            .with_logical_type(logical)
            .build()
            .map(Arc::new)
    });
    let schema = Type::group_type_builder("trial").with_fields(fields.collect::<Result<_, _>>()?).build()?;
    let abouts = table.columns.iter().filter(|column| !column.about.is_empty());
    let abouts = abouts.map(|column| format!("{}: {}", column.name, column.about));
    let about: Vec<_> = table.header.iter().cloned().chain(abouts).collect();
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(vec![KeyValue::new("about".to_owned(), about.join("\n"))]))
        .build();
    let mut writer = SerializedFileWriter::new(target, Arc::new(schema), Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for column in &table.columns {
        let Some(mut target) = group.next_column()? else { break };
        match &column.values {
            Values::Real(values) => {
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
    writer.close().map(drop)
}
