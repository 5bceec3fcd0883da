//! References between rows. PostgreSQL does not check those that claims and results write.

use roost_solver::SOLVER_REVISION;

use super::super::testing::DANGLING;
use super::projects::{at, claim, register, submit, succeed, with_projects};
use super::*;
use crate::queue::{Provenance, RetryPolicy};

on_both_engines!(a_deletion_leaves_no_row_that_refers_to_a_missing_one);

async fn a_deletion_leaves_no_row_that_refers_to_a_missing_one(place: Place) {
    let (store, tokens) = with_projects(&place, &[("p", 1, 1)]).await;
    let (first, second) = (register(&store).await, register(&store).await);
    let count = async |sql: &'static str| query_scalar::<i64>(sql).fetch_one(&store.readers).await.unwrap();
    let gone = submit(&store, &tokens[0][0], 2).await;
    let (won, lost) = (claim(&store, first, 1, at(0)).await[0], claim(&store, second, 1, at(0)).await[0]);
    submit(&store, &tokens[0][0], 1).await;
    let kept = claim(&store, first, 1, at(0)).await[0];
    for attempt in [won, kept] {
        succeed(&store, first, attempt, 1).await;
    }
    let provenance = Provenance {
        scenario: store.job(lost.0).await.unwrap().unwrap().scenario_digest,
        revision: SOLVER_REVISION,
        backend: "cpu".to_owned(),
        device: "a".to_owned(),
    };
    let partial = Some(EncodedResult::sample(provenance, "partial"));
    let (outcome, policy) = (AttemptOutcome::Unstable, RetryPolicy::default());
    let failed =
        store.record_failure(lost.0, lost.1, second, outcome, "m".to_owned(), partial, policy, at(1)).await;
    failed.unwrap().unwrap();
    assert_eq!((count("SELECT count(*) FROM documents").await, count(DANGLING).await), (3, 0));

    assert!(store.delete_sweep(gone, Timestamp(2)).await.unwrap());
    assert_eq!(store.forget_workers(Timestamp(10)).await.unwrap(), 1, "the second has no attempt any more");
    assert_eq!((count("SELECT count(*) FROM documents").await, count(DANGLING).await), (1, 0));
    store.close().await;
}
