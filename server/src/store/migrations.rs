//! The migrations of the database, embedded by `build.rs`: forward-only SQL files named `NNNN_description.sql`.

use sqlx::SqlSafeStr;
use sqlx::migrate::{Migration, MigrationType, Migrator};

/// File name without extension and SQL text of each migration, in order.
const FILES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/migrations.rs"));

/// All migrations that this program knows.
pub(super) fn migrator() -> Migrator {
    Migrator::with_migrations(FILES.iter().map(|&(name, sql)| migration(name, sql)).collect())
}

fn migration(name: &str, sql: &'static str) -> Migration {
    let (version, description) = name.split_once('_').expect("a migration is named NNNN_description");
    let version = version.parse().expect("a migration's name begins with its number");
    // In one transaction: none of ours asks for less.
    let no_transaction = false;
    Migration::new(
        version,
        description.replace('_', " ").into(),
        MigrationType::Simple,
        sql.into_sql_str(),
        no_transaction,
    )
}
