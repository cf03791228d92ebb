//! The table of the telemetry as Apache Parquet.

use super::Sink;
use super::columns::{COLUMNS, Cell};
use crate::log::schema::biflag::Telemetry;
use crate::log::{Body, Message};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::io::{self, Write};
use std::sync::Arc;

/// Rows that are kept in memory before they are written.
const GROUP: usize = 24_000;

pub(super) struct Table<W: Write + Send> {
    writer: SerializedFileWriter<W>,
    /// The cells of the present group, by column.
    columns: Vec<Vec<Cell>>,
}

impl<W: Write + Send> Table<W> {
    pub fn new(target: W) -> io::Result<Self> {
        let fields = COLUMNS
            .iter()
            .map(|column| {
                // What kind of value a column has, any row tells.
                let nothing = Message {
                    topic: String::new(),
                    sequence: 0,
                    log_time_ns: 0,
                    publish_time_ns: 0,
                    body: Body::Other(Vec::new()),
                };
                let (physical, logical) = match (column.cell)(&nothing, &Telemetry::default()) {
                    Cell::Real(_) => (Physical::DOUBLE, None),
                    Cell::Int(_) => (Physical::INT64, None),
                    Cell::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
                };
                Type::primitive_type_builder(column.name, physical)
                    .with_repetition(Repetition::REQUIRED)
                    .with_logical_type(logical)
                    .build()
                    .map(Arc::new)
            })
            .collect::<Result<Vec<_>, _>>()
            .map_err(io_error)?;
        let schema = Type::group_type_builder("telemetry").with_fields(fields).build().map_err(io_error)?;
        let properties = WriterProperties::builder().set_compression(Compression::ZSTD(ZstdLevel::default())).build();
        let writer = SerializedFileWriter::new(target, Arc::new(schema), Arc::new(properties)).map_err(io_error)?;
        Ok(Self { writer, columns: vec![Vec::new(); COLUMNS.len()] })
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        for cells in &mut self.columns {
            let Some(mut column) = group.next_column()? else { break };
            let cells = std::mem::take(cells);
            match cells.first() {
                Some(Cell::Real(_)) => {
                    let values: Vec<f64> = cells.iter().filter_map(Cell::real).collect();
                    column.typed::<DoubleType>().write_batch(&values, None, None)?;
                }
                Some(Cell::Int(_)) => {
                    let values: Vec<i64> = cells.iter().filter_map(Cell::int).collect();
                    column.typed::<Int64Type>().write_batch(&values, None, None)?;
                }
                _ => {
                    let values: Vec<ByteArray> = cells.iter().filter_map(Cell::text).map(ByteArray::from).collect();
                    column.typed::<ByteArrayType>().write_batch(&values, None, None)?;
                }
            }
            column.close()?;
        }
        group.close().map(drop)
    }
}

impl<W: Write + Send> Sink for Table<W> {
    fn row(&mut self, message: &Message) -> io::Result<bool> {
        let Body::Telemetry(telemetry) = &message.body else { return Ok(false) };
        for (cells, column) in self.columns.iter_mut().zip(COLUMNS) {
            cells.push((column.cell)(message, telemetry));
        }
        if self.columns.first().is_some_and(|cells| cells.len() >= GROUP) {
            self.write_group().map_err(io_error)?;
        }
        Ok(true)
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        if self.columns.first().is_some_and(|cells| !cells.is_empty()) {
            self.write_group().map_err(io_error)?;
        }
        self.writer.close().map(drop).map_err(io_error)
    }
}

impl Cell {
    fn real(&self) -> Option<f64> {
        if let Self::Real(value) = self { Some(*value) } else { None }
    }

    fn int(&self) -> Option<i64> {
        if let Self::Int(value) = self { Some(*value) } else { None }
    }

    fn text(&self) -> Option<&'static str> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }
}

fn io_error(error: ParquetError) -> io::Error {
    io::Error::other(error)
}
