//! The store from inside: plans, constraints, the group commit.

use roost_api::design::DesignKind;
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{AttemptOutcome, Cache, FailureClass, JobState};
use roost_api::mesh::{MeshFormat, MeshView};
use roost_api::time::Timestamp;
use sqlx::{AssertSqlSafe, Row};

use super::eligible_jobs::{ELIGIBLE_JOBS, ROUNDS};
use super::*;
use crate::clock::Now;

async fn store() -> (Store, tempfile::TempDir) {
    let dir = tempfile::tempdir().unwrap();
    (Store::open(&dir.path().join("roost.db"), None).await.unwrap(), dir)
}

/// The lines of `EXPLAIN QUERY PLAN`.
async fn plan(store: &Store, sql: &str) -> String {
    let rows = sqlx::query(AssertSqlSafe(format!("EXPLAIN QUERY PLAN {sql}")))
        .fetch_all(&store.readers)
        .await
        .unwrap();
    rows.iter().map(|row| row.get::<String, _>("detail")).collect::<Vec<_>>().join("\n")
}

#[tokio::test]
async fn a_claim_walks_its_index_and_sorts_nothing() {
    let (store, _dir) = store().await;
    let told = plan(&store, ELIGIBLE_JOBS).await;
    for step in [
        // One after the other as they are asked for, and a step into the index for each.
        "CO-ROUTINE heads",
        "INDEX jobs_to_claim (priority=? AND owner>?)",
        "INDEX jobs_to_claim (priority<?)",
        "SEARCH j USING INDEX jobs_to_claim (priority=? AND owner=?)",
    ] {
        assert!(told.contains(step), "{step}: {told}");
    }
    assert!(!told.contains("TEMP B-TREE") && !told.contains("MATERIALIZE"), "{told}");
    let scans = told.lines().filter(|line| line.contains("SCAN") && !line.contains(" INDEX "));
    assert!(
        scans.clone().all(|line| ["SCAN heads", "SCAN (subquery"].iter().any(|of| line.contains(of))),
        "{told}"
    );
    let told = plan(&store, ROUNDS).await;
    assert!(told.contains("SEARCH fair_share USING PRIMARY KEY (priority=?)"), "{told}");

    let sorted =
        plan(&store, "SELECT seq FROM jobs WHERE state = 'queued' ORDER BY queue_position, priority").await;
    assert!(sorted.contains("TEMP B-TREE"), "what the check above looks for: {sorted}");
    store.close().await;
}

