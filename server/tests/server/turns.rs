//! Turns between owners, whatever the number of their sweeps.

use std::collections::BTreeMap;

use reqwest::Method;
use roost_api::time::Timestamp;
use roost_api::token::Scope;
use serde_json::{Value, json};

use super::database;
use super::test_server::*;

/// A server with two submit tokens and one worker token.
struct Shared {
    server: TestServer,
    a: String,
    b: String,
    workers: String,
    worker: String,
    _dir: tempfile::TempDir,
}

impl Shared {
    async fn start() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let mut tokens = database::tokens(dir.path(), true).await.unwrap();
        let mut secrets = Vec::new();
        for scope in [Scope::Submit, Scope::Submit, Scope::Worker] {
            secrets.push(tokens.create("t", &[scope], Timestamp::now()).await.unwrap().1);
        }
        tokens.close().await.unwrap();
        let server = TestServer::on(dir.path(), |_| {}).await;
        let worker = roost_api::ids::WorkerId::new().to_string();
        let (workers, b, a) = (secrets.pop().unwrap(), secrets.pop().unwrap(), secrets.pop().unwrap());
        let shared = Self { server, a, b, workers, worker, _dir: dir };
        shared.send(&shared.workers, "/v1/workers", &registration(&shared.worker, "cpu")).await;
        shared
    }

    async fn send(&self, secret: &str, path: &str, body: &Value) -> Value {
        let request = self.server.http.request(Method::POST, format!("http://{}{path}", self.server.address));
        let response = request.bearer_auth(secret).json(body).send().await.unwrap();
        assert!(response.status().is_success(), "{path}: {}", response.text().await.unwrap());
        response.json().await.unwrap_or_default()
    }

    /// Submits a sweep with seeds from this one on, which identify the owner.
    async fn sweep(&self, secret: &str, seed: u64, jobs: u64) -> Value {
        let sweep = json!({"name": "s", "base": scenario(seed), "design": {"kind": "grid"}, "factors": [],
                           "replicates": jobs, "cache": "bypass"});
        self.send(secret, "/v1/sweeps", &sweep).await
    }

    /// The seeds of a claim, in thousands.
    async fn claim(&self, max_jobs: u64) -> Vec<u64> {
        let request = json!({"request_id": uuid::Uuid::now_v7(), "worker_id": self.worker, "max_jobs": max_jobs,
                             "wait_s": 0.0});
        let reply = self.send(&self.workers, "/v1/claims", &request).await;
        let attempts = reply["attempts"].as_array().unwrap();
        attempts.iter().map(|attempt| attempt["scenario"]["seed"].as_u64().unwrap() / 10_000).collect()
    }
}

fn counts(claimed: &[u64]) -> BTreeMap<u64, usize> {
    let mut counts = BTreeMap::new();
    for whose in claimed {
        *counts.entry(*whose).or_default() += 1;
    }
    counts
}

#[tokio::test]
async fn owners_share_workers_evenly_whatever_their_sweeps() {
    let shared = Shared::start().await;
    shared.sweep(&shared.a, 10_000, 2000).await;
    for number in 0..20 {
        shared.sweep(&shared.b, 20_000 + 50 * number, 50).await;
    }
    // One job per claim, a few, and the maximum.
    let mut claimed = Vec::new();
    for max_jobs in [1; 40].into_iter().chain([3; 10]).chain([64, 64, 2]) {
        claimed.extend(shared.claim(max_jobs).await);
    }
    let counts = counts(&claimed);
    assert_eq!(claimed.len(), 200);
    assert!((90..=110).contains(&counts[&1]), "of 200 claims: {counts:?}");
    shared.server.stop().await;
}

#[tokio::test]
async fn late_owner_neither_waits_nor_catches_up() {
    let shared = Shared::start().await;
    shared.sweep(&shared.a, 10_000, 500).await;
    assert_eq!(counts(&shared.claim(64).await), BTreeMap::from([(1, 64)]));
    shared.sweep(&shared.b, 20_000, 500).await;
    assert_eq!(counts(&shared.claim(2).await), BTreeMap::from([(1, 1), (2, 1)]), "no waiting");
    assert_eq!(counts(&shared.claim(20).await), BTreeMap::from([(1, 10), (2, 10)]), "nor catching up");
    // Single jobs get no more turns than jobs of a sweep.
    let mut claimed = Vec::new();
    for seed in 0..20 {
        let job = json!({"scenario": scenario(20_900 + seed), "cache": "bypass"});
        shared.send(&shared.b, "/v1/jobs", &job).await;
        claimed.extend(shared.claim(1).await);
    }
    assert_eq!(counts(&claimed), BTreeMap::from([(1, 10), (2, 10)]));
    shared.server.stop().await;
}

#[tokio::test]
async fn retried_and_added_jobs_take_turns_of_their_owner() {
    let shared = Shared::start().await;
    let retried = shared.sweep(&shared.b, 20_000, 30).await;
    let path = |verb: &str| format!("/v1/sweeps/{}/{verb}", text(&retried["id"]));
    shared.send(&shared.b, &path("cancel"), &json!({})).await;
    let added = shared.sweep(&shared.b, 20_100, 5).await;
    shared.sweep(&shared.a, 10_000, 200).await;
    assert_eq!(counts(&shared.claim(10).await), BTreeMap::from([(1, 5), (2, 5)]));
    // A retry by another token does not change the owner.
    shared.send(&shared.a, &path("retry"), &json!({})).await;
    assert_eq!(counts(&shared.claim(20).await), BTreeMap::from([(1, 10), (2, 10)]));
    let extend = format!("/v1/sweeps/{}/extend", text(&added["id"]));
    // An extension takes turns of the token that extends.
    shared.send(&shared.a, &extend, &json!({"replicates": 10})).await;
    assert_eq!(counts(&shared.claim(20).await), BTreeMap::from([(1, 5), (2, 15)]));
    shared.server.stop().await;
}
