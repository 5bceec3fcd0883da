//! Tests of projects: turns by share, budgets, and the count of used core-hours.

use std::collections::BTreeMap;
use std::time::Duration;

use futures_util::future::join_all;
use roost_api::ids::{SweepId, WorkerId};
use roost_api::project::ProjectView;
use roost_api::token::Scope;
use roost_api::worker::WorkerRegistration;
use roost_solver::SOLVER_REVISION;
use roost_solver::scenario::{self, Scenario};
use serde_json::{Map, json};
use uuid::Uuid;

use super::super::database::{Connection, query_as, sqlite};
use super::super::*;
use super::*;
use crate::queue::{Provenance, RetryPolicy, Stated};
use crate::sweep::Trial;

mod charges;

on_both_engines!(
    a_small_project_waits_for_one_round_of_the_workers_at_most,
    claims_follow_the_shares_of_projects,
    a_project_without_budget_waits_until_the_budget_is_raised,
    projects_are_checked_when_they_are_made_and_changed,
    an_upgrade_puts_earlier_tokens_into_the_default_project,
);

const LEASE: Duration = Duration::from_secs(9);
const HOUR_MS: i64 = 3_600_000;

pub(super) fn at(ms: i64) -> Now {
    Now { wall: Timestamp(ms), lease: Timestamp(ms) }
}

fn share(share: u32) -> ProjectChange {
    ProjectChange { share: Some(share), ..ProjectChange::default() }
}

fn budget(core_hours: Option<f64>) -> ProjectChange {
    ProjectChange { budget_core_hours: Some(core_hours), ..ProjectChange::default() }
}

/// A store with projects of these shares, and tokens in each: the ids by project.
pub(super) async fn with_projects(
    place: &Place,
    projects: &[(&str, u32, usize)],
) -> (Store, Vec<Vec<String>>) {
    let mut file = TokenFile::open(&place.location, true).await.unwrap();
    let mut tokens = Vec::new();
    for (project, of_project, count) in projects {
        file.create_project(project, share(*of_project)).await.unwrap();
        let mut ids = Vec::new();
        for _ in 0..*count {
            let token =
                NewToken { name: "t", user: "u", project, scopes: &[Scope::Submit], expires_at: None };
            ids.push(file.create_for(token, Timestamp(0)).await.unwrap().0.id);
        }
        tokens.push(ids);
    }
    file.close().await.unwrap();
    (place.open().await, tokens)
}

/// Changes a project beside the running store, as `roost project set` does.
async fn change(place: &Place, project: &str, change: ProjectChange) {
    let mut file = TokenFile::open(&place.location, false).await.unwrap();
    file.set_project(project, change).await.unwrap();
    file.close().await.unwrap();
}

fn hopper(seed: usize) -> Scenario {
    scenario::from_value(&json!({"experiment": "hopper", "seed": seed})).unwrap()
}

/// Submits a sweep of this many jobs.
pub(super) async fn submit(store: &Store, token: &str, jobs: usize) -> SweepId {
    let one = hopper(1);
    let trial =
        |point| Trial { point: point as u32, replicate: 0, scenario: one.clone(), levels: Some(Map::new()) };
    let id = SweepId::new();
    let sweep = NewSweep::simulated(id, (token, 0), (0..jobs).map(trial).collect());
    store.insert_sweep(sweep, Timestamp(0), ()).await.unwrap();
    id
}

pub(super) async fn register(store: &Store) -> WorkerId {
    let worker_id = WorkerId::new();
    let worker = WorkerRegistration {
        worker_id,
        name: "a".to_owned(),
        api_version: "v1".to_owned(),
        solver_revision: SOLVER_REVISION,
        backend: "cpu".to_owned(),
        device: "a".to_owned(),
        threads: 8,
        memory_mib: None,
    };
    store.register_worker(worker, Timestamp(0)).await.unwrap().unwrap();
    worker_id
}

fn claim_of(worker: WorkerId, max_jobs: u32) -> Claim {
    Claim {
        request_id: Uuid::now_v7(),
        worker,
        max_jobs,
        lease: LEASE,
        max_frames_bytes: 0,
        checkpoints: None,
        shares_fills: false,
        max_fill_bytes: 0,
    }
}

