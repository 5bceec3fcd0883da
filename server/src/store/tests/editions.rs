//! Servers of two versions on one database of PostgreSQL: an older one never writes after a newer one has led.

use std::net::SocketAddr;
use std::path::Path;
use std::time::{Duration, Instant};

use roost_solver::SOLVER_REVISION;
use serde_json::{Value, json};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use super::super::database::{AssertSqlSafe, Connection, query_scalar, raw_sql};
use super::super::testing::Place;
use super::super::{Edition, Location, Store, StoreError, Unavailable};
use crate::config::ServerConfig;
use crate::server::{Server, ServerError};

/// The next version, with a migration and a solver of its own.
fn next_version() -> Edition {
    let next_migration = Some("ALTER TABLE workers ADD COLUMN of_next_version BIGINT");
    Edition { solver_revision: SOLVER_REVISION + 1, next_migration }
}

/// A server in this process.
struct Running {
    address: SocketAddr,
    stop: CancellationToken,
    task: JoinHandle<Result<(), ServerError>>,
}

impl Running {
    async fn start(place: &Place, data: &Path, edition: Edition) -> Result<Self, ServerError> {
        let _ = rustls::crypto::ring::default_provider().install_default();
        let (listen, data) = (([127, 0, 0, 1], 0).into(), data.to_owned());
        let database = Some(place.location.clone());
        let config = ServerConfig { listen, data, database, edition, ..ServerConfig::default() };
        let server = Server::bind(config).await?;
        let (address, stop) = (server.local_addr(), CancellationToken::new());
        Ok(Self { address, stop: stop.clone(), task: tokio::spawn(server.run(stop)) })
    }

    async fn stop(self) {
        self.stop.cancel();
        self.task.await.unwrap().unwrap();
    }

    /// Status and document of the answer to a GET, or to a POST of a document.
    async fn ask(&self, path: &str, document: Option<Value>) -> (u16, Value) {
        let (url, http) = (format!("http://{}{path}", self.address), reqwest::Client::new());
        let request = match document {
            Some(document) => http.post(url).json(&document),
            None => http.get(url),
        };
        let answer = request.send().await.unwrap();
        (answer.status().as_u16(), answer.json().await.unwrap_or_default())
    }

    async fn submit(&self, seed: u32) -> (u16, Value) {
        let scenario = json!({"experiment": "hopper", "seed": seed});
        self.ask("/v1/jobs", Some(json!({"scenario": scenario}))).await
    }

    /// Registers a worker.
    async fn worker(&self) -> Value {
        let id = json!(roost_api::ids::WorkerId::new());
        let registration = json!({"worker_id": id, "name": "a", "api_version": "v1", "solver_revision": SOLVER_REVISION,
                                  "backend": "cpu", "device": "a", "threads": 1});
        assert_eq!(self.ask("/v1/workers", Some(registration)).await.0, 200);
        id
    }

    /// The jobs that a worker gets.
    async fn claim(&self, worker: &Value) -> Vec<Value> {
        let claim =
            json!({"request_id": uuid::Uuid::now_v7(), "worker_id": worker, "max_jobs": 64, "wait_s": 0.0});
        let (status, reply) = self.ask("/v1/claims", Some(claim)).await;
        assert_eq!(status, 200, "{reply}");
        reply["attempts"].as_array().unwrap().iter().map(|attempt| attempt["job_id"].clone()).collect()
    }

