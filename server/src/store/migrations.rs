//! The migrations of the database, embedded by `build.rs`: forward-only SQL files named `NNNN_description.sql`.

use sqlx::SqlSafeStr;
use sqlx::migrate::{Migration, MigrationType, Migrator};

/// Name and content of every file of `migrations/`; the build script writes the list.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/migrations.rs"));

/// All migrations that this program knows.
pub(super) fn migrator() -> Migrator {
    Migrator::with_migrations(FILES.iter().filter_map(|(name, sql)| migration(name, sql)).collect())
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