#[tokio::test]
async fn what_runs_often_is_indexed() {
    let (store, _dir) = store().await;
    let arrive = claims::ARRIVE.split(';').nth(1).unwrap();
    for (sql, index) in [
        (
            super::heartbeats::RENEW.split(';').next().unwrap(),
            "SEARCH jobs USING INDEX sqlite_autoindex_jobs_1 (id=?)",
        ),
        (super::versions::JOB, "events_of_job"),
        (super::versions::SWEEP, "events_of_sweep"),
        (super::versions::QUEUE_COUNTS, "SCAN jobs USING INDEX jobs_to_claim"),
        (super::versions::QUEUE_COUNTS, "USING INDEX jobs_ended"),
        (super::versions::QUEUED_AT, "events_of_job"),
        ("SELECT 1 FROM jobs WHERE state = 'running' AND lease_expires_at <= 5", "jobs_by_lease"),
        ("SELECT 1 FROM jobs WHERE state = 'running' AND deadline <= 5", "jobs_by_deadline"),
        ("SELECT 1 FROM jobs WHERE not_before <= 5", "jobs_paused"),
        (arrive, "INDEX jobs_by_worker (worker_id=? AND state=?)"),
        (arrive, "SEARCH attempts USING COVERING INDEX attempts_by_worker (worker_id=? AND outcome=?)"),
        (arrive, "attempts_by_request (request_id=? AND worker_id=?)"),
        ("SELECT 1 FROM workers WHERE last_seen_at BETWEEN 5 AND 9", "workers_by_last_seen"),
        (super::workers::FORGET, "SEARCH workers USING INDEX workers_by_last_seen"),
        (super::workers::FORGET, "attempts_by_worker"),
        // What a removal of a worker asks by itself.
        ("SELECT 1 FROM jobs WHERE worker_id = ?", "jobs_by_worker"),
        (
            "SELECT state, count(*) FROM jobs WHERE sweep_id IN ('a') GROUP BY sweep_id, state",
            "jobs_by_sweep",
        ),
        (super::sweeps::COUNTS, "COVERING INDEX jobs_by_sweep"),
        (super::sweeps::FAILURES, "COVERING INDEX jobs_failed_of_sweep"),
        (
            "SELECT * FROM jobs j WHERE j.seq < 9 AND j.sweep_id = 'a' AND j.failure_class = ? ORDER BY j.seq DESC",
            "jobs_failed_of_sweep",
        ),
        ("SELECT * FROM jobs j WHERE j.seq < 9 AND j.failure_class = ? ORDER BY j.seq DESC", "jobs_failed"),
        (format!("SELECT j.id FROM jobs j {}", super::trials::FROM).as_str(), "jobs_by_point"),
        ("SELECT * FROM jobs j WHERE +j.seq < 9 AND j.sweep_id = 'a' AND j.point = 3", "jobs_by_point"),
        ("SELECT 1 FROM frames WHERE object_digest = 'a'", "frames_by_object"),
        (super::frames::UNREFERENCED, "frames_by_object"),
        ("SELECT * FROM jobs WHERE sweep_id = 'a' AND seq < 9 ORDER BY seq DESC", "jobs_of_sweep"),
        (
            "SELECT * FROM jobs WHERE state = ? AND ended_at IS NOT NULL AND seq < 9 ORDER BY seq DESC",
            "jobs_ended",
        ),
        ("SELECT 1 FROM jobs WHERE scenario_digest = 'a'", "jobs_by_digest"),
        ("SELECT 1 FROM results WHERE document_digest = 'a'", "results_by_document"),
        ("SELECT 1 FROM attempts WHERE partial_digest = 'a'", "attempts_by_partial"),
        ("SELECT id, scenario_digest FROM jobs WHERE sweep_id = 'a' LIMIT 500", "jobs_"),
        ("SELECT 1 FROM results WHERE scenario_digest = 'a' AND solver_revision = 1", "results_by_digest"),
    ] {
        let told = plan(&store, sql).await;
        assert!(told.contains(index) && !told.contains("TEMP B-TREE"), "{sql}\n{told}");
    }
    store.close().await;
}

#[tokio::test]
async fn what_is_asked_together_reads_nothing_but_what_is_asked() {
    let (store, _dir) = store().await;
    let json = |line: &&str| line.contains("VIRTUAL TABLE");
    for sql in [
        claims::ARRIVE,
        claims::TAKE,
        claims::REPEAT,
        transitions::END,
        deliveries::RECORD,
        heartbeats::RENEW,
    ] {
        for statement in sql.split(';') {
            let told = plan(&store, statement).await;
            let scans = told.lines().filter(|line| line.contains("SCAN") && !json(line));
            assert_eq!(scans.count(), 0, "{statement}\n{told}");
        }
    }
    let scan = plan(&store, "UPDATE jobs SET alone = 1 WHERE labels = '{}' RETURNING id").await;
    assert!(scan.contains("SCAN jobs"), "what the check above looks for: {scan}");
    store.close().await;
}

