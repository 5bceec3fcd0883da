//! Columns as a Parquet file: one row group, every column optional, no compression, so that every reader can read it.

use std::collections::BTreeMap;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use serde_json::{Value, json};

use super::table::{Column, ColumnKind, text};

/// Key of the units in the metadata of a file: a JSON object with the unit of each column that has one.
pub(super) const UNITS_KEY: &str = "roost.units";

/// Key of the attributes of a data frame, which pandas reads as `attrs`.
pub(super) const PANDAS_KEY: &str = "PANDAS_ATTRS";

/// Columns as a Parquet file, with units by name of column in its metadata. Each column is dropped once it is written.
pub(crate) fn to_parquet(columns: Vec<Column>, units: &BTreeMap<String, String>) -> Result<Vec<u8>> {
    let fields = columns.iter().map(|column| field(column).map(Arc::new)).collect::<Result<_>>()?;
    let schema = Arc::new(Type::group_type_builder("results").with_fields(fields).build()?);
    let properties = WriterProperties::builder()
        .set_created_by(concat!("roost ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(vec![
            KeyValue::new(UNITS_KEY.to_owned(), json!(units).to_string()),
            KeyValue::new(PANDAS_KEY.to_owned(), json!({ "units": units }).to_string()),
        ]))
        .build();
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for column in columns {
        match column.kind {
            ColumnKind::Integer => write::<Int64Type>(&mut group, &column, Value::as_i64)?,
            ColumnKind::Number => write::<DoubleType>(&mut group, &column, Value::as_f64)?,
            ColumnKind::Flag => write::<BoolType>(&mut group, &column, Value::as_bool)?,
            ColumnKind::Text => {
                let bytes = |value: &Value| text(value).map(|text| ByteArray::from(text.into_bytes()));
                write::<ByteArrayType>(&mut group, &column, bytes)?;
            }
        }
    }
    group.close()?;
    writer.into_inner()
}

fn field(column: &Column) -> Result<Type> {
    let (physical, logical) = match column.kind {
        ColumnKind::Integer => (Physical::INT64, None),
        ColumnKind::Number => (Physical::DOUBLE, None),
        ColumnKind::Flag => (Physical::BOOLEAN, None),
        ColumnKind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
    };
    Type::primitive_type_builder(&column.name, physical)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(logical)
        .build()
}

/// Writes the values, and for every row whether it has one.
fn write<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    column: &Column,
    value: impl Fn(&Value) -> Option<T::T>,
) -> Result<()> {
    let rows: Vec<Option<T::T>> = column.values.iter().map(value).collect();
    let levels: Vec<i16> = rows.iter().map(|row| i16::from(row.is_some())).collect();
    let values: Vec<T::T> = rows.into_iter().flatten().collect();
    let Some(mut writer) = group.next_column()? else {
        return Err(ParquetError::General("there are more columns than fields".to_owned()));
    };
    writer.typed::<T>().write_batch(&values, Some(&levels), None)?;
    writer.close()
}
