//! Tests of the store: constraints, group commit, versions.

use roost_api::design::DesignKind;
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{AttemptOutcome, Cache, FailureClass, FilledBy, JobState};
use roost_api::mesh::{MeshFormat, MeshView};
use roost_api::time::Timestamp;
use tokio_util::sync::CancellationToken;

use super::database::{AssertSqlSafe, query, query_scalar, raw_sql};
use super::migrations::migrator;
use super::testing::{Place, on_both_engines};
use super::*;
use crate::clock::Now;

mod bases;
mod editions;
mod leader_tables;
mod observations;
mod outages;
mod postgres;
mod projects;
mod query_plans;
mod references;
mod sessions;
mod studies;
mod waits;

async fn store() -> (Store, tempfile::TempDir) {
    let dir = tempfile::tempdir().unwrap();
    let file = Location::File(dir.path().join("roost.db"));
    (Store::open(&file, &dir.path().join(OBJECTS), None).await.unwrap(), dir)
}

on_both_engines!(
    checks_of_the_schema_list_every_enum,
    writes_of_a_group_fail_alone,
    design_points_and_results_never_change,
    a_lease_expires_by_the_lease_clock_and_its_end_has_wall_time,
    versions_never_repeat_after_deletions,
    versions_are_no_older_than_an_event_that_was_read,
    parts_of_an_interrupted_upload_are_removed_at_the_next_start,
);

async fn checks_of_the_schema_list_every_enum(place: Place) {
    let store = place.open().await;
    let schema: Vec<String> = match store.readers.engine() {
        Engine::Sqlite => {
            let sql = "SELECT sql FROM sqlite_master WHERE type = 'table'";
            query_scalar(sql).fetch_all(&store.readers).await.unwrap()
        }
        engine => migrator(engine).iter().map(|it| it.sql.as_str().to_owned()).collect(),
    };
    let schema = schema.join("\n").split_whitespace().collect::<Vec<_>>().join(" ");
    fn words(all: impl Iterator<Item = &'static str>) -> String {
        all.map(|word| format!("'{word}'")).collect::<Vec<_>>().join(", ")
    }
    for (column, words) in [
        ("state", words(JobState::ALL.iter().map(|word| word.as_str()))),
        ("failure_class", words(FailureClass::ALL.iter().map(|word| word.as_str()))),
        ("outcome", words(AttemptOutcome::ALL.iter().map(|word| word.as_str()))),
        ("cache", words(Cache::ALL.iter().map(|word| word.as_str()))),
        ("filled_by", words(FilledBy::ALL.iter().map(|word| word.as_str()))),
        ("design", words(DesignKind::ALL.iter().map(|word| word.as_str()))),
        ("format", words(MeshFormat::ALL.iter().map(|word| word.as_str()))),
    ] {
        let check = format!("CHECK ({column} IN ({words}))").replace("( ", "(");
        let found = schema.replace("IN ( ", "IN (").contains(&check);
        assert!(found, "{check}\n{schema}");
    }
    store.close().await;
}

#[tokio::test]
async fn connections_have_safe_settings() {
    let (store, _dir) = store().await;
    let settings = store
        .writer
        .write(|tx| {
            Box::pin(async move {
                let mode: String = query_scalar("PRAGMA journal_mode").fetch_one(&mut *tx).await?;
                let flush: i64 = query_scalar("PRAGMA synchronous").fetch_one(&mut *tx).await?;
                let keys: i64 = query_scalar("PRAGMA foreign_keys").fetch_one(&mut *tx).await?;
                Ok((mode, flush, keys))
            })
        })
        .await
        .unwrap();
    // 1 is `NORMAL`: the flusher flushes.
    assert_eq!(settings, ("wal".to_owned(), 1, 1));
    let written = query("DELETE FROM jobs").execute(&store.readers).await;
    assert!(written.unwrap_err().to_string().contains("readonly"), "readers only read");
    store.close().await;
}

async fn insert_position(store: &Store, priority: i64, position: i64) -> Result<(), StoreError> {
    store
        .writer
        .write(move |tx| {
            Box::pin(async move {
                let sql =
                    "INSERT INTO fair_share (priority, owner, queue_position, round) VALUES (?, 0, ?, 0)";
                query(sql).bind(priority).bind(position).execute(&mut *tx).await?;
                // An odd position fails after the first statement.
                if position % 2 == 1 {
                    query(sql).bind(priority).bind(position).execute(&mut *tx).await?;
                }
                Ok(())
            })
        })
        .await
}

