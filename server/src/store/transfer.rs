//! Copying a whole database to another one, of either engine. No server uses one of the two meanwhile.

use std::collections::HashMap;

use futures_util::TryStreamExt;

use super::database::{AssertSqlSafe, Builder, Connection, Engine, Row, Value, query, query_scalar, raw_sql};
use super::location::open_alone;
use super::{Location, StoreError};

/// Every table, after those that it refers to.
pub(super) const TABLES: [&str; 30] = [
    "workers",
    "sweeps",
    "design_points",
    "scenarios",
    "jobs",
    "projects",
    "owners",
    "fair_share",
    "project_rounds",
    "documents",
    "attempts",
    "results",
    "meshes",
    "mesh_parts",
    "extensions",
    "deletions",
    "events",
    "submissions",
    "tokens",
    "sessions",
    "sign_in_keys",
    "newest_solver",
    "frames",
    "checkpoints",
    "fills",
    "unnamed_objects",
    "studies",
    "observations",
    "observation_counts",
    "asks",
];

/// Tables in which a migration has made the row 0. Their further rows are numbered.
const SEEDED: [&str; 2] = ["projects", "owners"];

/// Tables whose rows have numbers that never return.
const NUMBERED: [&str; 5] = ["sweeps", "jobs", "meshes", "deletions", "events"];

/// Parameters of one statement: SQLite takes 32,766.
const MAX_PARAMETERS: usize = 20_000;

/// Bytes of the texts and blobs of one statement.
const MAX_BYTES: usize = 4 << 20;

/// A copied table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CopiedTable {
    /// Its name.
    pub table: &'static str,
    /// Number of its rows.
    pub rows: u64,
    /// Checksum of its rows, whatever their order.
    pub checksum: String,
}

/// Copies every table to an empty database, and compares both.
pub(crate) async fn transfer(from: &Location, to: &Location) -> Result<Vec<CopiedTable>, StoreError> {
    let mut source = open_alone(from, false).await?;
    let mut target = open_alone(to, true).await?;
    // A server that has led the empty database has noted its solver.
    for table in TABLES.into_iter().filter(|table| *table != "newest_solver") {
        let is_seed = if SEEDED.contains(&table) { "WHERE id <> 0" } else { "" };
        let sql = AssertSqlSafe(format!("SELECT EXISTS (SELECT 1 FROM {table} {is_seed})"));
        if query_scalar::<bool>(sql).fetch_one(&mut target).await? {
            return Err(StoreError::NotEmpty(to.to_string()));
        }
    }
    raw_sql("BEGIN").execute(&mut target).await?;
    for table in TABLES {
        // Triggers have counted, and migrations have made an owner and a project.
        raw_sql(AssertSqlSafe(format!("DELETE FROM {table}"))).execute(&mut target).await?;
        copy_rows(&mut source, &mut target, table).await?;
    }
    copy_numbers(&mut source, &mut target).await?;
    raw_sql("COMMIT").execute(&mut target).await?;
    let mut copied = Vec::new();
    for table in TABLES {
        let (found, expected) = (sum(&mut target, table).await?, sum(&mut source, table).await?);
        if found != expected {
            return Err(StoreError::Differs(table));
        }
        copied.push(found);
    }
    source.close().await?;
    target.close().await?;
    Ok(copied)
}

async fn copy_rows(
    source: &mut Connection,
    target: &mut Connection,
    table: &'static str,
) -> Result<(), StoreError> {
    let nulls = nulls(target, table).await?;
    let mut rows = query(AssertSqlSafe(format!("SELECT * FROM {table}"))).fetch(&mut *source);
    let (mut batch, mut bytes, mut names) = (Vec::<Vec<Value>>::new(), 0, Vec::new());
    while let Some(row) = rows.try_next().await? {
        if names.is_empty() {
            names = row.names();
        }
        let null = |place: usize| nulls.get(&names[place]).cloned().unwrap_or(Value::Integer(None));
        let mut values = Vec::with_capacity(names.len());
        for place in 0..names.len() {
            let value = row.value(place)?;
            bytes += length(value.as_ref());
            values.push(value.unwrap_or_else(|| null(place)));
        }
        batch.push(values);
        if (batch.len() + 1) * names.len() > MAX_PARAMETERS || bytes > MAX_BYTES {
            insert(target, table, &names, std::mem::take(&mut batch)).await?;
            bytes = 0;
        }
    }
    insert(target, table, &names, batch).await
}

