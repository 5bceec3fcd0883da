//! Tests of PostgreSQL: the schema, refusals at the start, and sessions that end.

use std::collections::BTreeSet;

use super::super::database::postgres::Address;
use super::super::database::{AssertSqlSafe, Connection, Row, query, query_scalar};
use super::super::migrations::migrator;
use super::super::testing::Place;
use super::super::*;

/// Tables that only one engine has.
const OWN_TABLES: [&str; 3] = ["_sqlx_migrations", "row_numbers", "sqlite_sequence"];

pub(super) fn address(place: &Place) -> Address {
    match &place.location {
        Location::Postgres(address) => address.clone(),
        Location::File(path) => panic!("{} is a file", path.display()),
    }
}

/// An index that PostgreSQL does not need.
const OWN_INDEX: &str = "jobs_by_deadline";

/// Each column as `table column type null`, in order, and the names of the indexes.
async fn schema(store: &Store) -> (Vec<String>, BTreeSet<String>) {
    let (columns, indexes) = match store.readers.engine() {
        Engine::Sqlite => (
            "SELECT m.name AS relation, c.name, c.type, c.\"notnull\" = 0 AND c.pk = 0 AS nullable
             FROM sqlite_master m JOIN pragma_table_info(m.name) c WHERE m.type = 'table' ORDER BY m.name, c.cid",
            "SELECT name FROM sqlite_master WHERE type = 'index' AND sql IS NOT NULL",
        ),
        Engine::Postgres => (
            "SELECT CAST(table_name AS TEXT) AS relation, CAST(column_name AS TEXT) AS name, CAST(data_type AS TEXT) AS type,
                    is_nullable = 'YES' AS nullable
             FROM information_schema.columns WHERE table_schema = 'public' ORDER BY table_name COLLATE \"C\", ordinal_position",
            "SELECT CAST(i.indexname AS TEXT) FROM pg_indexes i LEFT JOIN pg_constraint c ON c.conname = i.indexname
             WHERE i.schemaname = 'public' AND c.oid IS NULL",
        ),
    };
    let word = |row: &Row| {
        let kind = match row.get::<String>("type").as_str() {
            "INTEGER" | "bigint" => "integer",
            "REAL" | "double precision" => "real",
            "TEXT" | "text" => "text",
            "BLOB" | "bytea" => "blob",
            other => return format!("unknown type {other}"),
        };
        let (table, name) = (row.get::<String>("relation"), row.get::<String>("name"));
        format!("{table} {name} {kind} {}", row.get::<bool>("nullable"))
    };
    let own = |row: &Row| OWN_TABLES.contains(&row.get::<String>("relation").as_str());
    let rows = query(columns).fetch_all(&store.readers).await.unwrap();
    let indexes: Vec<String> = query_scalar(indexes).fetch_all(&store.readers).await.unwrap();
    (rows.iter().filter(|row| !own(row)).map(word).collect(), indexes.into_iter().collect())
}

#[tokio::test]
async fn both_engines_have_the_same_tables_columns_and_indexes() {
    let (sqlite, postgres) = (Place::sqlite(), Place::postgres());
    let (sqlite, postgres) = (sqlite.open().await, postgres.open().await);
    let (mut expected, mut found) = (schema(&sqlite).await, schema(&postgres).await);
    expected.0.sort();
    found.0.sort();
    assert!(expected.0.len() > 100 && expected.1.len() > 30, "{expected:?}");
    assert!(expected.1.remove(OWN_INDEX));
    assert_eq!(found, expected);
    for store in [sqlite, postgres] {
        store.close().await;
    }
}

pub(super) async fn count(store: &Store) -> Result<i64, StoreError> {
    let sql = "INSERT INTO fair_share (priority, owner, queue_position, round) VALUES (1, 0, 1, 0)
               ON CONFLICT (priority, owner) DO UPDATE SET round = fair_share.round + 1 RETURNING round";
    store.writer.write(move |tx| Box::pin(async move { Ok(query_scalar(sql).fetch_one(tx).await?) })).await
}

/// Fails as a write.
async fn fail(store: &Store, sql: &'static str) -> StoreError {
    let write = store.writer.write(move |tx| Box::pin(async move { Ok(raw_sql(sql).execute(tx).await?) }));
    write.await.expect_err("it fails")
}

