//! Turns between those who submit: by their tokens, whatever number of sweeps they make.

use std::collections::BTreeMap;

use reqwest::Method;
use roost_api::time::Timestamp;
use roost_api::token::Scope;
use roost_server::tokens_in;
use serde_json::{Value, json};

use super::farm::*;

/// A server with tokens for two who submit and one for workers.
struct Shared {
    farm: Farm,
    a: String,
    b: String,
    workers: String,
    worker: String,
    _dir: tempfile::TempDir,
}

impl Shared {
    async fn start() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let mut tokens = tokens_in(dir.path(), true).await.unwrap();
        let mut secrets = Vec::new();
        for scope in [Scope::Submit, Scope::Submit, Scope::Worker] {
            secrets.push(tokens.create("t", &[scope], Timestamp::now()).await.unwrap().1);
        }
        tokens.close().await.unwrap();
        let farm = Farm::on(dir.path(), |_| {}).await;
        let worker = roost_api::ids::WorkerId::new().to_string();
        let (workers, b, a) = (secrets.pop().unwrap(), secrets.pop().unwrap(), secrets.pop().unwrap());
        let shared = Self { farm, a, b, workers, worker, _dir: dir };
        shared.send(&shared.workers, "/v1/workers", &registration(&shared.worker, "cpu")).await;
        shared
    }

    async fn send(&self, secret: &str, path: &str, body: &Value) -> Value {
        let request = self.farm.http.request(Method::POST, format!("http://{}{path}", self.farm.address));
        let response = request.bearer_auth(secret).json(body).send().await.unwrap();
        assert!(response.status().is_success(), "{path}: {}", response.text().await.unwrap());
        response.json().await.unwrap_or_default()
    }

    /// Seeds from that one on: they say whose job it is.
    async fn sweep(&self, secret: &str, seed: u64, jobs: u64) -> Value {
        let sweep = json!({"name": "s", "base": scenario(seed), "design": {"kind": "grid"}, "factors": [],
                           "replicates": jobs, "cache": "bypass"});
        self.send(secret, "/v1/sweeps", &sweep).await
    }

    /// Thousands of the seeds that a claim got.
    async fn claim(&self, max_jobs: u64) -> Vec<u64> {
        let request = json!({"request_id": uuid::Uuid::now_v7(), "worker_id": self.worker, "max_jobs": max_jobs,
                             "wait_s": 0.0});
        let reply = self.send(&self.workers, "/v1/claims", &request).await;
        let attempts = reply["attempts"].as_array().unwrap();
        attempts.iter().map(|attempt| attempt["scenario"]["seed"].as_u64().unwrap() / 10_000).collect()
    }
}

fn counted(claimed: &[u64]) -> BTreeMap<u64, usize> {
    let mut counts = BTreeMap::new();
    for whose in claimed {
        *counts.entry(*whose).or_default() += 1;
    }
    counts
}

#[tokio::test]
async fn one_large_sweep_and_twenty_small_ones_share_the_workers_evenly() {
    let shared = Shared::start().await;
    shared.sweep(&shared.a, 10_000, 2000).await;
    for number in 0..20 {
        shared.sweep(&shared.b, 20_000 + 50 * number, 50).await;
    }
    // One by one, a few, and as many as a claim may take.
    let mut claimed = Vec::new();
    for max_jobs in [1; 40].into_iter().chain([3; 10]).chain([64, 64, 2]) {
        claimed.extend(shared.claim(max_jobs).await);
    }
    let counts = counted(&claimed);
    assert_eq!(claimed.len(), 200);
    assert!((90..=110).contains(&counts[&1]), "of 200 claims: {counts:?}");
    shared.farm.stop().await;
}

#[tokio::test]
async fn who_comes_late_neither_waits_nor_is_paid_back() {
    let shared = Shared::start().await;
    shared.sweep(&shared.a, 10_000, 500).await;
    assert_eq!(counted(&shared.claim(64).await), BTreeMap::from([(1, 64)]));
    shared.sweep(&shared.b, 20_000, 500).await;
    assert_eq!(counted(&shared.claim(2).await), BTreeMap::from([(1, 1), (2, 1)]), "no waiting");
    assert_eq!(counted(&shared.claim(20).await), BTreeMap::from([(1, 10), (2, 10)]), "nor paying back");
    // Jobs that come one at a time take no more turns than those of a sweep.
    let mut claimed = Vec::new();
    for seed in 0..20 {
        let job = json!({"scenario": scenario(20_900 + seed), "cache": "bypass"});
        shared.send(&shared.b, "/v1/jobs", &job).await;
        claimed.extend(shared.claim(1).await);
    }
    assert_eq!(counted(&claimed), BTreeMap::from([(1, 10), (2, 10)]));
    shared.farm.stop().await;
}

#[tokio::test]
async fn what_is_retried_or_added_takes_turns_of_its_owner() {
    let shared = Shared::start().await;
    let retried = shared.sweep(&shared.b, 20_000, 30).await;
    let path = |verb: &str| format!("/v1/sweeps/{}/{verb}", text(&retried["id"]));
    shared.send(&shared.b, &path("cancel"), &json!({})).await;
    let added = shared.sweep(&shared.b, 20_100, 5).await;
    shared.sweep(&shared.a, 10_000, 200).await;
    assert_eq!(counted(&shared.claim(10).await), BTreeMap::from([(1, 5), (2, 5)]));
    // By whoever asks for it: the jobs are the owner's.
    shared.send(&shared.a, &path("retry"), &json!({})).await;
    assert_eq!(counted(&shared.claim(20).await), BTreeMap::from([(1, 10), (2, 10)]));
    let extend = format!("/v1/sweeps/{}/extend", text(&added["id"]));
    // More of another's sweep are turns of who asks for more.
    shared.send(&shared.a, &extend, &json!({"replicates": 10})).await;
    assert_eq!(counted(&shared.claim(20).await), BTreeMap::from([(1, 5), (2, 15)]));
    shared.farm.stop().await;
}
