//! Tests of retries of the jobs of a study.

use roost_api::ids::SweepId;
use roost_api::study::{StudyEnd, StudyState};
use roost_api::time::Timestamp;
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use serde_json::json;

use super::super::testing::{Place, on_both_engines};
use super::super::*;
use crate::store::database::{AssertSqlSafe, raw_sql};
use crate::study::{Decided, read};
use crate::sweep::SweepLimits;

on_both_engines!(a_retry_refuses_a_decision_from_older_rows);

const NOW: Timestamp = Timestamp(5);

async fn execute(store: &Store, sql: String) {
    let write = store.writer.write(move |tx| {
        Box::pin(async move { Ok(raw_sql(AssertSqlSafe(sql)).execute(tx).await.map(drop)?) })
    });
    write.await.unwrap();
}

/// A study with a budget of 9 runs, and with some queued jobs.
fn study_with_jobs(id: SweepId, jobs: usize) -> String {
    format!(
        "INSERT INTO sweeps (id, name, spec, factors, labels, points, replicates, submitted_at)
         VALUES ('{id}', 's', '{{}}', '[]', '{{}}', 1, 1, 0);
         INSERT INTO studies (sweep_id, spec, question, max_runs) VALUES ('{id}', '{{}}', 'q', 9);
         INSERT INTO design_points VALUES ('{id}', 0, '{{}}');
         INSERT INTO scenarios VALUES ('{id}', '{{}}');
         WITH RECURSIVE n (value) AS (SELECT 1 UNION ALL SELECT value + 1 FROM n WHERE value < {jobs})
         INSERT INTO jobs (id, sweep_id, point, replicate, scenario_digest, seed, priority, queue_position, labels, cache, submitted_at)
         SELECT '{id}-' || value, '{id}', 0, value, '{id}', value, 0, value, '{{}}', 'use', 0 FROM n;"
    )
}

/// Stores a decision that finishes a study. Returns false if the store refuses it.
async fn finish(store: &Store, stored: &StoredStudy) -> bool {
    let document = json!({
        "name": "s",
        "base": {"experiment": "hopper", "seed": 7, "product": {"count": 6, "subparticle_radius_m": 0.008}},
        "factors": [{"pointer": "/equipment/gate_opening_m", "low": 0.03, "high": 0.09}],
        "goal": {"boundary": {"of": {"probability": "jammed"}, "level": 0.05}}, "budget": {"max_runs": 60}});
    let limits = SweepLimits { max_jobs: 1000, scenario: Limits::NONE };
    let (study, _) = read(document, &Meshes::default(), limits).unwrap();
    let decided = study.decide(&[], &[], 0).unwrap();
    let decision = Decided { trials: Vec::new(), finished: Some(StudyEnd::ByBudget), ..decided };
    let asked = AskedRuns { request: None, runs: Vec::new(), expires_at: NOW };
    store.store_decision(stored, &study.sweep_spec(), decision, asked, NOW).await.unwrap().is_some()
}

async fn a_retry_refuses_a_decision_from_older_rows(place: Place) {
    let store = place.open().await;
    for (state, after) in [
        ("state = 'running'", StudyState::Running),
        ("state = 'paused'", StudyState::Paused),
        ("state = 'finished', finished = 'by_budget'", StudyState::Running),
        ("state = 'cancelled'", StudyState::Running),
    ] {
        let id = SweepId::new();
        let failed = format!(
            "UPDATE jobs SET state = 'failed', failure_class = 'unstable', ended_at = 1 WHERE sweep_id = '{id}';
             UPDATE studies SET {state} WHERE sweep_id = '{id}';"
        );
        execute(&store, study_with_jobs(id, 1) + &failed).await;
        let old = store.study(id).await.unwrap().unwrap();
        assert_eq!(store.retry_sweep(id, None).await.unwrap(), Ok(1));
        let new = store.study(id).await.unwrap().unwrap();
        assert_eq!((new.state, new.finished), (after, None), "{state}");
        // A user can pause and resume a study while the decision is made.
        store.change_study(id, &[StudyState::Paused], StudyState::Running, None).await.unwrap();
        assert!(!finish(&store, &old).await, "{state}: the old rows have no queued job");
        assert_eq!(store.study_counts(id).await.unwrap().0.queued, 1, "{state}");
        assert!(finish(&store, &new).await, "{state}: nothing has changed since");
    }
    store.close().await;
}
