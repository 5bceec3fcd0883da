//! Queries with their parameters, on either engine.

use std::marker::PhantomData;

use futures_util::stream::{self, BoxStream};
use futures_util::{StreamExt, TryStreamExt};
use sqlx::pool::PoolConnection;
use sqlx::postgres::PgArguments;
use sqlx::sqlite::SqliteArguments;
use sqlx::{Arguments, AssertSqlSafe, Error, PgConnection, Postgres, SqlSafeStr, SqlStr};
use tokio::time::timeout;

use super::connection::Executor;
use super::dialect::{Statement, statements, translate};
use super::postgres;
use super::row::Row;
use super::value::{FromValue, Value, without_zero};

/// The effect of a statement without rows.
#[derive(Clone, Copy, Debug)]
pub(in crate::store) struct Done(u64);

impl Done {
    /// Number of inserted, updated or deleted rows.
    pub(in crate::store) fn rows_affected(self) -> u64 {
        self.0
    }
}

/// A query. Several statements, separated by semicolons, take their parameters one after the other.
pub(in crate::store) struct Query {
    text: SqlStr,
    values: Vec<Value>,
    is_reused: bool,
}

/// A query of a text. Parameters are `?`, or `?1`, `?2` and so on in a single statement.
pub(in crate::store) fn query(text: impl SqlSafeStr) -> Query {
    Query { text: text.into_sql_str(), values: Vec::new(), is_reused: true }
}

impl Query {
    /// A query that a program builds: its text does not return.
    pub(super) fn built(text: String, values: Vec<Value>) -> Self {
        Self { text: AssertSqlSafe(text).into_sql_str(), values, is_reused: false }
    }

