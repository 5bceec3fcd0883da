//! Tests of the migration that writes down the schema of stored bases.

use serde_json::{Value, json};

use super::super::testing::{Place, on_both_engines};
use crate::store::database::{AssertSqlSafe, Engine, query, query_scalar, raw_sql};

on_both_engines!(bases_without_a_schema_keep_that_of_their_time);

async fn bases_without_a_schema_keep_that_of_their_time(place: Place) {
    let store = place.open().await;
    let test = |name: &str, scenario: Value| json!({"name": name, "scenario": scenario, "measured": {}});
    let unstated = json!({"experiment": "hopper", "seed": 9_007_199_254_740_991_i64});
    let sweeps = [
        ("a", json!({"name": "a", "base": unstated})),
        ("d", json!({"name": "a\u{0}b", "base": unstated})),
        ("b", json!({"name": "b", "base": {"schema": "roost.scenario/1", "experiment": "hopper"}})),
        ("c", json!({"name": "c", "base": null})),
    ];
    let tests = [test("1", unstated.clone()), test("2", json!({"schema": "roost.scenario/1"}))];
    let calibration = json!({"name": "b", "base": tests[0]["scenario"], "goal": {"calibrate": {"measurements": {"tests": tests}}}});
    let studies =
        [("a", json!({"name": "a", "base": unstated, "goal": {"maximize": {}}})), ("b", calibration)];
    let migration = match store.readers.engine() {
        Engine::Sqlite => include_str!("../../../../migrations/0025_lattice_schema.sql"),
        Engine::Postgres => include_str!("../../../../migrations/postgres/0005_lattice_schema.sql"),
    };
    let (sweeps_before, studies_before) = (sweeps.clone(), studies.clone());
    let write = store.writer.write(move |tx| {
        Box::pin(async move {
            for (id, spec) in &sweeps_before {
                let sql =
                    "INSERT INTO sweeps (id, name, spec, factors, labels, points, replicates, submitted_at)
                           VALUES (?, 's', ?, '[]', '{}', 1, 1, 0)";
                query(sql).bind(*id).bind(spec.to_string()).execute(&mut *tx).await?;
            }
            for (id, spec) in &studies_before {
                let sql = "INSERT INTO studies (sweep_id, spec, question, max_runs) VALUES (?, ?, 'q', 9)";
                query(sql).bind(*id).bind(spec.to_string()).execute(&mut *tx).await?;
            }
            Ok(raw_sql(AssertSqlSafe(migration.to_owned())).execute(tx).await.map(drop)?)
        })
    });
    write.await.unwrap();
    let after = async |table: &str, key: &str, id: &str| -> Value {
        let sql = format!("SELECT spec FROM {table} WHERE {key} = ?");
        let text: String =
            query_scalar(AssertSqlSafe(sql)).bind(id.to_owned()).fetch_one(&store.readers).await.unwrap();
        serde_json::from_str(&text).unwrap()
    };
    let with_schema = |mut document: Value, pointer: &str| {
        document.pointer_mut(pointer).unwrap()["schema"] = json!("roost.scenario/2");
        document
    };
    assert_eq!(after("sweeps", "id", "a").await, with_schema(sweeps[0].1.clone(), "/base"));
    assert_eq!(after("sweeps", "id", "d").await["base"]["schema"], "roost.scenario/2");
    assert_eq!(after("sweeps", "id", "b").await, sweeps[2].1);
    assert_eq!(after("sweeps", "id", "c").await, sweeps[3].1);
    assert_eq!(after("studies", "sweep_id", "a").await, with_schema(studies[0].1.clone(), "/base"));
    let calibration = with_schema(studies[1].1.clone(), "/base");
    let first = "/goal/calibrate/measurements/tests/0/scenario";
    assert_eq!(after("studies", "sweep_id", "b").await, with_schema(calibration, first));
    store.close().await;
}
