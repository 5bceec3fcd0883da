//! Claims: order, needs, long polls, lost replies, concurrency.

use std::collections::HashSet;
use std::time::{Duration, Instant};

use reqwest::StatusCode;
use serde_json::{Value, json};

use super::test_server::*;

/// A sweep of replicates of one scenario from this seed on.
fn replicates(name: &str, seed: u64, count: u32) -> Value {
    json!({"name": name, "base": scenario(seed), "design": {"kind": "grid"}, "factors": [],
           "replicates": count, "cache": "bypass"})
}

fn seeds(attempts: &[Value]) -> Vec<u64> {
    attempts.iter().map(|attempt| attempt["scenario"]["seed"].as_u64().unwrap()).collect()
}

#[tokio::test]
async fn claims_go_by_priority_then_turns_then_design_point() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    server.post("/v1/sweeps", &replicates("a", 100, 4)).await.expect(StatusCode::CREATED);
    server.post("/v1/sweeps", &replicates("b", 200, 4)).await.expect(StatusCode::CREATED);
    let mut urgent = envelope(900);
    urgent["priority"] = json!(5);
    server.submit(&urgent).await;
    assert_eq!(seeds(&worker.claim(5).await), [900, 100, 200, 101, 201]);

    // A late sweep neither waits for earlier ones nor delays them.
    server.post("/v1/sweeps", &replicates("c", 300, 4)).await.expect(StatusCode::CREATED);
    assert_eq!(seeds(&worker.claim(64).await), [300, 102, 202, 301, 103, 203, 302, 303]);
    assert_eq!(worker.claim(64).await.len(), 0);
    server.stop().await;
}

#[tokio::test]
async fn retried_sweep_takes_turns_like_a_new_one() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let first = server.post("/v1/sweeps", &replicates("a", 100, 3)).await.expect(StatusCode::CREATED);
    for attempt in worker.claim(64).await {
        worker.fail(&attempt, "unstable", None).await.expect(StatusCode::OK);
    }
    server.post("/v1/sweeps", &replicates("b", 200, 4)).await.expect(StatusCode::CREATED);
    assert_eq!(seeds(&worker.claim(1).await), [200]);
    let path = format!("/v1/sweeps/{}/retry", text(&first["id"]));
    server.post(&path, &json!({})).await.expect(StatusCode::OK);
    assert_eq!(seeds(&worker.claim(64).await), [100, 101, 201, 102, 202, 203]);
    server.stop().await;
}

#[tokio::test]
async fn job_goes_to_a_worker_that_meets_its_needs() {
    let (server, _dir) = TestServer::start().await;
    let (cpu, gpu) = (server.worker("cpu").await, server.worker("gpu").await);
    let mut needy = envelope(1);
    needy["needs"] = json!({"backend": "gpu"});
    server.submit(&needy).await;
    assert_eq!(cpu.claim(1).await.len(), 0);
    assert_eq!(gpu.claim(1).await.len(), 1);
    server.stop().await;
}

#[tokio::test]
async fn repeated_claim_returns_the_same_attempts() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    for seed in 0..3 {
        server.submit(&envelope(seed)).await;
    }
    let request = worker.claim_request(2, 0.0);
    let claim = async || {
        let reply = server.post("/v1/claims", &request).await.expect(StatusCode::OK);
        let attempts = reply["attempts"].as_array().unwrap().iter();
        attempts.map(|attempt| (attempt["job_id"].clone(), attempt["attempt"].clone())).collect::<Vec<_>>()
    };
    let first = claim().await;
    assert_eq!(first.len(), 2);
    assert_eq!(claim().await, first);
    let third = worker.claim_one().await;
    assert!(first.iter().all(|(job, _)| *job != third["job_id"]), "another request, another job");

    let delivered = json!({"job_id": first[0].0, "attempt": 1, "scenario": third["scenario"]});
    worker.fail(&delivered, "released", None).await.expect(StatusCode::OK);
    assert_eq!(claim().await, first[1..], "ended jobs are not claimed again");
    server.stop().await;
}

#[tokio::test]
async fn waiting_claim_wakes_when_work_arrives() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    for wake in ["submit", "sweep", "release"] {
        let request = worker.claim_request(1, 30.0);
        let waiting = async {
            let reply = server.post("/v1/claims", &request).await.expect(StatusCode::OK);
            (Instant::now(), reply["attempts"][0].clone())
        };
        let other = server.worker("cpu").await;
        let held = match wake {
            "release" => {
                server.submit(&envelope(1)).await;
                Some(other.claim_one().await)
            }
            _ => None,
        };
        let waking = async {
            tokio::time::sleep(Duration::from_millis(200)).await;
            match wake {
                "submit" => drop(server.submit(&envelope(2)).await),
                "sweep" => {
                    let sweep = replicates("late", 3, 1);
                    server.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
                }
                _ => {
                    other.fail(held.as_ref().unwrap(), "released", None).await.expect(StatusCode::OK);
                }
            }
            Instant::now()
        };
        let ((claimed, attempt), woken) = tokio::join!(waiting, waking);
        assert!(attempt["job_id"].is_string(), "{wake}: {attempt}");
        let late = claimed.saturating_duration_since(woken);
        assert!(late < Duration::from_secs(15), "{wake}: woke {late:?} after the work was there");
    }
    server.stop().await;
}

#[tokio::test]
async fn claim_waits_as_requested_up_to_the_maximum() {
    let (server, _dir) = TestServer::with(|config| config.max_claim_wait = Duration::from_millis(600)).await;
    let worker = server.worker("cpu").await;
    for (asked, least, most) in [(0.0, 0, 20_000), (0.3, 300, 20_000), (60.0, 600, 20_000)] {
        let before = Instant::now();
        let reply = server.post("/v1/claims", &worker.claim_request(1, asked)).await.expect(StatusCode::OK);
        let waited = before.elapsed().as_millis();
        assert_eq!(reply["attempts"], json!([]));
        assert!((least..most).contains(&waited), "asked {asked} s, waited {waited} ms");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn concurrent_claims_never_get_the_same_job() {
    let (server, _dir) = TestServer::start().await;
    let sweep = server.post("/v1/sweeps", &replicates("many", 1, 200)).await.expect(StatusCode::CREATED);
    let server = std::sync::Arc::new(server);
    let claimers = (0..8).map(|claimer| {
        let server = server.clone();
        tokio::spawn(async move {
            let worker = server.worker("cpu").await;
            let mut jobs = Vec::new();
            loop {
                let attempts = worker.claim(1 + claimer % 3).await;
                if attempts.is_empty() {
                    return jobs;
                }
                for attempt in attempts {
                    worker.deliver(&attempt).await.expect(StatusCode::OK);
                    jobs.push(text(&attempt["job_id"]).to_owned());
                }
            }
        })
    });
    let mut jobs = Vec::new();
    for claimer in claimers.collect::<Vec<_>>() {
        jobs.extend(claimer.await.unwrap());
    }
    assert_eq!(jobs.len(), 200);
    assert_eq!(jobs.iter().collect::<HashSet<_>>().len(), 200);
    let view = server.get(&format!("/v1/sweeps/{}", text(&sweep["id"]))).await.expect(StatusCode::OK);
    assert_eq!(view["counts"]["succeeded"], 200);
}
