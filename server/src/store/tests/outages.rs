//! Outages of PostgreSQL: crashes, and connections that are not answered.

use std::process::Command;
use std::time::Duration;

use super::super::database::{query, query_scalar};
use super::super::testing::{Cluster, Place};
use super::super::*;
use super::postgres::count;
use crate::config::ServerConfig;
use crate::reaper::{NextLook, tick};
use crate::server::Server;

#[tokio::test]
async fn acknowledged_writes_survive_crashes_of_postgresql() {
    let cluster = Cluster::start(&std::env::temp_dir(), "");
    let location: Location = cluster.create("crashes").parse().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&location, folder.path(), None).await.unwrap();
    let mut acknowledged = count(&store).await.unwrap();
    for crash in 0..3 {
        cluster.kill();
        let mut failures = 0;
        let next = loop {
            match count(&store).await {
                Ok(next) => break next,
                Err(error) => {
                    assert_eq!(error.unavailable(), Some(Unavailable::Away), "{error:?}");
                    failures += 1;
                    assert!(failures < 200, "crash {crash}: {error}");
                    tokio::time::sleep(Duration::from_millis(50)).await;
                }
            }
        };
        assert_eq!(next, acknowledged + 1, "crash {crash}: nothing is lost, and nothing is done twice");
        acknowledged = next;
    }
    store.close().await;
}

