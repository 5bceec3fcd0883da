//! Databases of other versions: those of earlier versions are upgraded, those of later ones refused.

use std::path::Path;
use std::time::Duration;

use roost_api::ids::{JobId, WorkerId};
use roost_api::job::Cache;
use roost_api::time::Timestamp;
use roost_api::worker::WorkerRegistration;
use sqlx::{Connection, SqliteConnection};

use super::database::{AssertSqlSafe, Engine, query, query_scalar, raw_sql, sqlite};
use super::migrations::migrator;
use super::{Claim, JobFilter, Location, NewJob, Store, StoreError, TokenFile, copy};
use crate::clock::Now;

/// A new database with the migrations up to one.
async fn open_at(path: &Path, version: i64) -> SqliteConnection {
    let mut migrations = migrator(Engine::Sqlite);
    migrations.migrations.to_mut().retain(|migration| migration.version <= version);
    let (mut database, _) = sqlite::connect(sqlite::options(path)).await.unwrap();
    migrations.run(&mut database).await.unwrap();
    database
}

/// A backup may be made by a newer program than the server.
#[tokio::test]
async fn a_backup_of_an_earlier_version_counts_its_objects() {
    let dir = tempfile::tempdir().unwrap();
    for (version, absent) in [(7, 0), (12, 1), (13, 1), (15, 2), (17, 2)] {
        let (path, to) =
            (dir.path().join(format!("{version}.db")), dir.path().join(format!("{version}.copy")));
        let mut database = open_at(&path, version).await;
        if version > 7 {
            let frames = "PRAGMA foreign_keys = OFF; INSERT INTO frames VALUES ('j', 1, 'o', 1, 1, NULL, 0)";
            raw_sql(frames).execute(&mut database).await.unwrap();
        }
        if version >= 15 {
            let checkpoint = "INSERT INTO checkpoints VALUES ('j', 1, 'c', 1, 1, 1, 'cpu', 'd')";
            raw_sql(checkpoint).execute(&mut database).await.unwrap();
        }
        if version >= 17 {
            // Jobs compute fills again: a backup has none.
            let fill = "INSERT INTO fills VALUES ('f', 1, 'cpu', 'd', NULL, NULL, 'f', 1, 0)";
            raw_sql(fill).execute(&mut database).await.unwrap();
        }
        database.close().await.unwrap();
        assert_eq!(copy(&path, &to).await.unwrap().absent_objects, absent, "version {version}");
    }
}

