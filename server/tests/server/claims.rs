//! Claims: order, needs, long polls, lost replies, and many at once.

use std::collections::HashSet;
use std::time::{Duration, Instant};

use reqwest::StatusCode;
use serde_json::{Value, json};

use super::farm::*;

/// A sweep of so many replicates of one scenario, from that seed on.
fn replicates(name: &str, seed: u64, count: u32) -> Value {
    json!({"name": name, "base": scenario(seed), "design": {"kind": "grid"}, "factors": [],
           "replicates": count, "cache": "bypass"})
}

fn seeds(attempts: &[Value]) -> Vec<u64> {
    attempts.iter().map(|attempt| attempt["scenario"]["seed"].as_u64().unwrap()).collect()
}

#[tokio::test]
async fn priority_comes_first_then_sweeps_take_turns_then_the_design_index() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    farm.post("/v1/sweeps", &replicates("a", 100, 4)).await.expect(StatusCode::CREATED);
    farm.post("/v1/sweeps", &replicates("b", 200, 4)).await.expect(StatusCode::CREATED);
    let mut urgent = envelope(900);
    urgent["priority"] = json!(5);
    farm.submit(&urgent).await;
    assert_eq!(seeds(&worker.claim(5).await), [900, 100, 200, 101, 201]);

    // A late sweep neither waits for those before it nor pushes them aside.
    farm.post("/v1/sweeps", &replicates("c", 300, 4)).await.expect(StatusCode::CREATED);
    assert_eq!(seeds(&worker.claim(64).await), [300, 102, 202, 301, 103, 203, 302, 303]);
    assert_eq!(worker.claim(64).await.len(), 0);
    farm.stop().await;
}

#[tokio::test]
async fn a_retried_sweep_takes_turns_like_a_new_one() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    let first = farm.post("/v1/sweeps", &replicates("a", 100, 3)).await.expect(StatusCode::CREATED);
    for attempt in worker.claim(64).await {
        worker.fail(&attempt, "unstable", None).await.expect(StatusCode::OK);
    }
    farm.post("/v1/sweeps", &replicates("b", 200, 4)).await.expect(StatusCode::CREATED);
    assert_eq!(seeds(&worker.claim(1).await), [200]);
    let path = format!("/v1/sweeps/{}/retry", text(&first["id"]));
    farm.post(&path, &json!({})).await.expect(StatusCode::OK);
    assert_eq!(seeds(&worker.claim(64).await), [100, 101, 201, 102, 202, 203]);
    farm.stop().await;
}

#[tokio::test]
async fn a_job_goes_to_a_worker_that_has_what_it_needs() {
    let (farm, _dir) = Farm::start().await;
    let (cpu, gpu) = (farm.worker("cpu").await, farm.worker("gpu").await);
    let mut needy = envelope(1);
    needy["needs"] = json!({"backend": "gpu"});
    farm.submit(&needy).await;
    assert_eq!(cpu.claim(1).await.len(), 0);
    assert_eq!(gpu.claim(1).await.len(), 1);
    farm.stop().await;
}

#[tokio::test]
async fn a_repeated_claim_returns_the_same_attempts() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    for seed in 0..3 {
        farm.submit(&envelope(seed)).await;
    }
    let request = worker.claim_request(2, 0.0);
    let claim = async || {
        let reply = farm.post("/v1/claims", &request).await.expect(StatusCode::OK);
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
    assert_eq!(claim().await, first[1..], "what has ended is not handed out again");
    farm.stop().await;
}

#[tokio::test]
async fn a_waiting_claim_wakes_when_work_arrives() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    for wake in ["submit", "sweep", "release"] {
        let request = worker.claim_request(1, 30.0);
        let waiting = async {
            let reply = farm.post("/v1/claims", &request).await.expect(StatusCode::OK);
            (Instant::now(), reply["attempts"][0].clone())
        };
        let other = farm.worker("cpu").await;
        let held = match wake {
            "release" => {
                farm.submit(&envelope(1)).await;
                Some(other.claim_one().await)
            }
            _ => None,
        };
        let waking = async {
            tokio::time::sleep(Duration::from_millis(200)).await;
            match wake {
                "submit" => drop(farm.submit(&envelope(2)).await),
                "sweep" => {
                    let sweep = replicates("late", 3, 1);
                    farm.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
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
        assert!(late < Duration::from_secs(5), "{wake}: woke {late:?} after the work was there");
    }
    farm.stop().await;
}

#[tokio::test]
async fn a_claim_waits_as_long_as_asked_and_no_longer_than_allowed() {
    let (farm, _dir) = Farm::with(|config| config.max_claim_wait = Duration::from_millis(600)).await;
    let worker = farm.worker("cpu").await;
    for (asked, least, most) in [(0.0, 0, 5000), (0.3, 300, 5000), (60.0, 600, 5000)] {
        let before = Instant::now();
        let reply = farm.post("/v1/claims", &worker.claim_request(1, asked)).await.expect(StatusCode::OK);
        let waited = before.elapsed().as_millis();
        assert_eq!(reply["attempts"], json!([]));
        assert!((least..most).contains(&waited), "asked {asked} s, waited {waited} ms");
    }
    farm.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn eight_claimers_of_two_hundred_jobs_never_get_the_same_one() {
    let (farm, _dir) = Farm::start().await;
    let sweep = farm.post("/v1/sweeps", &replicates("many", 1, 200)).await.expect(StatusCode::CREATED);
    let farm = std::sync::Arc::new(farm);
    let claimers = (0..8).map(|claimer| {
        let farm = farm.clone();
        tokio::spawn(async move {
            let worker = farm.worker("cpu").await;
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
    let view = farm.get(&format!("/v1/sweeps/{}", text(&sweep["id"]))).await.expect(StatusCode::OK);
    assert_eq!(view["counts"]["succeeded"], 200);
}