    /// The value of the next parameter.
    pub(in crate::store) fn bind(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    /// All rows.
    pub(in crate::store) async fn fetch_all(self, on: impl Into<Executor<'_>>) -> Result<Vec<Row>, Error> {
        Ok(match on.into() {
            Executor::Sqlite(on) => sqlite_rows(self.for_sqlite()?.fetch_all(on).await?),
            Executor::SqlitePool(on) => sqlite_rows(self.for_sqlite()?.fetch_all(on).await?),
            Executor::Postgres(on) => self.postgres_rows(on).await?,
            Executor::LentPostgres(on) => in_time(on, async |on| self.postgres_rows(on).await).await?,
            Executor::PostgresPool(on) => {
                in_time(&mut on.acquire().await?, async |on| self.postgres_rows(on).await).await?
            }
        })
    }

    /// The first row, if there is one.
    pub(in crate::store) async fn fetch_optional(
        self,
        on: impl Into<Executor<'_>>,
    ) -> Result<Option<Row>, Error> {
        Ok(match on.into() {
            Executor::Sqlite(on) => self.for_sqlite()?.fetch_optional(on).await?.map(Row::Sqlite),
            Executor::SqlitePool(on) => self.for_sqlite()?.fetch_optional(on).await?.map(Row::Sqlite),
            Executor::Postgres(on) => self.postgres_row(on).await?,
            Executor::LentPostgres(on) => in_time(on, async |on| self.postgres_row(on).await).await?,
            Executor::PostgresPool(on) => {
                in_time(&mut on.acquire().await?, async |on| self.postgres_row(on).await).await?
            }
        })
    }

    /// The first row.
    pub(in crate::store) async fn fetch_one(self, on: impl Into<Executor<'_>>) -> Result<Row, Error> {
        self.fetch_optional(on).await?.ok_or(Error::RowNotFound)
    }

    /// Rows as they come. PostgreSQL sends all of them, also if the reader stops; from a pool, they come together.
    pub(in crate::store) fn fetch<'c>(
        self,
        on: impl Into<Executor<'c>>,
    ) -> BoxStream<'c, Result<Row, Error>> {
        let on = on.into();
        async_stream(
            move |query| match on {
                Executor::Sqlite(on) => Ok(query.for_sqlite()?.fetch(on).map_ok(Row::Sqlite).boxed()),
                Executor::SqlitePool(on) => Ok(query.for_sqlite()?.fetch(on).map_ok(Row::Sqlite).boxed()),
                Executor::Postgres(on) => Ok(query.for_postgres()?.fetch(on).map_ok(Row::Postgres).boxed()),
                Executor::LentPostgres(on) => {
                    Ok(query.for_postgres()?.fetch(&mut **on).map_ok(Row::Postgres).boxed())
                }
                Executor::PostgresPool(_) => Ok(stream::once(query.fetch_all(on))
                    .map_ok(|rows| stream::iter(rows.into_iter().map(Ok)))
                    .try_flatten()
                    .boxed()),
            },
            self,
        )
    }

    /// Executes it, and drops its rows.
    pub(in crate::store) async fn execute(self, on: impl Into<Executor<'_>>) -> Result<Done, Error> {
        Ok(Done(match on.into() {
            Executor::Sqlite(on) => self.for_sqlite()?.execute(on).await?.rows_affected(),
            Executor::SqlitePool(on) => self.for_sqlite()?.execute(on).await?.rows_affected(),
            Executor::Postgres(on) => self.postgres_changes(on).await?,
            Executor::LentPostgres(on) => self.postgres_changes(on).await?,
            Executor::PostgresPool(on) => self.postgres_changes(&mut *on.acquire().await?).await?,
        }))
    }

    fn for_sqlite(self) -> Result<sqlx::query::Query<'static, sqlx::Sqlite, SqliteArguments>, Error> {
        let mut arguments = SqliteArguments::default();
        for value in self.values {
            let added = match value {
                Value::Integer(value) => arguments.add(value),
                Value::Real(value) => arguments.add(value),
                Value::Text(value) => arguments.add(value),
                Value::Blob(value) => arguments.add(value),
            };
            added.map_err(Error::Encode)?;
        }
        Ok(sqlx::query_with(self.text, arguments).persistent(self.is_reused))
    }

    /// A query of one statement.
    fn for_postgres(self) -> Result<sqlx::query::Query<'static, sqlx::Postgres, PgArguments>, Error> {
        let statements = self.statements();
        postgres_query(&statements[0], &self.values, self.is_reused)
    }

    fn statements(&self) -> std::sync::Arc<[Statement]> {
        if self.is_reused { statements(self.text.as_str()) } else { translate(self.text.as_str()).into() }
    }

    async fn postgres_row(self, on: &mut PgConnection) -> Result<Option<Row>, Error> {
        if self.statements().len() == 1 {
            return Ok(self.for_postgres()?.fetch_optional(on).await?.map(Row::Postgres));
        }
        Ok(self.postgres_rows(on).await?.into_iter().next())
    }

    async fn postgres_rows(self, on: &mut PgConnection) -> Result<Vec<Row>, Error> {
        let (mut rows, mut values) = (Vec::new(), &self.values[..]);
        for statement in self.statements().iter() {
            let query = postgres_query(statement, values, self.is_reused)?;
            rows.extend(query.fetch_all(&mut *on).await?.into_iter().map(Row::Postgres));
            values = values.get(statement.parameters..).unwrap_or_default();
        }
        Ok(rows)
    }

    async fn postgres_changes(self, on: &mut PgConnection) -> Result<u64, Error> {
        let (mut changes, mut values) = (0, &self.values[..]);
        for statement in self.statements().iter() {
            let query = postgres_query(statement, values, self.is_reused)?;
            changes += query.execute(&mut *on).await?.rows_affected();
            values = values.get(statement.parameters..).unwrap_or_default();
        }
        Ok(changes)
    }
}

/// A stream that begins with an error if its query cannot be made.
fn async_stream<'c>(
    start: impl FnOnce(Query) -> Result<BoxStream<'c, Result<Row, Error>>, Error>,
    query: Query,
) -> BoxStream<'c, Result<Row, Error>> {
    start(query).unwrap_or_else(|error| futures_util::stream::once(async { Err(error) }).boxed())
}

/// A lent connection that reads. If the read does not end, because it is late or nobody waits for it any more, the connection is closed: a
/// pool would wait for it without a limit.
struct Reading<'c> {
    on: &'c mut PoolConnection<Postgres>,
    has_ended: bool,
}

impl Drop for Reading<'_> {
    fn drop(&mut self) {
        if !self.has_ended {
            self.on.close_on_drop();
        }
    }
}

/// Reads on a lent connection of PostgreSQL within the deadline of a read.
async fn in_time<T>(
    on: &mut PoolConnection<Postgres>,
    read: impl AsyncFnOnce(&mut PgConnection) -> Result<T, Error>,
) -> Result<T, Error> {
    let mut reading = Reading { on, has_ended: false };
    let read = timeout(postgres::READ_DEADLINE, read(&mut *reading.on)).await;
    reading.has_ended = read.is_ok();
    read.unwrap_or_else(|_| Err(postgres::late()))
}