#[tokio::test]
async fn no_attempt_is_lost_in_an_outage_longer_than_a_lease() {
    let cluster = Cluster::start(&std::env::temp_dir(), "");
    let database = Some(cluster.create("outage").parse().unwrap());
    let (data, lease) = (tempfile::tempdir().unwrap(), Duration::from_secs(6));
    let (listen, folder) = (([127, 0, 0, 1], 0).into(), data.path().to_owned());
    let config = ServerConfig { listen, data: folder, database, lease, ..ServerConfig::default() };
    let app = Server::bind(config).await.unwrap().app();
    let until = app.clock.lease_now().plus_ms(6000).0;
    let job = "INSERT INTO scenarios (digest, body) VALUES ('d', '{}');
               INSERT INTO jobs (id, scenario_digest, seed, priority, queue_position, labels, cache, submitted_at, state, attempt,
                                 cancelling, lease_expires_at)
               VALUES ('01890000-0000-7000-8000-000000000000', 'd', 1, 0, 0, '{}', 'use', 0, 'running', 1, 0, 0)";
    let set = "UPDATE jobs SET lease_expires_at = ?, deadline = 1";
    let insert = app.store.writer.write(move |tx| {
        Box::pin(async move {
            raw_sql(job).execute(&mut *tx).await?;
            Ok(query(set).bind(until).execute(tx).await?)
        })
    });
    insert.await.unwrap();
    cluster.kill();
    tokio::time::sleep(lease + Duration::from_millis(100)).await;
    let state = async || query_scalar::<String>("SELECT state FROM jobs").fetch_one(&app.store.readers).await;
    let mut failures = 0;
    while let Err(error) = tick(&app, &mut NextLook::default()).await {
        assert_eq!(error.unavailable(), Some(Unavailable::Away), "{error:?}");
        failures += 1;
        assert!(failures < 200, "{error}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!(state().await.unwrap(), "running", "its worker could not send a heartbeat");
    tick(&app, &mut NextLook::default()).await.unwrap();
    assert_eq!(state().await.unwrap(), "running", "its lease and its deadline are new");
    tokio::time::sleep(lease + Duration::from_millis(100)).await;
    tick(&app, &mut NextLook::default()).await.unwrap();
    assert_ne!(state().await.unwrap(), "running", "a worker that stays away loses it");
    app.store.close().await;
}

/// A stopped process, which goes on at the end of a test.
struct Stopped(i32);

impl Stopped {
    fn new(process: i32) -> Self {
        signal("-STOP", process);
        Self(process)
    }
}

impl Drop for Stopped {
    fn drop(&mut self) {
        signal("-CONT", self.0);
    }
}

fn signal(name: &str, process: i32) {
    assert!(Command::new("kill").args([name, &process.to_string()]).status().unwrap().success());
}

/// The process of PostgreSQL that serves the writer.
async fn session(store: &Store) -> i32 {
    let sql = "SELECT CAST(pg_backend_pid() AS BIGINT)";
    let write = store
        .writer
        .write(move |tx| Box::pin(async move { Ok(query_scalar::<i64>(sql).fetch_one(tx).await?) }));
    write.await.unwrap().try_into().unwrap()
}

/// Counts, and stops the session before the commit.
async fn count_and_stop(store: &Store, process: i32) -> (Result<(), StoreError>, Stopped) {
    let (sender, stopped) = std::sync::mpsc::channel();
    let sql = "UPDATE fair_share SET round = round + 1";
    let write = store.writer.write(move |tx| {
        Box::pin(async move {
            raw_sql(sql).execute(tx).await?;
            sender.send(Stopped::new(process)).unwrap();
            Ok(())
        })
    });
    (write.await, stopped.recv().unwrap())
}

#[tokio::test]
async fn a_postgresql_that_stops_answering_is_left_and_its_late_commit_comes_before_the_next_write() {
    for at_commit in [false, true] {
        let place = Place::postgres();
        let store = place.open().await;
        let before = count(&store).await.unwrap();
        let (process, started) = (session(&store).await, std::time::Instant::now());
        let (refused, stopped) = match at_commit {
            true => count_and_stop(&store, process).await,
            false => {
                let stopped = Stopped::new(process);
                (count(&store).await.map(drop), stopped)
            }
        };
        let error = refused.expect_err("nobody answers");
        assert_eq!(error.unavailable(), Some(Unavailable::Away), "{error:?}");
        assert!(started.elapsed() < Duration::from_secs(30), "{:?}", started.elapsed());
        let is_settled = || store.writer.commits().settled().is_some();
        assert!(!is_settled(), "a late commit may come, or another server may write: nothing may be cached");
        // The stopped session may still commit: no other may write before it ends.
        let error = count(&store).await.expect_err("the earlier session holds the lock");
        assert!(error.unavailable().is_some(), "{error:?}");
        drop(stopped);
        let next = loop {
            match count(&store).await {
                Ok(next) => break next,
                Err(error) => assert!(error.unavailable().is_some(), "{error:?}"),
            }
            assert!(started.elapsed() < Duration::from_secs(60), "{:?}", started.elapsed());
            tokio::time::sleep(Duration::from_millis(50)).await;
        };
        assert!(is_settled());
        let late = next - before - 1;
        assert!(late == 0 || at_commit && late == 1, "{late} late commits");
        let lives = "SELECT count(*) FROM pg_stat_activity WHERE pid = ?";
        // A session gives up its lock before it leaves the list.
        while query_scalar::<i64>(lives).bind(i64::from(process)).fetch_one(&store.readers).await.unwrap() > 0
        {
            assert!(started.elapsed() < Duration::from_secs(60), "the earlier session has ended");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        tokio::time::sleep(Duration::from_millis(300)).await;
        assert_eq!(count(&store).await.unwrap(), next + 1, "nothing was committed later");
        store.close().await;
    }
}

#[tokio::test]
async fn a_read_that_postgresql_does_not_answer_ends_and_its_connection_is_left() {
    let place = Place::postgres();
    let store = place.open().await;
    let process = "SELECT CAST(pg_backend_pid() AS BIGINT)";
    let mut reader = store.readers.acquire().await.unwrap();
    let first: i64 = query_scalar(process).fetch_one(&mut reader).await.unwrap();
    let stopped = Stopped::new(first.try_into().unwrap());
    let started = std::time::Instant::now();
    let read = query_scalar::<i64>(process).fetch_all(&mut reader).await;
    let error = StoreError::from(read.expect_err("nobody answers"));
    assert_eq!(error.unavailable(), Some(Unavailable::Away), "{error:?}");
    assert!(started.elapsed() < Duration::from_secs(25), "{:?}", started.elapsed());
    drop(reader);
    let next: i64 = query_scalar(process).fetch_one(&store.readers).await.unwrap();
    assert_ne!(next, first, "the connection is not lent again");

    // A client that goes away leaves more reads behind than there are readers.
    let mut all_stopped = vec![stopped];
    for _ in 0..10 {
        let mut reader = store.readers.acquire().await.unwrap();
        let process: i64 = query_scalar(process).fetch_one(&mut reader).await.unwrap();
        all_stopped.push(Stopped::new(process.try_into().unwrap()));
        let read = query_scalar::<i64>("SELECT CAST(1 AS BIGINT)").fetch_one(&mut reader);
        tokio::time::timeout(Duration::from_millis(20), read).await.expect_err("nobody answers");
    }
    drop(all_stopped);
    store.close().await;
}
