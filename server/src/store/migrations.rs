//! The migrations of the database, embedded by `build.rs`: forward-only SQL files named `NNNN_description.sql`.
//!
//! Those of PostgreSQL are in a folder of their own, and have their own numbers.

use sqlx::SqlSafeStr;
use sqlx::migrate::{Migration, MigrationType, Migrator};

use super::StoreError;
use super::database::{Connection, Engine, query_scalar, raw_sql};

/// Name and content of every file of `migrations/`; the build script writes the list.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/migrations.rs"));

/// The folder with the migrations of PostgreSQL.
const POSTGRES: &str = "postgres/";

/// All migrations that this program knows.
pub(super) fn migrator(engine: Engine) -> Migrator {
    let files = FILES.iter().filter_map(|(name, sql)| match (engine, name.strip_prefix(POSTGRES)) {
        (Engine::Sqlite, None) => migration(name, sql),
        (Engine::Postgres, Some(name)) => migration(name, sql),
        _ => None,
    });
    Migrator::with_migrations(files.collect())
}

/// The migration in a file; `None` for files that are not SQL.
fn migration(name: &str, sql: &'static [u8]) -> Option<Migration> {
    let (version, description) =
        name.strip_suffix(".sql")?.split_once('_').expect("a migration is named NNNN_description");
    let version = version.parse().expect("the name of a migration begins with its number");
    let sql = str::from_utf8(sql).expect("a migration is UTF-8").into_sql_str();
    let no_transaction = false;
    Some(Migration::new(
        version,
        description.replace('_', " ").into(),
        MigrationType::Simple,
        sql,
        no_transaction,
    ))
}

/// All migrations that this program knows, and one more, like those of the next version.
#[cfg(test)]
pub(super) fn migrator_with(engine: Engine, sql: &'static str) -> Migrator {
    let mut migrations = migrator(engine);
    let next = format!("{:04}_next.sql", newest_known(&migrations) + 1);
    migrations.migrations.to_mut().extend(migration(&next, sql.as_bytes()));
    migrations
}

/// Runs the migrations that a database lacks.
pub(super) async fn migrate(connection: &mut Connection) -> Result<(), StoreError> {
    migrate_to(connection, &migrator(connection.engine())).await
}

/// Runs those of other migrations that a database lacks. Not by `Migrator::run`: its future cannot move between threads
/// (<https://github.com/rust-lang/rust/issues/100013>).
pub(super) async fn migrate_to(connection: &mut Connection, migrator: &Migrator) -> Result<(), StoreError> {
    refuse_above(connection, newest_known(migrator)).await?;
    match connection {
        Connection::Sqlite(connection) => migrator.run_direct(None, &mut **connection, false).await?,
        Connection::LentSqlite(connection) => migrator.run_direct(None, &mut **connection, false).await?,
        Connection::Postgres(connection) => {
            // A migration of a large table takes its time.
            raw_sql("SET statement_timeout = 0").execute(&mut **connection).await?;
            migrator.run_direct(None, &mut **connection, false).await?;
            raw_sql("RESET statement_timeout").execute(&mut **connection).await?;
        }
        Connection::LentPostgres(connection) => migrator.run_direct(None, &mut **connection, false).await?,
    }
    Ok(())
}

/// Refuses a database of a newer version, which this program would misread.
pub(super) async fn refuse_newer(connection: &mut Connection) -> Result<(), StoreError> {
    refuse_above(connection, newest_of_program(connection)).await
}

/// Refuses a database whose schema is newer than a migration.
pub(super) async fn refuse_above(connection: &mut Connection, known: i64) -> Result<(), StoreError> {
    match newest_run(connection).await? {
        Some(found) if found > known => Err(StoreError::Newer { found, known }),
        _ => Ok(()),
    }
}

/// Refuses a database of another version, for a program that may not migrate it.
pub(super) async fn refuse_other(connection: &mut Connection) -> Result<(), StoreError> {
    refuse_newer(connection).await?;
    let known = newest_of_program(connection);
    match newest_run(connection).await? {
        Some(found) if found < known => Err(StoreError::Older { found, known }),
        _ => Ok(()),
    }
}

/// The newest migration that this program knows.
fn newest_of_program(connection: &Connection) -> i64 {
    newest_known(&migrator(connection.engine()))
}

/// The newest of some migrations.
pub(super) fn newest_known(migrator: &Migrator) -> i64 {
    migrator.iter().map(|migration| migration.version).max().unwrap_or(0)
}

/// The newest migration that has run on a database; none on a new one.
pub(super) async fn newest_run(connection: &mut Connection) -> Result<Option<i64>, StoreError> {
    if !table_exists(connection, "_sqlx_migrations").await? {
        return Ok(None);
    }
    Ok(query_scalar("SELECT max(version) FROM _sqlx_migrations").fetch_one(connection).await?)
}

/// Whether a database has a table.
pub(super) async fn table_exists(connection: &mut Connection, table: &str) -> Result<bool, StoreError> {
    let exists = match connection.engine() {
        Engine::Sqlite => "SELECT EXISTS (SELECT 1 FROM sqlite_master WHERE name = ?)",
        Engine::Postgres => "SELECT to_regclass(?) IS NOT NULL",
    };
    Ok(query_scalar::<bool>(exists).bind(table).fetch_one(connection).await?)
}