/// Jobs of a database from before owners belong to one owner, and the labels of a sweep are stored once.
#[tokio::test]
async fn an_upgrade_to_owners_keeps_the_order_of_jobs_and_the_labels() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("roost.db");
    let mut database = open_at(&path, 10).await;
    let [swept, later, single, sweep] = [(); 4].map(|()| JobId::new());
    let long = "x".repeat(100_000);
    let sql = format!(
        r#"INSERT INTO sweeps (id, name, spec, factors, labels, points, replicates, submitted_at)
         VALUES ('{sweep}', 'n', '{{}}', '[]', '{{"line": "{long}"}}', 2, 1, 0);
         INSERT INTO points VALUES ('{sweep}', 0, '{{}}'), ('{sweep}', 1, '{{}}');
         INSERT INTO scenarios VALUES ('d', '{{}}');
         INSERT INTO jobs (id, sweep_id, point, replicate, digest, seed, priority, turn, labels, cache, submitted_at)
         VALUES ('{later}', '{sweep}', 1, 0, 'd', 1, 7, 41, '{{"line": "{long}"}}', 'use', 0),
                ('{swept}', '{sweep}', 0, 0, 'd', 1, 7, 40, '{{"line": "{long}"}}', 'use', 0),
                ('{single}', NULL, NULL, NULL, 'd', 1, 7, 42, '{{"line": "south"}}', 'use', 0);
         INSERT INTO turns VALUES (7, 42);"#
    );
    raw_sql(AssertSqlSafe(sql)).execute(&mut database).await.unwrap();
    database.close().await.unwrap();

    let store = Store::open(&Location::File(path.clone()), &dir.path().join("objects"), None).await.unwrap();
    let found = async |value: &str| {
        let label = Some(("line".to_owned(), Some(value.to_owned())));
        let (jobs, _) = store.jobs(JobFilter { label, limit: 9, ..JobFilter::default() }).await.unwrap();
        jobs.into_iter().map(|job| (job.id, job.labels["line"].clone())).collect::<Vec<_>>()
    };
    assert_eq!(found("south").await, [(single, "south".to_owned())]);
    assert_eq!(found(&long).await, [(swept, long.clone()), (later, long.clone())]);
    let stored: i64 = query_scalar("SELECT sum(length(labels)) FROM jobs WHERE sweep_id IS NOT NULL")
        .fetch_one(&store.readers)
        .await
        .unwrap();
    assert_eq!(stored, 2 * 2, "jobs of sweeps have no labels of their own");

    // A server without tokens has the same owner: its new jobs come after the old ones.
    let scenario = roost_solver::scenario::parse(r#"{"experiment": "hopper"}"#).unwrap();
    let new = |token: &str| NewJob {
        id: JobId::new(),
        token: token.to_owned(),
        scenario: scenario.clone(),
        priority: 7,
        labels: Default::default(),
        needs: Default::default(),
        max_wall_s: None,
        frame_interval_s: None,
        cache: Cache::Bypass,
        shared_fill: true,
    };
    let (same, other) = (new(""), new("another"));
    let expected = [other.id, swept, later, single, same.id];
    store.insert_job(same, Timestamp(0)).await.unwrap();
    store.insert_job(other, Timestamp(0)).await.unwrap();
    let worker = WorkerRegistration {
        worker_id: WorkerId::new(),
        name: "a".to_owned(),
        api_version: "v1".to_owned(),
        solver_revision: 1,
        backend: "cpu".to_owned(),
        device: "a".to_owned(),
        threads: 1,
        memory_mib: None,
    };
    let (request_id, worker_id) = (uuid::Uuid::now_v7(), worker.worker_id);
    store.register_worker(worker, Timestamp(0)).await.unwrap().unwrap();
    let lease = Duration::from_secs(9);
    let claim = Claim {
        request_id,
        worker: worker_id,
        max_jobs: 9,
        lease,
        max_frames_bytes: 0,
        checkpoints: None,
        shares_fills: false,
        max_fill_bytes: 0,
    };
    let now = Now { wall: Timestamp(0), lease: Timestamp(0) };
    let claimed = store.claim(claim, now).await.unwrap().unwrap().attempts;
    assert_eq!(claimed.iter().map(|attempt| attempt.job_id).collect::<Vec<_>>(), expected);
    store.close().await;
}

#[tokio::test]
async fn a_database_of_a_newer_version_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("roost.db");
    let store = Store::open(&Location::File(path.clone()), &dir.path().join("objects"), None).await.unwrap();
    let newer = "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
                 VALUES (9999, 'from the future', 1, x'00', 0)";
    let write =
        store.writer.write(move |tx| Box::pin(async move { Ok(query(newer).execute(tx).await.map(drop)?) }));
    write.await.unwrap();
    store.close().await;
    let refused = [
        Store::open(&Location::File(path.clone()), &dir.path().join("objects"), None).await.err(),
        TokenFile::open(&Location::File(path.clone()), true).await.err(),
        TokenFile::open(&Location::File(path.clone()), false).await.err(),
        copy(&path, &dir.path().join("copy.db")).await.err(),
    ];
    for error in refused {
        let error = error.expect("refused");
        assert!(matches!(error, StoreError::Newer { found: 9999, .. }), "{error:?}");
        assert!(error.to_string().contains("made by a newer roost (schema 9999"), "{error}");
    }
}
