//! Tables as Apache Parquet. The file's metadata holds the header under the key `about` and, if the table has units,
//! the unit and description of each column under `columns`, as JSON.

use super::table::{Column, Table, Values};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::record::Field;
use parquet::schema::types::Type;
use std::fs::File;
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

/// Returns the table of a file. Missing numbers become NaN; a column of integers that may be missing becomes real.
///
/// # Errors
/// Why it cannot be read.
pub(crate) fn read(file: File) -> Result<Table, String> {
    let text = |error: ParquetError| error.to_string();
    let reader = SerializedFileReader::new(file).map_err(text)?;
    let meta = reader.metadata().file_metadata();
    let noted = |key: &str| meta.key_value_metadata()?.iter().find(|entry| entry.key == key)?.value.clone();
    let columns: serde_json::Value =
        noted("columns").and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default();
    let header = noted("about").unwrap_or_default();
    let mut table = Table { header: header.lines().map(str::to_owned).collect(), columns: Vec::new() };
    for column in meta.schema_descr().columns() {
        let name = column.name();
        let about = |key: &str| columns[name][key].as_str().unwrap_or_default().to_owned();
        let is_whole = column.self_type().get_basic_info().repetition() == Repetition::REQUIRED;
        let values = match column.physical_type() {
            Physical::BYTE_ARRAY => Values::Text(Vec::new()),
            Physical::INT32 | Physical::INT64 if is_whole => Values::Int(Vec::new()),
            _ => Values::Exact(Vec::new()),
        };
        let (unit, about) = (about("unit").into(), about("about").into());
        table.columns.push(Column { name: name.to_owned().into(), unit, about, values });
    }
    for row in reader.get_row_iter(None).map_err(text)? {
        let row = row.map_err(text)?;
        for (column, (_, field)) in table.columns.iter_mut().zip(row.get_column_iter()) {
            push(&mut column.values, field);
        }
    }
    Ok(table)
}

/// Adds a value to a column of its type. Values other than text and numbers count as missing.
fn push(values: &mut Values, field: &Field) {
    let number = match field {
        Field::Double(value) => *value,
        Field::Float(value) => f64::from(*value),
        Field::Int(value) => f64::from(*value),
        Field::Long(value) => *value as f64,
        Field::Byte(value) => f64::from(*value),
        Field::UByte(value) => f64::from(*value),
        Field::Short(value) => f64::from(*value),
        Field::UShort(value) => f64::from(*value),
        Field::UInt(value) => f64::from(*value),
        Field::ULong(value) => *value as f64,
        _ => f64::NAN,
    };
    match (values, field) {
        (Values::Text(values), Field::Str(text)) => values.push(text.clone()),
        (Values::Text(values), _) => values.push(String::new()),
        (Values::Int(values), Field::Long(value)) => values.push(*value),
        (Values::Int(values), _) => values.push(number as i64),
        (Values::Real(values) | Values::Exact(values), _) => values.push(number),
    }
}