fn sqlite_rows(rows: Vec<sqlx::sqlite::SqliteRow>) -> Vec<Row> {
    rows.into_iter().map(Row::Sqlite).collect()
}

/// A statement with the first of these values.
fn postgres_query(
    statement: &Statement,
    values: &[Value],
    is_reused: bool,
) -> Result<sqlx::query::Query<'static, sqlx::Postgres, PgArguments>, Error> {
    let mut arguments = PgArguments::default();
    for value in values.iter().take(statement.parameters) {
        let added = match value {
            Value::Integer(value) => arguments.add(*value),
            Value::Real(value) => arguments.add(*value),
            Value::Text(value) => arguments.add(value.as_deref().map(without_zero)),
            Value::Blob(value) => arguments.add(value.as_deref()),
        };
        added.map_err(Error::Encode)?;
    }
    Ok(sqlx::query_with(AssertSqlSafe(statement.text.clone()), arguments).persistent(is_reused))
}

/// Executes a text of any number of statements without parameters.
pub(in crate::store) fn raw_sql(text: impl SqlSafeStr) -> Script {
    Script(text.into_sql_str())
}

/// Statements without parameters.
pub(in crate::store) struct Script(SqlStr);

impl Script {
    /// Executes all of them.
    pub(in crate::store) async fn execute(self, on: impl Into<Executor<'_>>) -> Result<(), Error> {
        let text = sqlx::raw_sql(self.0);
        match on.into() {
            Executor::Sqlite(on) => text.execute(on).await.map(drop),
            Executor::SqlitePool(on) => text.execute(on).await.map(drop),
            Executor::Postgres(on) => text.execute(on).await.map(drop),
            Executor::LentPostgres(on) => text.execute(&mut **on).await.map(drop),
            Executor::PostgresPool(on) => text.execute(on).await.map(drop),
        }
    }
}

/// A query of one column.
pub(in crate::store) struct Scalar<T>(Query, PhantomData<fn() -> T>);

/// A query of which the first column is read.
pub(in crate::store) fn query_scalar<T: FromRow>(text: impl SqlSafeStr) -> Scalar<T> {
    Scalar(query(text), PhantomData)
}

/// A query whose rows are tuples.
pub(in crate::store) fn query_as<T: FromRow>(text: impl SqlSafeStr) -> Scalar<T> {
    query_scalar(text)
}

impl<T: FromRow> Scalar<T> {
    /// The value of the next parameter.
    pub(in crate::store) fn bind(self, value: impl Into<Value>) -> Self {
        Self(self.0.bind(value), PhantomData)
    }

    /// Every row.
    pub(in crate::store) async fn fetch_all(self, on: impl Into<Executor<'_>>) -> Result<Vec<T>, Error> {
        self.0.fetch_all(on).await?.iter().map(T::read).collect()
    }

    /// The first row, if there is one.
    pub(in crate::store) async fn fetch_optional(
        self,
        on: impl Into<Executor<'_>>,
    ) -> Result<Option<T>, Error> {
        self.0.fetch_optional(on).await?.as_ref().map(T::read).transpose()
    }

    /// The first row.
    pub(in crate::store) async fn fetch_one(self, on: impl Into<Executor<'_>>) -> Result<T, Error> {
        T::read(&self.0.fetch_one(on).await?)
    }
}

/// The first columns of a row.
pub(in crate::store) trait FromRow: Sized {
    /// Reads them.
    fn read(row: &Row) -> Result<Self, Error>;
}

impl<T: FromValue> FromRow for T {
    fn read(row: &Row) -> Result<Self, Error> {
        row.at(0)
    }
}

macro_rules! tuples {
    ($($($of:ident $place:literal),+;)*) => {
        $(impl<$($of: FromValue),+> FromRow for ($($of,)+) {
            fn read(row: &Row) -> Result<Self, Error> {
                Ok(($(row.at::<$of>($place)?,)+))
            }
        })*
    };
}

tuples! {
    A 0;
    A 0, B 1;
    A 0, B 1, C 2;
    A 0, B 1, C 2, D 3;
    A 0, B 1, C 2, D 3, E 4;
}