fn length(value: Option<&Value>) -> usize {
    match value {
        Some(Value::Text(Some(text))) => text.len(),
        Some(Value::Blob(Some(bytes))) => bytes.len(),
        _ => 8,
    }
}

async fn insert(
    target: &mut Connection,
    table: &str,
    names: &[String],
    rows: Vec<Vec<Value>>,
) -> Result<(), StoreError> {
    if rows.is_empty() {
        return Ok(());
    }
    let mut query = Builder::new(&format!("INSERT INTO {table} ({}) ", names.join(", ")));
    query.push_values(rows, |mut row, values| {
        for value in values {
            row.push_bind(value);
        }
    });
    query.build().execute(&mut *target).await?;
    Ok(())
}

/// The null of each column: PostgreSQL wants its type.
async fn nulls(target: &mut Connection, table: &'static str) -> Result<HashMap<String, Value>, StoreError> {
    if target.engine() == Engine::Sqlite {
        return Ok(HashMap::new());
    }
    let sql = "SELECT CAST(column_name AS TEXT) AS name, CAST(data_type AS TEXT) AS type
               FROM information_schema.columns WHERE table_schema = current_schema() AND table_name = ?";
    let rows = query(sql).bind(table).fetch_all(&mut *target).await?;
    let null = |row: &Row| {
        let null = match row.named::<String>("type")?.as_str() {
            "bigint" => Value::Integer(None),
            "double precision" => Value::Real(None),
            "bytea" => Value::Blob(None),
            _ => Value::Text(None),
        };
        Ok((row.named("name")?, null))
    };
    rows.iter().map(null).collect()
}

/// The highest numbers of rows: none returns, and versions of listings go on.
async fn copy_numbers(source: &mut Connection, target: &mut Connection) -> Result<(), StoreError> {
    raw_sql(match target.engine() {
        Engine::Sqlite => "DELETE FROM sqlite_sequence",
        Engine::Postgres => "DELETE FROM row_numbers",
    })
    .execute(&mut *target)
    .await?;
    for table in NUMBERED {
        let sql = format!(
            "SELECT max(seq) FROM (SELECT seq FROM sqlite_sequence WHERE name = ? UNION ALL SELECT max(seq) FROM {table}) AS numbers"
        );
        let number =
            query_scalar::<Option<i64>>(AssertSqlSafe(sql)).bind(table).fetch_one(&mut *source).await?;
        let Some(number) = number else { continue };
        let sql = "INSERT INTO sqlite_sequence (name, seq) VALUES (?, ?)";
        query(sql).bind(table).bind(number).execute(&mut *target).await?;
        if target.engine() == Engine::Postgres {
            let sql = "SELECT setval(pg_get_serial_sequence(?, 'seq'), ?)";
            query(sql).bind(table).bind(number.max(1)).execute(&mut *target).await?;
        }
    }
    if target.engine() == Engine::Postgres {
        for table in SEEDED {
            let sql =
                format!("SELECT setval(pg_get_serial_sequence('{table}', 'id'), max(id) + 1) FROM {table}");
            query(AssertSqlSafe(sql)).execute(&mut *target).await?;
        }
    }
    Ok(())
}

/// Number and checksum of the rows of a table: the sum of their hashes, since the order of texts depends on the database.
async fn sum(connection: &mut Connection, table: &'static str) -> Result<CopiedTable, StoreError> {
    let mut rows = query(AssertSqlSafe(format!("SELECT * FROM {table}"))).fetch(&mut *connection);
    let (mut number, mut sum) = (0, 0_u128);
    while let Some(row) = rows.try_next().await? {
        let mut hash = blake3::Hasher::new();
        for place in 0..row.names().len() {
            let value = row.value(place)?;
            let (kind, bytes) = match &value {
                None => (0, Vec::new()),
                Some(Value::Integer(number)) => (1, number.unwrap_or_default().to_le_bytes().to_vec()),
                Some(Value::Real(number)) => (2, number.unwrap_or_default().to_le_bytes().to_vec()),
                Some(Value::Text(text)) => (3, text.clone().unwrap_or_default().into_bytes()),
                Some(Value::Blob(bytes)) => (4, bytes.clone().unwrap_or_default()),
            };
            hash.update(&[kind]).update(&(bytes.len() as u64).to_le_bytes()).update(&bytes);
        }
        let mut half = [0; 16];
        hash.finalize_xof().fill(&mut half);
        (number, sum) = (number + 1, sum.wrapping_add(u128::from_le_bytes(half)));
    }
    Ok(CopiedTable { table, rows: number, checksum: format!("{sum:032x}") })
}

#[cfg(test)]
mod tests;