    /// Waits until it answers with a status, and with these words if it is not ready.
    async fn wait_until_ready_is(&self, expected: u16, words: &str) {
        let began = Instant::now();
        loop {
            let (status, document) = self.ask("/readyz", None).await;
            if status == expected && document.to_string().contains(words) {
                return;
            }
            assert!(began.elapsed() < Duration::from_secs(40), "{words}: {status} {document}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
}

fn id_of((status, job): (u16, Value)) -> Value {
    assert_eq!(status, 202, "{job}");
    job["id"].clone()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_newer_server_takes_over_and_the_older_one_stands_by_for_good() {
    let (place, data) = (Place::postgres(), tempfile::tempdir().unwrap());
    let start = |edition| Running::start(&place, data.path(), edition);
    let older = start(Edition::default()).await.unwrap();
    let (running, worker) = (id_of(older.submit(1).await), older.worker().await);
    assert_eq!(older.claim(&worker).await, std::slice::from_ref(&running));
    let newer = start(next_version()).await.unwrap();
    newer.wait_until_ready_is(200, "ok").await;
    let waiting = id_of(newer.submit(2).await);

    // The upgrade: the newer server leads after the older one.
    older.stop().await;
    newer.wait_until_ready_is(200, "ok").await;
    assert!(newer.claim(&worker).await.is_empty(), "a worker with the older solver gets no more jobs");
    let older = start(Edition::default()).await.expect("it passes requests on");
    older.wait_until_ready_is(200, "ok").await;
    assert_eq!(older.ask("/v1/jobs", None).await.1["items"].as_array().unwrap().len(), 2);

    // Without the newer one, the older one does not lead, and another older one ends.
    newer.stop().await;
    let reason = "the database was made by a newer roost";
    older.wait_until_ready_is(503, reason).await;
    let (status, problem) = older.submit(3).await;
    assert!(status == 503 && problem["detail"].as_str().unwrap().contains(reason), "{problem}");
    let refused = start(Edition::default()).await.err().expect("it ends");
    assert!(matches!(refused, ServerError::Store(StoreError::Newer { .. })), "{refused:?}");
    let same_schema = Edition { next_migration: next_version().next_migration, ..Edition::default() };
    let refused = start(same_schema).await.err().expect("it ends");
    assert!(matches!(refused, ServerError::Store(StoreError::NewerSolver { .. })), "{refused:?}");

    // The next newer server has all jobs, and the older one passes requests on to it.
    let newer = start(next_version()).await.unwrap();
    older.wait_until_ready_is(200, "ok").await;
    assert_eq!(
        older.ask(&format!("/v1/jobs/{}", running.as_str().unwrap()), None).await.1["state"],
        "running"
    );
    assert_eq!(newer.claim(&newer.worker().await).await, [waiting]);
    newer.stop().await;
    older.stop().await;
}

/// Ends the session of a store like a broken connection, after some statements of another server.
async fn break_after(place: &Place, statements: &'static str) {
    let Location::Postgres(address) = &place.location else { panic!("a file") };
    let mut other = Connection::from(address.connect().await.unwrap().0);
    raw_sql(statements).execute(&mut other).await.unwrap();
    let end = "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity
               WHERE datname = current_database() AND pid <> pg_backend_pid()";
    assert!(query_scalar::<i64>(end).fetch_one(&mut other).await.unwrap() >= 1);
    other.close().await.unwrap();
}

async fn write(store: &Store) -> Result<(), StoreError> {
    let sql = "UPDATE fair_share SET round = round + 1";
    store.writer.write(move |tx| Box::pin(async move { Ok(raw_sql(sql).execute(tx).await?) })).await
}

#[tokio::test]
async fn a_writer_that_connects_again_refuses_a_database_of_another_version_and_ends() {
    let newer_schema =
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
                        VALUES (9999, 'next', true, '', 0)";
    let older_schema =
        "DELETE FROM _sqlx_migrations WHERE version = (SELECT max(version) FROM _sqlx_migrations)";
    for (change, reason, words) in [
        (newer_schema, Unavailable::Newer, "made by a newer roost (schema 9999"),
        ("UPDATE newest_solver SET revision = revision + 1", Unavailable::Newer, "has led this database"),
        (older_schema, Unavailable::Replaced, "an older state of the database"),
    ] {
        let place = Place::postgres();
        let store = place.open().await;
        write(&store).await.unwrap();
        break_after(&place, change).await;
        let refused = write(&store).await.expect_err("another version");
        // A beat may have found it first.
        assert!(refused.unavailable() == Some(reason) || refused.is_stopping(), "{change}: {refused:?}");
        tokio::time::timeout(Duration::from_secs(20), store.ended()).await.expect("the writer ends");
        assert!(store.deposed().unwrap_or_default().contains(words), "{:?}", store.deposed());
        // The lock is free for the next server.
        let Location::Postgres(address) = &place.location else { panic!("a file") };
        address.connect_writer(&mut Vec::new()).await.expect("nobody has the lock");
        store.close().await;
    }
}

#[tokio::test]
async fn a_leader_notes_its_solver_and_drains_workers_of_older_ones() {
    for place in [Place::sqlite(), Place::postgres()] {
        let open =
            async |edition: Edition| Store::open_as(edition, &place.location, &place.objects(), None).await;
        let store = open(Edition::default()).await.unwrap();
        let workers = format!(
            "INSERT INTO workers (id, name, solver_revision, backend, device, threads, registered_at, last_seen_at)
             VALUES ('a', 'a', {SOLVER_REVISION}, 'cpu', 'a', 1, 0, 0), ('b', 'b', {}, 'cpu', 'a', 1, 0, 0)",
            SOLVER_REVISION + 1
        );
        let insert = store
            .writer
            .write(move |tx| Box::pin(async move { Ok(raw_sql(AssertSqlSafe(workers)).execute(tx).await?) }));
        insert.await.unwrap();
        store.close().await;
        let next = Edition { solver_revision: SOLVER_REVISION + 1, ..Edition::default() };
        for edition in [Edition::default(), next, next] {
            let store = open(edition).await.unwrap();
            let draining = "SELECT count(*) FROM workers WHERE draining = 1";
            let draining: i64 = query_scalar(draining).fetch_one(&store.readers).await.unwrap();
            let expected = i64::from(edition.solver_revision > SOLVER_REVISION);
            assert_eq!(draining, expected, "{edition:?}");
            store.close().await;
        }
        let refused = open(Edition::default()).await.err().expect("refused");
        assert!(matches!(refused, StoreError::NewerSolver { .. }), "{refused:?}");
    }
}