#[tokio::test]
async fn a_write_that_fails_in_postgresql_says_why_and_the_next_one_succeeds() {
    let place = Place::postgres();
    let store = place.open().await;
    for (sql, reason) in [
        ("SET LOCAL statement_timeout = 10; SELECT pg_sleep(5)", Some(Unavailable::Slow)),
        ("SET LOCAL transaction_read_only = on; DELETE FROM frames", Some(Unavailable::ReadOnly)),
        ("SELECT pg_terminate_backend(pg_backend_pid())", Some(Unavailable::Away)),
        ("DO $$ BEGIN RAISE EXCEPTION USING ERRCODE = 'disk_full'; END $$", Some(Unavailable::FullPostgres)),
        ("SELECT nothing", None),
    ] {
        let before = count(&store).await.unwrap();
        let error = fail(&store, sql).await;
        assert_eq!(error.unavailable(), reason, "{sql}: {error:?}");
        assert_eq!(count(&store).await.unwrap(), before + 1, "{sql}");
        store.ping().await.unwrap();
    }
    store.close().await;
}

/// Ends all sessions of a database.
async fn end_sessions(place: &Place) {
    let mut other = Connection::from(address(place).connect().await.unwrap().0);
    let end = "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity
               WHERE datname = current_database() AND pid <> pg_backend_pid()";
    assert!(query_scalar::<i64>(end).fetch_one(&mut other).await.unwrap() >= 1);
    other.close().await.unwrap();
}

#[tokio::test]
async fn a_session_that_ends_between_writes_is_replaced() {
    let place = Place::postgres();
    let store = place.open().await;
    let before = count(&store).await.unwrap();
    end_sessions(&place).await;
    assert_eq!(count(&store).await.unwrap(), before + 1);
    store.tokens().await.expect("readers connect again too");
    store.close().await;
}

#[tokio::test]
async fn every_session_of_the_writer_has_its_settings_and_tables() {
    let place = Place::postgres();
    let store = place.open().await;
    let jobs = "INSERT INTO scenarios (digest, body) VALUES ('d', '{}');
                INSERT INTO jobs (id, scenario_digest, seed, priority, queue_position, labels, cache, submitted_at, state, lease_expires_at)
                VALUES ('a', 'd', 1, 0, 0, '{}', 'use', 0, 'running', 1), ('b', 'd', 1, 0, 0, '{}', 'use', 0, 'queued', NULL)";
    let write = store.writer.write(move |tx| Box::pin(async move { Ok(raw_sql(jobs).execute(tx).await?) }));
    write.await.unwrap();
    for connection in ["the first", "another"] {
        let setting = store.writer.write(|tx| {
            Box::pin(async move {
                let sql = "SELECT string_agg(name || ' ' || setting, ', ' ORDER BY name) FROM pg_settings WHERE name LIKE 'enable_%scan'
                               AND setting = 'off' OR name = 'plan_cache_mode'";
                let settings = query_scalar::<String>(sql).fetch_one(&mut *tx).await?;
                Ok((settings, query_scalar::<i64>(leader_tables::WRONG).fetch_one(tx).await?))
            })
        });
        let expected = "enable_bitmapscan off, enable_seqscan off, plan_cache_mode force_generic_plan";
        assert_eq!(setting.await.unwrap(), (expected.to_owned(), 0), "{connection}");
        end_sessions(&place).await;
        count(&store).await.unwrap();
    }
    store.close().await;
}

#[tokio::test]
async fn a_transaction_reads_what_was_committed_before_whatever_the_default_of_the_database() {
    let place = Place::postgres();
    let mut owner = Connection::from(address(&place).connect().await.unwrap().0);
    let name: String = query_scalar("SELECT current_database()::text").fetch_one(&mut owner).await.unwrap();
    let sql =
        AssertSqlSafe(format!("ALTER DATABASE {name} SET default_transaction_isolation = serializable"));
    raw_sql(sql).execute(&mut owner).await.unwrap();
    let store = place.open().await;
    for is_large in [false, true] {
        let sql = "SELECT current_setting('transaction_isolation')";
        let write = store.writer.write_as(is_large, move |tx| {
            Box::pin(async move { Ok(query_scalar::<String>(sql).fetch_one(tx).await?) })
        });
        assert_eq!(write.await.unwrap(), "read committed");
    }
    store.close().await;
}

