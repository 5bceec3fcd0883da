//! Tests of the numbers that triggers keep of observations.

use roost_api::ids::SweepId;

use super::super::observations::Observed;
use super::super::testing::{Place, on_both_engines};
use super::super::*;
use crate::store::database::{AssertSqlSafe, query_as, raw_sql};

on_both_engines!(numbers_of_observations_are_kept_through_every_change,);

/// A scan that counts what the triggers keep. Rows with the same values and seed are one run.
const SCAN: &str =
    "SELECT count(DISTINCT CASE WHEN source = 'asked' AND state = 'done' THEN levels || seed END),
    count(DISTINCT CASE WHEN source = 'asked' AND state = 'failed' THEN levels || seed END),
    count(*) FILTER (WHERE state = 'handed_out'), count(*) FILTER (WHERE source <> 'asked')
    FROM observations WHERE study_id = ?";

async fn execute(store: &Store, sql: String) {
    let write = store.writer.write(move |tx| {
        Box::pin(async move { Ok(raw_sql(AssertSqlSafe(sql)).execute(tx).await.map(drop)?) })
    });
    write.await.unwrap();
}

async fn numbers_of_observations_are_kept_through_every_change(place: Place) {
    let store = place.open().await;
    let (study, other) = (SweepId::new(), SweepId::new());
    let head = |id: SweepId| {
        format!(
            "INSERT INTO sweeps (id, name, spec, factors, labels, points, replicates, submitted_at)
             VALUES ('{id}', 's', '{{}}', '[]', '{{}}', 1, 1, 0);
             INSERT INTO studies (sweep_id, spec, question, max_runs) VALUES ('{id}', '{{}}', 'q', 9);"
        )
    };
    // Of ten rows, two are copies, two are runs of clients, and six were handed out.
    let rows = |id: SweepId, count: u32| {
        format!(
            "WITH RECURSIVE n (value) AS (SELECT 1 UNION ALL SELECT value + 1 FROM n WHERE value < {count}),
                  kinds AS (SELECT value, CASE WHEN value % 10 < 2 THEN 'sweep' WHEN value % 10 < 4 THEN 'client' ELSE 'asked' END AS source FROM n)
             INSERT INTO observations (study_id, number, source, state, origin, levels, replicate, seed, responses, expires_at)
             SELECT '{id}', value, source, CASE source WHEN 'asked' THEN 'handed_out' ELSE 'done' END, CASE source WHEN 'sweep' THEN 'o' END,
                    '{{}}', 0, CASE source WHEN 'asked' THEN value / 20 * 10 ELSE value END,
                    CASE WHEN source <> 'asked' THEN '{{}}' END, CASE source WHEN 'asked' THEN value END FROM kinds;"
        )
    };
    let end = |state: &str, digit: u32| {
        let responses = if state == "done" { "'{}'" } else { "NULL" };
        format!(
            "UPDATE observations SET state = '{state}', responses = {responses} WHERE study_id = '{study}' AND number % 10 = {digit};"
        )
    };
    let steps = [
        head(study) + &head(other) + &rows(study, 10_000) + &rows(other, 30),
        end("done", 4),
        end("failed", 5),
        end("expired", 6) + &end("given_back", 7),
        // Late outcomes of runs that had expired or were given back.
        end("done", 6) + &end("failed", 7),
    ];
    assert_eq!(store.observed(study).await.unwrap(), Observed::default());
    for (step, sql) in steps.into_iter().enumerate() {
        execute(&store, sql).await;
        for id in [study, other] {
            let (done, failed, handed_out, outside_budget) =
                query_as(SCAN).bind(id.to_string()).fetch_one(&store.readers).await.map(as_numbers).unwrap();
            let scanned = Observed { done, failed, handed_out, outside_budget };
            assert_eq!(store.observed(id).await.unwrap(), scanned, "step {step}");
        }
    }
    // Each twenty rows have one seed: their four rows with responses are one run, and so are their four failed ones.
    let last = Observed { done: 500, failed: 500, handed_out: 2000, outside_budget: 4000 };
    assert_eq!(store.observed(study).await.unwrap(), last);
    store.close().await;
}

fn as_numbers(row: (i64, i64, i64, i64)) -> (u64, u64, u64, u64) {
    (row.0.unsigned_abs(), row.1.unsigned_abs(), row.2.unsigned_abs(), row.3.unsigned_abs())
}