async fn writes_of_a_group_fail_alone(place: Place) {
    let store = place.open().await;
    let store = std::sync::Arc::new(store);
    let writes: Vec<_> = (0..50)
        .map(|number| {
            let store = store.clone();
            tokio::spawn(async move { insert_position(&store, number, number).await })
        })
        .collect();
    for (number, write) in writes.into_iter().enumerate() {
        assert_eq!(write.await.unwrap().is_ok(), number % 2 == 0, "{number}");
    }
    let stored: Vec<i64> = query_scalar("SELECT queue_position FROM fair_share ORDER BY queue_position")
        .fetch_all(&store.readers)
        .await
        .unwrap();
    assert_eq!(stored, (0..50).step_by(2).collect::<Vec<_>>());
    store.close().await;
    assert!(matches!(insert_position(&store, 1, 2).await, Err(StoreError::WriterGone)));
}

async fn design_points_and_results_never_change(place: Place) {
    let store = place.open().await;
    let attempt = |sql: &'static str| {
        store.writer.write(move |tx| {
            Box::pin(async move {
                raw_sql(
                    "INSERT INTO sweeps (id, name, spec, factors, labels, points, replicates, submitted_at)
                     VALUES ('s', 'n', '{}', '[]', '{}', 1, 1, 0);
                     INSERT INTO design_points VALUES ('s', 0, '{}');",
                )
                .execute(&mut *tx)
                .await?;
                raw_sql(sql).execute(&mut *tx).await?;
                Ok(())
            })
        })
    };
    let error = attempt("UPDATE design_points SET levels = '[]'").await.unwrap_err();
    let error = format!("{error:?}");
    assert!(error.contains("a design point never changes"), "{error}");
    let error = attempt("INSERT INTO design_points VALUES ('t', 0, '{}')").await.unwrap_err();
    let error = format!("{error:?}");
    assert!(error.to_uppercase().contains("FOREIGN KEY"), "{error}");
    store.close().await;
}

async fn a_lease_expires_by_the_lease_clock_and_its_end_has_wall_time(place: Place) {
    let store = place.open().await;
    store
        .writer
        .write(|tx| {
            Box::pin(async move {
                raw_sql(
                    "INSERT INTO scenarios (digest, body) VALUES ('d', '{}');
                     INSERT INTO jobs (id, scenario_digest, seed, priority, queue_position, labels, cache, submitted_at, state,
                                       attempt, cancelling, lease_expires_at)
                     VALUES ('01890000-0000-7000-8000-000000000000', 'd', 1, 0, 0, '{}', 'use', 0, 'running',
                             1, 1, 100);",
                )
                .execute(&mut *tx)
                .await?;
                Ok(())
            })
        })
        .await
        .unwrap();
    let now = Now { wall: Timestamp(7000), lease: Timestamp(100) };
    assert_eq!(store.expire(Default::default(), now).await.unwrap().changes.len(), 1);
    let ended: i64 = query_scalar("SELECT ended_at FROM jobs").fetch_one(&store.readers).await.unwrap();
    assert_eq!(ended, 7000);
    store.close().await;
}

fn mesh(digest: &str) -> MeshView {
    MeshView {
        digest: digest.to_owned(),
        bytes: 3,
        format: MeshFormat::Binary,
        triangles: 1,
        degenerate: 0,
        closed: false,
        open_edges: 3,
        turned_edges: 0,
        low: [0.0; 3],
        high: [1.0; 3],
        size: [1.0; 3],
        uploaded_at: Timestamp(7),
    }
}