pub(super) async fn claim(store: &Store, worker: WorkerId, max_jobs: u32, now: Now) -> Vec<(JobId, u32)> {
    let claimed = store.claim(claim_of(worker, max_jobs), now).await.unwrap().unwrap();
    claimed.attempts.iter().map(|attempt| (attempt.job_id, attempt.attempt)).collect()
}

/// All projects, newest first.
async fn listed(store: &Store) -> Vec<ProjectView> {
    store.projects(None, 99, &store.project_counts().await.unwrap()).await.unwrap().0
}

/// The number of running jobs by project.
async fn running(store: &Store) -> BTreeMap<String, u64> {
    let projects = listed(store).await;
    projects.into_iter().map(|project| (project.name, project.running)).collect()
}

async fn a_small_project_waits_for_one_round_of_the_workers_at_most(place: Place) {
    let (store, tokens) = with_projects(&place, &[("large", 1, 5), ("small", 1, 1)]).await;
    let mut workers = Vec::new();
    for _ in 0..20 {
        workers.push(register(&store).await);
    }
    for token in &tokens[0] {
        submit(&store, token, 2000).await;
    }
    let round = async || {
        let claims = workers.iter().map(|worker| claim(&store, *worker, 1, at(0)));
        assert_eq!(join_all(claims).await.iter().flatten().count(), workers.len());
        running(&store).await
    };
    for _ in 0..3 {
        round().await;
    }
    submit(&store, &tokens[1][0], 10).await;
    // Half of this round is the small project's, although the large one has five owners and 9,940 older jobs.
    let counts = round().await;
    assert_eq!((counts["large"], counts["small"]), (70, 10), "{counts:?}");
    let counts = round().await;
    assert_eq!((counts["large"], counts["small"]), (90, 10), "the workers do not wait for it: {counts:?}");
    let projects = listed(&store).await;
    let queued: Vec<_> = projects.iter().map(|project| (project.name.as_str(), project.queued)).collect();
    assert_eq!(queued, [("small", 0), ("large", 9910), ("default", 0)]);
    store.close().await;
}

async fn claims_follow_the_shares_of_projects(place: Place) {
    let (store, tokens) = with_projects(&place, &[("double", 2, 2), ("single", 1, 1)]).await;
    let worker = register(&store).await;
    for token in tokens.iter().flatten() {
        submit(&store, token, 500).await;
    }
    let mut claimed = 0;
    for (max_jobs, times) in [(1, 30), (7, 3), (3, 3)] {
        for _ in 0..times {
            claimed += claim(&store, worker, max_jobs, at(0)).await.len() as u64;
            let counts = running(&store).await;
            // Within a round, the single turn is the first or second one.
            assert_eq!(counts["double"] + counts["single"], claimed);
            assert!(
                counts["double"].abs_diff(2 * counts["single"]) <= 2,
                "after {claimed} claims: {counts:?}"
            );
        }
    }
    assert_eq!(claimed, 60);
    assert_eq!(running(&store).await["double"], 40);
    change(&place, "single", share(4)).await;
    claim(&store, worker, 60, at(0)).await;
    let counts = running(&store).await;
    // Two of six turns.
    assert!(counts["double"].abs_diff(60) <= 2, "{counts:?}");
    assert_eq!(counts["double"] + counts["single"], 120);
    store.close().await;
}

