//! Rows of either engine.

use sqlx::error::BoxDynError;
use sqlx::postgres::{PgRow, PgValueRef};
use sqlx::sqlite::{SqliteRow, SqliteValueRef};
use sqlx::{Column, Decode, Error, Row as _, TypeInfo, ValueRef};

use super::value::{FromValue, Value, read};

/// A row of a result.
pub(in crate::store) enum Row {
    /// Of SQLite.
    Sqlite(SqliteRow),
    /// Of PostgreSQL.
    Postgres(PgRow),
}

impl Row {
    /// A column by its name.
    pub(in crate::store) fn named<T: FromValue>(&self, name: &str) -> Result<T, Error> {
        let value = match self {
            Self::Sqlite(row) => sqlite(row.try_get_raw(name)?),
            Self::Postgres(row) => postgres(row.try_get_raw(name)?),
        };
        value.and_then(read).map_err(|source| Error::ColumnDecode { index: name.to_owned(), source })
    }

    /// A column by its place.
    pub(in crate::store) fn at<T: FromValue>(&self, place: usize) -> Result<T, Error> {
        self.value(place).and_then(|value| {
            read(value).map_err(|source| Error::ColumnDecode { index: place.to_string(), source })
        })
    }

    /// The value at a place; none for null.
    pub(in crate::store) fn value(&self, place: usize) -> Result<Option<Value>, Error> {
        let value = match self {
            Self::Sqlite(row) => sqlite(row.try_get_raw(place)?),
            Self::Postgres(row) => postgres(row.try_get_raw(place)?),
        };
        value.map_err(|source| Error::ColumnDecode { index: place.to_string(), source })
    }

    /// Names of the columns.
    pub(in crate::store) fn names(&self) -> Vec<String> {
        match self {
            Self::Sqlite(row) => row.columns().iter().map(|column| column.name().to_owned()).collect(),
            Self::Postgres(row) => row.columns().iter().map(|column| column.name().to_owned()).collect(),
        }
    }

    /// A column in a test.
    #[cfg(test)]
    pub(in crate::store) fn get<T: FromValue>(&self, name: &str) -> T {
        self.named(name).unwrap()
    }
}

fn sqlite(value: SqliteValueRef<'_>) -> Result<Option<Value>, BoxDynError> {
    if value.is_null() {
        return Ok(None);
    }
    let kind = value.type_info().name().to_owned();
    Ok(Some(match kind.as_str() {
        "INTEGER" => Value::Integer(Some(Decode::<sqlx::Sqlite>::decode(value)?)),
        "REAL" => Value::Real(Some(Decode::<sqlx::Sqlite>::decode(value)?)),
        "TEXT" => Value::Text(Some(Decode::<sqlx::Sqlite>::decode(value)?)),
        "BLOB" => Value::Blob(Some(Decode::<sqlx::Sqlite>::decode(value)?)),
        other => return Err(format!("unexpected type {other}").into()),
    }))
}

fn postgres(value: PgValueRef<'_>) -> Result<Option<Value>, BoxDynError> {
    if value.is_null() {
        return Ok(None);
    }
    let kind = value.type_info().name().to_owned();
    let text = |value: PgValueRef<'_>| value.as_str().map(str::to_owned);
    Ok(Some(match kind.as_str() {
        "BOOL" => Value::Integer(Some(<bool as Decode<sqlx::Postgres>>::decode(value)?.into())),
        "INT8" => Value::Integer(Some(Decode::<sqlx::Postgres>::decode(value)?)),
        "INT4" => Value::Integer(Some(<i32 as Decode<sqlx::Postgres>>::decode(value)?.into())),
        "FLOAT8" => Value::Real(Some(Decode::<sqlx::Postgres>::decode(value)?)),
        // JSON comes as its text.
        "TEXT" | "VARCHAR" | "NAME" | "JSON" | "unknown" => Value::Text(Some(text(value)?)),
        "BYTEA" => Value::Blob(Some(Decode::<sqlx::Postgres>::decode(value)?)),
        other => return Err(format!("unexpected type {other}: cast it in the query").into()),
    }))
}
