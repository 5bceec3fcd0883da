//! Upgrades: a database of an earlier version gives the same answers, and its jobs continue.
//!
//! `server/testdata/upgrade/` has databases as SQL with the answers of their version; `make.py` there made
//! them.

use std::path::Path;

use reqwest::StatusCode;
use serde_json::{Map, Value, json};
use sqlx::Connection;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};

use super::database;
use super::test_server::*;

/// Version, database, answers.
const STORED: [(&str, &str, &str); 1] = [(
    "0.1.0",
    include_str!("../../testdata/upgrade/0.1.0.sql"),
    include_str!("../../testdata/upgrade/0.1.0.json"),
)];

/// Writes a stored database to a data directory.
async fn restore(data: &Path, sql: &'static str) {
    let file = SqliteConnectOptions::new().filename(data.join("roost.db")).create_if_missing(true);
    let mut database = SqliteConnection::connect_with(&file.foreign_keys(false)).await.unwrap();
    sqlx::raw_sql(sql).execute(&mut database).await.unwrap();
    database.close().await.unwrap();
}

/// Differences between an answer and a recorded one; new fields are allowed.
fn differences(recorded: &Value, now: &Value, at: &str) -> Vec<String> {
    match (recorded, now) {
        (Value::Object(recorded), Value::Object(now)) => {
            let missing = Value::Null;
            let field = |(name, value): (&String, &Value)| {
                differences(value, now.get(name).unwrap_or(&missing), &format!("{at}/{name}"))
            };
            recorded.iter().flat_map(field).collect()
        }
        (Value::Array(recorded), Value::Array(now)) if recorded.len() == now.len() => {
            let rows = recorded.iter().zip(now).enumerate();
            rows.flat_map(|(index, (recorded, now))| differences(recorded, now, &format!("{at}/{index}")))
                .collect()
        }
        _ if recorded == now => Vec::new(),
        _ => vec![format!("{at}: {recorded} has become {now}")],
    }
}

#[test]
fn differences_between_answers_are_listed_by_pointer() {
    let recorded = json!({"a": [1, {"b": null}], "c": "x"});
    assert_eq!(differences(&recorded, &json!({"a": [1, {"b": null, "new": 1}], "c": "x"}), ""), [""; 0]);
    let now = json!({"a": [2, {"b": 1}]});
    assert_eq!(
        differences(&recorded, &now, ""),
        ["/a/0: 1 has become 2", "/a/1/b: null has become 1", "/c: \"x\" has become null"]
    );
    assert_eq!(differences(&recorded, &json!({"a": [1], "c": "x"}), "").len(), 1);
}

#[tokio::test]
async fn old_database_gives_the_answers_of_its_version() {
    for (version, sql, answers) in STORED {
        let dir = tempfile::tempdir().unwrap();
        restore(dir.path(), sql).await;
        database::take_from_file(dir.path()).await;
        let server = TestServer::on(dir.path(), |_| {}).await;
        let answers: Map<String, Value> = serde_json::from_str(answers).unwrap();
        assert!(answers.len() > 40, "{}", answers.len());
        for (path, recorded) in &answers {
            if path.ends_with("/result") {
                let result = roost_api::RunResult::from_value(recorded.clone()).expect(path);
                assert_eq!(result.scenario.schema, roost_solver::scenario::SCHEMA, "{version}");
            }
            let now = server.get(path).await.expect(StatusCode::OK);
            // Workers with an older solver get no more jobs.
            let is_drained = |text: &String| {
                text.starts_with("/v1/workers/") && text.ends_with("/draining: false has become true")
            };
            let mut found = differences(recorded, &now, path);
            found.retain(|text| !is_drained(text));
            assert_eq!(found, [""; 0], "{version}");
        }
        server.stop().await;
    }
}

#[tokio::test]
async fn jobs_of_an_old_database_continue() {
    for (version, sql, answers) in STORED {
        let dir = tempfile::tempdir().unwrap();
        restore(dir.path(), sql).await;
        database::take_from_file(dir.path()).await;
        let server = TestServer::on(dir.path(), |_| {}).await;
        let answers: Map<String, Value> = serde_json::from_str(answers).unwrap();
        let jobs = answers["/v1/jobs?limit=500"]["items"].as_array().unwrap();
        let waiting: Vec<_> = jobs.iter().filter(|job| job["state"] == "queued").collect();
        // In the order of priority: a sweep of three points, then a single job.
        let registration = registration(&roost_api::ids::WorkerId::new().to_string(), "cpu");
        let mut registration = registration;
        registration["memory_mib"] = json!(4096);
        let worker = server.register(&registration).await;
        let claimed = worker.claim(8).await;
        assert_eq!(claimed.len(), waiting.len(), "{version}");
        let priorities: Vec<_> = claimed
            .iter()
            .map(|attempt| {
                waiting.iter().find(|job| job["id"] == attempt["job_id"]).unwrap()["priority"]
                    .as_i64()
                    .unwrap()
            })
            .collect();
        assert_eq!(priorities, [3, 3, 3, -2], "{version}");
        for attempt in &claimed {
            worker.deliver(attempt).await.expect(StatusCode::OK);
            assert_eq!(server.job(&attempt["job_id"]).await["state"], "succeeded", "{version}");
        }
        // An extended sweep can be extended again and counts its queued jobs.
        let sweep =
            answers["/v1/sweeps"]["items"].as_array().unwrap().iter().find(|it| it["name"] == "gate by belt");
        let sweep = text(&sweep.unwrap()["id"]);
        let more = server.post(&format!("/v1/sweeps/{sweep}/extend"), &json!({"replicates": 1})).await;
        assert!(more.status < 300, "{version}: {}", more.text);
        assert_eq!(worker.claim(8).await.len(), 2, "{version}");
        // New points keep the schema of the base: the stiffness of bonds has no reference radius there.
        let levels = json!({"levels": {"/equipment/gate_opening_m": [0.071]}});
        server.post(&format!("/v1/sweeps/{sweep}/extend"), &levels).await.expect(StatusCode::OK);
        let added = worker.claim(8).await;
        assert_eq!(added.len(), 6, "{version}");
        for attempt in &added {
            assert_eq!(attempt["scenario"]["bonds"]["reference_radius_m"], Value::Null, "{version}");
        }
        server.stop().await;
    }
}