async fn a_project_without_budget_waits_until_the_budget_is_raised(place: Place) {
    let (store, tokens) = with_projects(&place, &[("paid", 1, 1), ("free", 1, 1)]).await;
    let worker = register(&store).await;
    change(&place, "paid", budget(Some(5.0))).await;
    submit(&store, &tokens[0][0], 4).await;
    let first = claim(&store, worker, 2, at(0)).await;
    // Three threads for two hours, which is more than the budget.
    succeed(&store, worker, first[0], 2 * HOUR_MS).await;
    let has_work = async |now| store.has_work(claim_of(worker, 1), now).await.unwrap();
    let now = at(2 * HOUR_MS);
    assert!(!has_work(now).await, "the budget is used up");
    // Alerts about jobs that wait for workers depend on this time.
    let oldest = async || store.queue_counts(now.wall, LEASE).await.unwrap().oldest_queued_at;
    assert_eq!(oldest().await, None, "no worker could help");
    assert_eq!(claim(&store, worker, 2, now).await, []);
    assert_eq!(store.queue_groups().await.unwrap().0, [], "queued jobs come before no others");
    let sql = "SELECT id FROM jobs WHERE state = 'queued' ORDER BY seq LIMIT 1";
    let queued: (String,) = query_as(sql).fetch_one(&store.readers).await.unwrap();
    let queued: JobId = queued.0.parse().unwrap();
    let spent = store.queued_job(queued).await.unwrap().unwrap().job.spent.expect("used up");
    assert_eq!((spent.used_core_hours, spent.budget_core_hours), (6.0, 5.0));

    // Submissions are accepted, running jobs end, and other projects go on.
    submit(&store, &tokens[0][0], 1).await;
    submit(&store, &tokens[1][0], 1).await;
    assert_eq!(claim(&store, worker, 9, now).await.len(), 1);
    succeed(&store, worker, first[1], 2 * HOUR_MS).await;
    let values = async || store.project_values().await.unwrap()["paid"];
    let spent = values().await;
    assert!(spent.is_spent && spent.budget_core_hours == Some(5.0), "{spent:?}");
    change(&place, "paid", budget(Some(12.0))).await;
    assert!(!has_work(now).await, "12 of 12 core-hours");
    change(&place, "paid", budget(Some(12.5))).await;
    assert!(values().await.has_more_than(&spent) && !values().await.is_spent);
    // It was used up and raised between two looks of the server.
    let unspent = ProjectValues { is_spent: false, ..spent };
    assert!(values().await.has_more_than(&unspent) && !unspent.has_more_than(&values().await));
    assert_eq!(oldest().await, Some(Timestamp(0)));
    assert!(store.queued_job(queued).await.unwrap().unwrap().job.spent.is_none());
    assert_eq!(claim(&store, worker, 2, now).await.len(), 2);
    change(&place, "paid", budget(Some(1.0))).await;
    assert!(!has_work(now).await);
    change(&place, "paid", budget(None)).await;
    assert_eq!(claim(&store, worker, 2, now).await.len(), 1);
    store.close().await;
}

/// Delivers a result of three threads, whose time has no limit.
pub(super) async fn succeed(store: &Store, worker: WorkerId, attempt: (JobId, u32), at_ms: i64) {
    deliver(store, worker, attempt, Stated { threads: 3, wall_ms: i64::MAX }, at_ms).await;
}

async fn deliver(store: &Store, worker: WorkerId, (job, attempt): (JobId, u32), stated: Stated, at_ms: i64) {
    let provenance = Provenance {
        scenario: store.job(job).await.unwrap().unwrap().scenario_digest,
        revision: SOLVER_REVISION,
        backend: "cpu".to_owned(),
        device: "a".to_owned(),
    };
    let mut result = EncodedResult::sample(provenance, &format!("{job}"));
    result.stated = stated;
    store.record_result(job, attempt, worker, (result, None), Timestamp(at_ms)).await.unwrap().unwrap();
}

async fn projects_are_checked_when_they_are_made_and_changed(place: Place) {
    let mut file = TokenFile::open(&place.location, true).await.unwrap();
    let longest = "a".repeat(64);
    for name in ["a", "Ski-wax_2.0", longest.as_str()] {
        file.create_project(name, ProjectChange::default()).await.unwrap();
        let view = file.project(name).await.unwrap();
        assert_eq!((view.share, view.budget_core_hours, view.used_core_hours), (1, None, 0.0));
    }
    for name in ["", "-a", ".a", "a b", "a;b", "käse", &"a".repeat(65)] {
        let error = file.create_project(name, ProjectChange::default()).await.unwrap_err().to_string();
        assert!(error.contains(&format!("{name:?}")) && error.contains("1 to 64"), "{error}");
    }
    for (values, expected) in [
        (share(0), "share 0 is out of range: allowed is 1 to 1000"),
        (share(1001), "share 1001 is out of range"),
        (budget(Some(-1.0)), "budget of -1 core-hours is out of range: allowed is 0 to 1e9, or `none`"),
        (budget(Some(f64::NAN)), "budget of NaN core-hours"),
        (budget(Some(1e10)), "budget of 10000000000 core-hours"),
    ] {
        for error in [file.create_project("new", values).await, file.set_project("a", values).await] {
            let error = error.unwrap_err().to_string();
            assert!(error.starts_with(expected), "{error}");
        }
    }
    assert!(
        matches!(file.create_project("a", share(1)).await, Err(ProjectError::Exists(name)) if name == "a")
    );
    assert!(matches!(file.set_project("b", share(1)).await, Err(ProjectError::Unknown(name)) if name == "b"));
    let token = NewToken { project: "b", name: "", user: "", scopes: &[], expires_at: None };
    assert!(matches!(file.create_for(token, Timestamp(0)).await, Err(ProjectError::Unknown(_))));
    // Each value changes alone.
    file.set_project("a", share(3)).await.unwrap();
    file.set_project("a", budget(Some(0.1))).await.unwrap();
    let view = file.project("a").await.unwrap();
    assert_eq!((view.share, view.budget_core_hours, view.is_used_up()), (3, Some(0.1), false));
    file.set_project("a", budget(Some(0.0))).await.unwrap();
    assert!(file.project("a").await.unwrap().is_used_up());
    file.close().await.unwrap();
}

