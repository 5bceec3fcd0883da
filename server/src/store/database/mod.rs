//! The database below the store: SQLite or PostgreSQL, behind one set of types.
//!
//! Every query has one text. [`dialect`] turns it into what PostgreSQL accepts. Values of parameters and columns are null, integers,
//! reals, texts and blobs; a boolean is 0 or 1.

mod builder;
mod connection;
mod dialect;
pub(in crate::store) mod postgres;
mod query;
mod row;
pub(in crate::store) mod sqlite;
mod value;

pub(in crate::store) use builder::Builder;
pub(in crate::store) use connection::{Connection, Engine, Pool};
pub(in crate::store) use query::{query, query_as, query_scalar, raw_sql};
pub(in crate::store) use row::Row;
pub(in crate::store) use sqlx::AssertSqlSafe;
pub(in crate::store) use value::{FromValue, Value};