#[tokio::test]
async fn a_session_whose_lock_nobody_was_told_of_is_ended() {
    let place = Place::postgres();
    let first = address(&place);
    let (mut sessions, lost) = (Vec::new(), &mut Vec::new());
    let (_writer, _) = first.connect_writer(&mut sessions).await.unwrap();
    lost.append(&mut sessions);
    // Its lock is that of an attempt without an answer, beside the session of an older connection.
    lost.insert(0, i32::MAX);
    let (_next, _) = first.connect_writer(lost).await.unwrap();
    assert_eq!(lost.len(), 1);
    let error = first.connect_writer(&mut vec![i32::MAX]).await.expect_err("refused");
    assert!(matches!(error, StoreError::OtherServer(_)), "{error:?}");
}

#[tokio::test]
async fn an_unusable_postgresql_is_refused_at_the_start() {
    let open = async |location: &Location| {
        let folder = tempfile::tempdir().unwrap();
        Store::open(location, folder.path(), None).await.err().expect("refused")
    };
    let nowhere: Location = "postgres://me:secret@localhost/roost?host=/nowhere".parse().unwrap();
    let error = open(&nowhere).await;
    assert_eq!(error.unavailable(), Some(Unavailable::Away));
    assert!(!format!("{error} {error:?} {nowhere} {nowhere:?}").contains("secret"), "{error:?}");

    let place = Place::postgres();
    let store = place.open().await;
    let second = open(&place.location).await;
    assert!(matches!(second, StoreError::OtherServer(_)), "{second:?}");
    let newer = "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
                 VALUES (9999, 'from the future', true, '', 0)";
    let write = store.writer.write(move |tx| Box::pin(async move { Ok(raw_sql(newer).execute(tx).await?) }));
    write.await.unwrap();
    store.close().await;
    let error = open(&place.location).await;
    assert!(matches!(error, StoreError::Newer { found: 9999, .. }), "{error:?}");
    let error = TokenFile::open(&place.location, true).await.err().expect("refused");
    assert!(matches!(error, StoreError::Newer { found: 9999, .. }), "{error:?}");

    let place = Place::postgres();
    let mut owner = Connection::from(address(&place).connect().await.unwrap().0);
    let name: String = query_scalar("SELECT current_database()::text").fetch_one(&mut owner).await.unwrap();
    let plain = format!(
        "CREATE ROLE plain LOGIN; GRANT ALL ON SCHEMA public TO plain; REVOKE TEMPORARY ON DATABASE {name} FROM PUBLIC"
    );
    raw_sql(AssertSqlSafe(plain)).execute(&mut owner).await.unwrap();
    let error = open(&place.address().replace("roost@", "plain@").parse().unwrap()).await;
    assert!(error.to_string().contains("may not make temporary tables"), "{error}");

    let place = Place::postgres();
    let mut owner = Connection::from(address(&place).connect().await.unwrap().0);
    for (change, reason) in [
        ("ALTER DATABASE test SET default_transaction_read_only = on", "accepts no writes"),
        ("CREATE DATABASE test_latin ENCODING 'SQL_ASCII' TEMPLATE template0", "its encoding is SQL_ASCII"),
    ] {
        let name: String =
            query_scalar("SELECT current_database()::text").fetch_one(&mut owner).await.unwrap();
        let sql = AssertSqlSafe(change.replace("DATABASE test ", &format!("DATABASE {name} ")));
        raw_sql(sql).execute(&mut owner).await.unwrap();
        let location = match change.contains("test_latin") {
            true => place.address().replace(&name, "test_latin").parse().unwrap(),
            false => place.location.clone(),
        };
        let error = open(&location).await;
        assert!(error.to_string().contains(reason), "{error}");
    }
}

#[test]
fn migrations_of_postgresql_have_numbers_without_gaps() {
    let numbers: Vec<i64> = migrator(Engine::Postgres).iter().map(|migration| migration.version).collect();
    assert_eq!(numbers, (1..=numbers.len() as i64).collect::<Vec<_>>());
}