#[tokio::test]
async fn the_enums_are_pinned_by_the_schema() {
    let (store, _dir) = store().await;
    let schema: Vec<String> = sqlx::query_scalar("SELECT sql FROM sqlite_master WHERE type = 'table'")
        .fetch_all(&store.readers)
        .await
        .unwrap();
    let schema = schema.join("\n").split_whitespace().collect::<Vec<_>>().join(" ");
    fn words(all: impl Iterator<Item = &'static str>) -> String {
        all.map(|word| format!("'{word}'")).collect::<Vec<_>>().join(", ")
    }
    for (column, words) in [
        ("state", words(JobState::ALL.iter().map(|word| word.as_str()))),
        ("failure_class", words(FailureClass::ALL.iter().map(|word| word.as_str()))),
        ("outcome", words(AttemptOutcome::ALL.iter().map(|word| word.as_str()))),
        ("cache", words(Cache::ALL.iter().map(|word| word.as_str()))),
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
async fn the_connection_is_set_up_for_safety() {
    let (store, _dir) = store().await;
    let settings = store
        .writer
        .write(|tx| {
            Box::pin(async move {
                let mode: String = sqlx::query_scalar("PRAGMA journal_mode").fetch_one(&mut *tx).await?;
                let flush: i64 = sqlx::query_scalar("PRAGMA synchronous").fetch_one(&mut *tx).await?;
                let keys: i64 = sqlx::query_scalar("PRAGMA foreign_keys").fetch_one(&mut *tx).await?;
                Ok((mode, flush, keys))
            })
        })
        .await
        .unwrap();
    assert_eq!(settings, ("wal".to_owned(), 2, 1));
    let written = sqlx::query("DELETE FROM jobs").execute(&store.readers).await;
    assert!(written.unwrap_err().to_string().contains("readonly"), "readers only read");
    store.close().await;
}

#[test]
fn an_old_sqlite_is_refused() {
    for (version, sound) in [
        ("3.51.3", true),
        ("3.51.2", false),
        ("3.50.9", false),
        ("3.52.0", true),
        ("4.0.0", true),
        ("3.51.10", true),
        ("", false),
    ] {
        assert_eq!(is_sound(version), sound, "{version}");
    }
}

async fn insert_turn(store: &Store, priority: i64, turn: i64) -> Result<(), StoreError> {
    store
        .writer
        .write(move |tx| {
            Box::pin(async move {
                let sql =
                    "INSERT INTO fair_share (priority, owner, queue_position, round) VALUES (?, 0, ?, 0)";
                sqlx::query(sql).bind(priority).bind(turn).execute(&mut *tx).await?;
                // Fails after the first write where the turn is odd.
                if turn % 2 == 1 {
                    sqlx::query(sql).bind(priority).bind(turn).execute(&mut *tx).await?;
                }
                Ok(())
            })
        })
        .await
}

#[tokio::test]
async fn pieces_of_a_group_fail_alone() {
    let (store, _dir) = store().await;
    let store = std::sync::Arc::new(store);
    let writes: Vec<_> = (0..50)
        .map(|number| {
            let store = store.clone();
            tokio::spawn(async move { insert_turn(&store, number, number).await })
        })
        .collect();
    for (number, write) in writes.into_iter().enumerate() {
        assert_eq!(write.await.unwrap().is_ok(), number % 2 == 0, "{number}");
    }
    let kept: Vec<i64> = sqlx::query_scalar("SELECT queue_position FROM fair_share ORDER BY queue_position")
        .fetch_all(&store.readers)
        .await
        .unwrap();
    assert_eq!(kept, (0..50).step_by(2).collect::<Vec<_>>());
    store.close().await;
    assert!(matches!(insert_turn(&store, 1, 2).await, Err(StoreError::WriterGone)));
}

#[tokio::test]
async fn design_points_and_results_never_change() {
    let (store, _dir) = store().await;
    let attempt = |sql: &'static str| {
        store.writer.write(move |tx| {
            Box::pin(async move {
                sqlx::raw_sql(
                    "INSERT INTO sweeps (id, name, spec, factors, labels, points, replicates, submitted_at)
                     VALUES ('s', 'n', '{}', '[]', '{}', 1, 1, 0);
                     INSERT INTO design_points VALUES ('s', 0, '{}');",
                )
                .execute(&mut *tx)
                .await?;
                sqlx::raw_sql(sql).execute(&mut *tx).await?;
                Ok(())
            })
        })
    };
    let error = attempt("UPDATE design_points SET levels = '[]'").await.unwrap_err();
    let error = format!("{error:?}");
    assert!(error.contains("a design point never changes"), "{error}");
    let error = attempt("INSERT INTO design_points VALUES ('t', 0, '{}')").await.unwrap_err();
    let error = format!("{error:?}");
    assert!(error.contains("FOREIGN KEY"), "{error}");
    store.close().await;
}

#[tokio::test]
async fn a_lease_counts_by_its_own_clock_and_ends_at_the_time_people_read() {
    let (store, _dir) = store().await;
    store
        .writer
        .write(|tx| {
            Box::pin(async move {
                sqlx::raw_sql(
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
    let ended: i64 = sqlx::query_scalar("SELECT ended_at FROM jobs").fetch_one(&store.readers).await.unwrap();
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

#[tokio::test]
async fn versions_do_not_come_back_when_events_are_forgotten_or_meshes_go() {
    let (store, _dir) = store().await;
    let (sweep, job) = (SweepId::new(), JobId::new());
    let write = async |sql: String| {
        let sql = AssertSqlSafe(sql);
        store
            .writer
            .write(move |tx| Box::pin(async move { Ok(sqlx::raw_sql(sql).execute(tx).await.map(drop)?) }))
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
    assert_eq!(versions().await[2..], [None, None], "there is none");
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
    assert_eq!(store.event_range().await.unwrap(), (2, 1), "nothing is left of the first and only one");
    let forgotten = versions().await;
    for (subject, queued) in queued.iter().enumerate() {
        assert_ne!(*queued, ended[subject], "{subject}: it ended");
        assert_ne!(*queued, forgotten[subject], "{subject}: and is not queued again");
    }

    let mut seen = vec![store.version(Subject::Meshes).await.unwrap()];
    for sql in ["", "", "DELETE FROM meshes WHERE digest = '0'", "DELETE FROM meshes"] {
        let digest = (seen.len() - 1).to_string();
        match sql {
            "" => drop(store.insert_mesh(mesh(&digest), &[1, 2, 3]).await.unwrap()),
            sql => write(sql.to_owned()).await,
        }
        let version = store.version(Subject::Meshes).await.unwrap();
        assert!(!seen.contains(&version), "{version:?} again");
        seen.push(version);
    }
    store.close().await;
}

#[tokio::test]
async fn what_a_broken_off_upload_left_goes_at_the_next_start() {
    let (store, dir) = store().await;
    assert!(store.insert_mesh(mesh("whole"), &[1, 2, 3]).await.unwrap());
    assert!(!store.insert_mesh(mesh("whole"), &[1, 2, 3]).await.unwrap(), "once");
    let half = "INSERT INTO mesh_parts VALUES ('half', 0, x'0102')";
    let write = async |sql: &'static str| {
        store
            .writer
            .write(move |tx| Box::pin(async move { Ok(sqlx::raw_sql(sql).execute(tx).await.map(drop)?) }))
            .await
    };
    write(half).await.unwrap();
    for sql in ["UPDATE mesh_parts SET data = x'00'", "UPDATE meshes SET bytes = 4"] {
        let error = format!("{:?}", write(sql).await.unwrap_err());
        assert!(error.contains("a mesh never changes"), "{sql}: {error}");
    }
    store.close().await;
    let store = Store::open(&dir.path().join("roost.db"), None).await.unwrap();
    assert_eq!(store.mesh_part("half", 0).await.unwrap(), None);
    assert_eq!(store.mesh_file("whole").await.unwrap(), [1, 2, 3]);
    assert_eq!(store.mesh("whole").await.unwrap(), Some(mesh("whole")));
    store.close().await;
}
