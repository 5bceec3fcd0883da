//! Tests of the writer: errors, and groups of writes.

use std::pin::pin;
use std::time::Duration;

use futures_util::poll;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, SqliteConnection};

use super::commits::ALONE;
use super::*;
use crate::store::Unavailable;
use crate::store::database::{query, query_scalar, raw_sql};
use crate::store::testing::Place;

/// A writer whose commits are not flushed.
fn unflushed(connection: SqliteConnection) -> Writer {
    Writer::start_with(connection, |_, _| Ok(None)).unwrap()
}

#[tokio::test]
async fn a_busy_database_is_an_error_and_the_writer_continues() {
    let dir = tempfile::tempdir().unwrap();
    let options = SqliteConnectOptions::new().filename(dir.path().join("db")).create_if_missing(true);
    let options = options.busy_timeout(Duration::from_millis(20));
    let mut other = options.connect().await.unwrap();
    let writer = unflushed(options.connect().await.unwrap());
    query("BEGIN IMMEDIATE").execute(&mut other).await.unwrap();
    let error = writer.write(|_| Box::pin(async { Ok(()) })).await.unwrap_err();
    assert_eq!(error.unavailable(), Some(Unavailable::Busy), "{error:?}");
    query("ROLLBACK").execute(&mut other).await.unwrap();
    writer.write(|_| Box::pin(async { Ok(()) })).await.unwrap();
    writer.close().await;
}

#[tokio::test]
async fn a_full_disk_is_an_error_and_the_writer_continues() {
    let dir = tempfile::tempdir().unwrap();
    let options = SqliteConnectOptions::new().filename(dir.path().join("db")).create_if_missing(true);
    let mut connection = options.connect().await.unwrap();
    let small = "CREATE TABLE t (x); PRAGMA max_page_count = 3";
    raw_sql(small).execute(&mut connection).await.unwrap();
    let writer = unflushed(connection);
    let insert = async |bytes: i64| {
        let sql = "INSERT INTO t VALUES (zeroblob(?))";
        writer
            .write(move |tx| Box::pin(async move { Ok(query(sql).bind(bytes).execute(tx).await.map(drop)?) }))
            .await
    };
    let error = insert(1_000_000).await.unwrap_err();
    assert_eq!(error.unavailable(), Some(Unavailable::Full), "{error:?}");
    insert(10).await.unwrap();
    assert!(writer.commits().settled().is_some(), "readers may cache");
    writer.close().await;
}

#[tokio::test]
async fn a_large_write_has_its_own_transaction_and_fails_alone() {
    let mut connection = SqliteConnectOptions::new().in_memory(true).connect().await.unwrap();
    raw_sql("CREATE TABLE t (x)").execute(&mut connection).await.unwrap();
    let writer = unflushed(connection);
    let insert = async |number: i64, is_large: bool, fails: bool| {
        let sql = "INSERT INTO t VALUES (?)";
        writer
            .write_as(is_large, move |tx| {
                Box::pin(async move {
                    query(sql).bind(number).execute(tx).await?;
                    if fails { Err(StoreError::WriterGone) } else { Ok(()) }
                })
            })
            .await
    };
    let (begin, has_begun) = oneshot::channel();
    let (release, is_released) = oneshot::channel::<()>();
    let other = writer.write(move |_| {
        Box::pin(async move {
            begin.send(()).unwrap();
            is_released.await.unwrap();
            Ok(())
        })
    });
    // All are queued before the first of them starts.
    let queued = async {
        has_begun.await.unwrap();
        futures_util::join!(
            insert(1, false, false),
            insert(2, true, false),
            insert(3, false, false),
            insert(4, true, true),
            insert(5, false, false),
            insert(6, false, false),
            async { release.send(()).unwrap() },
        )
    };
    let (other, done) = futures_util::join!(other, queued);
    other.unwrap();
    assert!(done.3.is_err() && done.0.is_ok() && done.1.is_ok() && done.2.is_ok(), "{done:?}");
    assert_eq!(writer.commits().settled(), Some(6), "two writes share a commit");
    let all = "SELECT group_concat(x) FROM t";
    let stored: String = writer
        .write(move |tx| Box::pin(async move { Ok(query_scalar(all).fetch_one(tx).await?) }))
        .await
        .unwrap();
    assert_eq!(stored, "1,2,3,5,6");
    writer.close().await;
}

#[tokio::test]
async fn a_panic_of_the_writer_ends_it() {
    let writer = unflushed(SqliteConnectOptions::new().in_memory(true).connect().await.unwrap());
    let lost = writer.write::<(), _>(|_| Box::pin(async { panic!("on purpose") })).await;
    assert!(matches!(lost, Err(StoreError::WriterGone)), "{lost:?}");
    tokio::time::timeout(Duration::from_secs(20), writer.ended()).await.expect("the writer has ended");
}

#[tokio::test]
async fn a_write_that_comes_during_a_group_is_in_the_next_one() {
    let writer = unflushed(SqliteConnectOptions::new().in_memory(true).connect().await.unwrap());
    let (begin, has_begun) = oneshot::channel();
    let (release, is_released) = oneshot::channel::<()>();
    let first = writer.write(move |_| {
        Box::pin(async move {
            begin.send(()).unwrap();
            is_released.await.unwrap();
            Ok(())
        })
    });
    let later = async {
        has_begun.await.unwrap();
        let mut write = pin!(writer.write(|_| Box::pin(async { Ok(()) })));
        assert!(poll!(&mut write).is_pending(), "queued");
        release.send(()).unwrap();
        write.await
    };
    let (first, later) = futures_util::join!(first, later);
    first.unwrap();
    later.unwrap();
    assert_eq!(writer.commits().settled(), Some(2), "each has its own commit");
    writer.close().await;
}

#[tokio::test]
async fn the_writer_does_not_wait_for_the_threads_of_the_server() {
    for place in [Place::sqlite(), Place::postgres()] {
        let store = place.open().await;
        let (end, ended) = std::sync::mpsc::channel();
        let mut write = pin!(store.writer.write(move |tx| {
            Box::pin(async move {
                for _ in 0..3 {
                    raw_sql("SELECT 1").execute(&mut *tx).await?;
                }
                end.send(()).unwrap();
                Ok(())
            })
        }));
        assert!(poll!(&mut write).is_pending(), "queued");
        // The only thread of this runtime does nothing else meanwhile.
        ended.recv_timeout(Duration::from_secs(20)).expect("the statements were executed");
        write.await.unwrap();
        store.close().await;
    }
}

#[tokio::test]
async fn an_idle_server_whose_threads_stand_still_does_not_show_that_it_lives() {
    let store = Place::postgres().open().await;
    store.ping().await.unwrap();
    let is_alone = || store.writer.commits().settled().is_some();
    assert!(is_alone());
    // The only thread of this runtime.
    std::thread::sleep(ALONE);
    assert!(!is_alone(), "another server may lead");
    tokio::time::sleep(BEAT).await;
    assert!(is_alone(), "it has written again");
    store.close().await;
}
