//! Tests of the flusher: what is answered is on disk, and a failed flush ends the writer.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use futures_util::future::join_all;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use sqlx::{ConnectOptions, Connection, SqliteConnection};

use super::super::database::query;
use super::super::writer::{Line, Thread, Writer};
use super::*;

/// A connection with the settings of the writer, and no copies of the log into the database.
async fn connect(path: &Path) -> SqliteConnection {
    let options = SqliteConnectOptions::new().filename(path).create_if_missing(true);
    let options = options.journal_mode(SqliteJournalMode::Wal).synchronous(SqliteSynchronous::Normal);
    options.pragma("wal_autocheckpoint", "0").connect().await.unwrap()
}

async fn insert(writer: &Writer, number: i64) -> Result<(), super::super::StoreError> {
    let sql = "INSERT INTO t VALUES (?)";
    let work = writer
        .write(move |tx| Box::pin(async move { Ok(query(sql).bind(number).execute(tx).await.map(drop)?) }));
    work.await
}

/// The files of the database at the end of a flush, and the writes that were answered until then.
struct Flush {
    database: Vec<u8>,
    log: Vec<u8>,
    answered: BTreeSet<i64>,
}

#[tokio::test]
async fn a_write_is_answered_only_when_a_flush_has_written_it() {
    let dir = tempfile::tempdir().unwrap();
    let (path, log) = (dir.path().join("db"), dir.path().join("db-wal"));
    let mut connection = connect(&path).await;
    sqlx::raw_sql("CREATE TABLE t (x)").execute(&mut connection).await.unwrap();
    let (answered, flushes) = (Arc::new(Mutex::new(BTreeSet::new())), Arc::new(Mutex::new(Vec::new())));
    let flush = {
        let (answered, flushes, path) = (answered.clone(), flushes.clone(), path.clone());
        move || {
            // A power failure now would leave these files, or a later state of them.
            let (database, log) = (std::fs::read(&path)?, std::fs::read(&log)?);
            // Time for a wrong answer.
            std::thread::sleep(Duration::from_millis(5));
            let answered = answered.lock().unwrap().clone();
            flushes.lock().unwrap().push(Flush { database, log, answered });
            Ok(())
        }
    };
    let writer =
        Writer::start_with(connection, |seconds, ended| Ok(Some(Flusher::spawn(flush, seconds, ended))));
    let writer = Arc::new(writer.unwrap());
    let client = async |first: i64| {
        for number in first..first + 25 {
            insert(&writer, number).await.unwrap();
            answered.lock().unwrap().insert(number);
        }
    };
    join_all([0, 100, 200, 300].map(client)).await;
    writer.close().await;

    let flushes = std::mem::take(&mut *flushes.lock().unwrap());
    assert!(flushes.len() >= 25, "{}", flushes.len());
    let mut on_disk = BTreeSet::new();
    for (number, flush) in flushes.iter().enumerate() {
        assert!(
            flush.answered.is_subset(&on_disk),
            "flush {number}: {:?}",
            flush.answered.difference(&on_disk)
        );
        let copy = dir.path().join(format!("{number}"));
        std::fs::write(&copy, &flush.database).unwrap();
        std::fs::write(dir.path().join(format!("{number}-wal")), &flush.log).unwrap();
        let mut copy = connect(&copy).await;
        let found: Vec<i64> = sqlx::query_scalar("SELECT x FROM t").fetch_all(&mut copy).await.unwrap();
        on_disk = found.into_iter().collect();
        copy.close().await.unwrap();
    }
    assert_eq!(on_disk.len(), 100);
}

#[cfg(unix)]
#[tokio::test]
async fn a_failed_flush_is_an_error_and_ends_the_writer() {
    let dir = tempfile::tempdir().unwrap();
    let mut connection = connect(&dir.path().join("db")).await;
    sqlx::raw_sql("CREATE TABLE t (x)").execute(&mut connection).await.unwrap();
    // This device refuses a flush.
    let writer = Writer::open(
        &Thread::start().unwrap(),
        connection.into(),
        Line::file(),
        Some(Path::new("/dev/null")),
    )
    .unwrap();
    let error = insert(&writer, 1).await.unwrap_err();
    assert!(matches!(error, super::super::StoreError::Commit(_)), "{error:?}");
    tokio::time::timeout(Duration::from_secs(20), writer.ended()).await.expect("the writer has ended");
    insert(&writer, 2).await.unwrap_err();
    writer.close().await;
}

#[cfg(unix)]
#[tokio::test]
async fn the_log_of_a_linked_database_is_flushed() {
    let dir = tempfile::tempdir().unwrap();
    let (real, link) = (dir.path().join("disk.db"), dir.path().join("roost.db"));
    std::os::unix::fs::symlink(&real, &link).unwrap();
    let mut connection = connect(&link).await;
    let log = super::super::database::sqlite::settle_log(&mut connection).await.unwrap();
    assert_eq!(log.file_name().unwrap(), "disk.db-wal");
    sqlx::raw_sql("CREATE TABLE t (x)").execute(&mut connection).await.unwrap();
    assert!(std::fs::metadata(&log).unwrap().len() > 0);
}