async fn versions_never_repeat_after_deletions(place: Place) {
    let store = place.open().await;
    let (sweep, job) = (SweepId::new(), JobId::new());
    let write = async |sql: String| {
        let sql = AssertSqlSafe(sql);
        store
            .writer
            .write(move |tx| Box::pin(async move { Ok(raw_sql(sql).execute(tx).await.map(drop)?) }))
            .await
            .unwrap();
    };
    let versions = async || {
        let mut versions = Vec::new();
        for subject in [Subject::Everything, Subject::Workers, Subject::Job(job), Subject::Sweep(sweep)] {
            versions.push(store.version(subject).await.unwrap());
        }
        versions
    };
    assert_eq!(versions().await[2..], [None, None], "no job and no sweep");
    write(format!(
        "INSERT INTO sweeps (id, name, spec, factors, labels, points, replicates, submitted_at)
         VALUES ('{sweep}', 'n', '{{}}', '[]', '{{}}', 1, 1, 0);
         INSERT INTO design_points VALUES ('{sweep}', 0, '{{}}');
         INSERT INTO scenarios VALUES ('d', '{{}}');
         INSERT INTO jobs (id, sweep_id, point, replicate, scenario_digest, seed, priority, queue_position, labels, cache, submitted_at)
         VALUES ('{job}', '{sweep}', 0, 0, 'd', 1, 0, 1, '{{}}', 'use', 0);"
    ))
    .await;
    let queued = versions().await;
    write("UPDATE jobs SET state = 'cancelled', ended_at = 1".to_owned()).await;
    let ended = versions().await;
    store.forget_before(Timestamp(i64::MAX)).await.unwrap();
    assert_eq!(store.event_range().await.unwrap(), (2, 1), "the only event is deleted");
    let forgotten = versions().await;
    for (subject, queued) in queued.iter().enumerate() {
        assert_ne!(*queued, ended[subject], "{subject}: the job ended");
        assert_ne!(*queued, forgotten[subject], "{subject}: the version of the queued job does not return");
    }

    let mut seen = vec![store.version(Subject::Meshes).await.unwrap()];
    for sql in ["", "", "DELETE FROM meshes WHERE digest = '0'", "DELETE FROM meshes"] {
        let digest = (seen.len() - 1).to_string();
        match sql {
            "" => drop(store.insert_mesh(mesh(&digest), &[1, 2, 3]).await.unwrap()),
            sql => write(sql.to_owned()).await,
        }
        let version = store.version(Subject::Meshes).await.unwrap();
        assert!(!seen.contains(&version), "{version:?} repeats");
        seen.push(version);
    }
    store.close().await;
}

/// Readers see a commit before the writer knows that it has ended.
async fn versions_are_no_older_than_an_event_that_was_read(place: Place) {
    let store = Arc::new(place.open().await);
    let (writing, is_over) = (store.clone(), CancellationToken::new());
    let guard = is_over.clone().drop_guard();
    let writer = tokio::spawn(async move {
        let _guard = guard;
        let insert = "INSERT INTO events (at, job_id, state, attempt, cancelling, paused)
                      SELECT 0, CAST(count(*) AS TEXT), 'queued', 1, 0, 0 FROM events";
        for _ in 0..1500 {
            let done = writing
                .writer
                .write(move |tx| Box::pin(async move { Ok(query(insert).execute(tx).await.map(drop)?) }));
            done.await.unwrap();
        }
    });
    while !is_over.is_cancelled() {
        let (_, newest) = store.event_range().await.unwrap();
        let version = store.version(Subject::Everything).await.unwrap().unwrap();
        let changed: i64 = version.split('.').next().unwrap().parse().unwrap();
        assert!(changed >= newest, "event {newest} was read before version {version}");
    }
    writer.await.unwrap();
    store.close().await;
}

async fn parts_of_an_interrupted_upload_are_removed_at_the_next_start(place: Place) {
    let store = place.open().await;
    assert!(store.insert_mesh(mesh("whole"), &[1, 2, 3]).await.unwrap());
    assert!(!store.insert_mesh(mesh("whole"), &[1, 2, 3]).await.unwrap(), "stored before");
    let half = "INSERT INTO mesh_parts SELECT 'half', 0, data FROM mesh_parts";
    let write = async |sql: &'static str| {
        store
            .writer
            .write(move |tx| Box::pin(async move { Ok(raw_sql(sql).execute(tx).await.map(drop)?) }))
            .await
    };
    write(half).await.unwrap();
    for sql in ["UPDATE mesh_parts SET data = data", "UPDATE meshes SET bytes = 4"] {
        let error = format!("{:?}", write(sql).await.unwrap_err());
        assert!(error.contains("a mesh never changes"), "{sql}: {error}");
    }
    store.close().await;
    let store = place.open().await;
    assert_eq!(store.mesh_part("half", 0).await.unwrap(), None);
    assert_eq!(store.mesh_file("whole").await.unwrap(), [1, 2, 3]);
    assert_eq!(store.mesh("whole").await.unwrap(), Some(mesh("whole")));
    store.close().await;
}