/// The migrations before projects.
async fn migrate_before_projects(connection: &mut Connection) {
    let mut migrations = migrator(connection.engine());
    let before = if connection.engine() == Engine::Sqlite { 21 } else { 1 };
    migrations.migrations.to_mut().retain(|migration| migration.version <= before);
    let done = match connection {
        Connection::Sqlite(connection) => migrations.run_direct(None, &mut **connection, false).await,
        Connection::Postgres(connection) => migrations.run_direct(None, &mut **connection, false).await,
        _ => panic!("a lent connection"),
    };
    done.unwrap();
}

async fn an_upgrade_puts_earlier_tokens_into_the_default_project(place: Place) {
    let mut connection: Connection = match &place.location {
        Location::File(path) => sqlite::connect(sqlite::options(path)).await.unwrap().0.into(),
        Location::Postgres(address) => address.connect().await.unwrap().0.into(),
    };
    migrate_before_projects(&mut connection).await;
    let rows = "
        INSERT INTO tokens (id, name, hash, scopes, created_at) VALUES 
            ('t', 'Ada', '0000000000000000000000000000000000000000000000000000000000000000', '[]', 0);
        INSERT INTO owners (id, token_id) VALUES (7, 't');
        INSERT INTO fair_share (priority, owner, queue_position, round) VALUES (0, 0, 5, 9), (0, 7, 5, 8);
        INSERT INTO scenarios (digest, body) VALUES ('d', '{}');
        INSERT INTO workers (id, name, solver_revision, backend, device, threads, registered_at, last_seen_at)
        VALUES ('w', 'w', 1, 'cpu', 'd', 1, 0, 0);
        INSERT INTO jobs (id, scenario_digest, seed, priority, owner, queue_position, labels, cache, submitted_at, attempt)
        VALUES ('01890000-0000-7000-8000-000000000000', 'd', 1, 0, 0, 6, '{}', 'use', 0, 0),
               ('01890000-0000-7000-8000-000000000001', 'd', 1, 0, 7, 6, '{}', 'use', 0, 1);
        INSERT INTO attempts (job_id, number, worker_id, request_id, outcome, claimed_at, ended_at)
        VALUES ('01890000-0000-7000-8000-000000000001', 1, 'w', 'r', 'lost', 0, 5400000)";
    raw_sql(rows).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    if let Location::File(_) = &place.location {
        // A server of the earlier version runs: the database stays as it is.
        let error = TokenFile::open(&place.location, false).await.err().expect("an older database");
        assert!(matches!(error, StoreError::Older { found: 21, known } if known > 21), "{error:?}");
        assert!(error.to_string().contains("restart the server"), "{error}");
    }

    let store = place.open().await;
    let token = store.tokens().await.unwrap().remove(0);
    assert_eq!((token.user.as_str(), token.project.as_str()), ("Ada", "default"));
    let projects = listed(&store).await;
    let view = &projects[0];
    assert_eq!((view.name.as_str(), view.share, view.budget_core_hours), ("default", 1, None));
    assert_eq!((view.used_core_hours, view.queued), (1.5, 2));
    // The owner that is a round behind is next, as before.
    let worker = register(&store).await;
    let owners = async || {
        let sql = "SELECT owner FROM jobs WHERE state = 'running'";
        query_scalar::<i64>(sql).fetch_all(&store.readers).await.unwrap()
    };
    let _ = store.claims.submit((claim_of(worker, 1), at(0))).await.unwrap();
    assert_eq!(owners().await, [7]);
    store.close().await;
}
