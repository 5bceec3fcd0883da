//! The end of a worker during a slow upload of frames.

use std::sync::{Arc, Mutex};

use roost_api::ids::JobId;
use serde_json::json;

use super::*;
use crate::client::tests::answering_after;

/// Runs a worker with one short job whose upload of frames takes this long. The server asks it to drain, or a signal stops it during the
/// upload. Returns the answered requests in order and the number of deliveries left in the outbox.
async fn last_run(upload: Duration, by_signal: bool) -> (Vec<&'static str>, usize) {
    let shutdown = CancellationToken::new();
    let answered: Arc<Mutex<Vec<&'static str>>> = Arc::default();
    let (seen, signal, job) = (answered.clone(), shutdown.clone(), JobId::new());
    let server = answering_after("application/json", move |request| {
        let line = request.lines().next().unwrap_or_default();
        let mut seen = seen.lock().unwrap();
        let (what, body, time) = if line.contains("/heartbeat") {
            ("beat", json!({"drain": !by_signal, "attempts": []}), Duration::ZERO)
        } else if line.contains("/v1/claims") && !seen.contains(&"claim") {
            let scenario = json!({
                "experiment": "hopper",
                "product": {"count": 1, "subparticle_radius_m": 0.009},
                "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
                "numerics": {"timestep_s": "auto", "duration_s": 0.05},
            });
            let frames = json!({"interval_s": 0.02, "limit_bytes": 1_000_000});
            let attempt = json!({"job_id": job, "attempt": 1, "scenario": scenario, "frames": frames,
                                 "lease_expires_at": "2030-01-01T00:00:00Z"});
            ("claim", json!({"attempts": [attempt]}), Duration::ZERO)
        } else if line.contains("/v1/claims") {
            ("nothing", json!({"attempts": []}), Duration::from_millis(50))
        } else if line.contains("/frames") {
            if by_signal {
                signal.cancel();
            }
            ("frames", json!({}), upload)
        } else if line.contains("/result") {
            ("result", json!({}), Duration::ZERO)
        } else {
            ("welcome", json!({"heartbeat_s": 0.1, "lease_s": 3.0}), Duration::ZERO)
        };
        seen.push(what);
        (time, ("200 OK".to_owned(), body.to_string()))
    })
    .await;
    let folder = tempfile::tempdir().unwrap();
    let config = WorkerConfig { threads: 1, ..WorkerConfig::new(&server, "worker", folder.path()) };
    tokio::time::timeout(Duration::from_secs(60), work(config, shutdown)).await.expect("it ends").unwrap();
    let left = crate::outbox::Outbox::open(folder.path(), &server).unwrap().waiting().unwrap().len();
    (std::mem::take(&mut answered.lock().unwrap()), left)
}

#[tokio::test]
async fn draining_worker_sends_frames_and_heartbeats_until_its_result_is_recorded() {
    let (answered, left) = last_run(LAST_DELIVERIES + Duration::from_secs(1), false).await;
    assert_eq!(left, 0, "{answered:?}");
    assert_eq!(answered.iter().filter(|what| **what == "frames").count(), 1, "one complete upload");
    let at = |what| {
        answered.iter().position(|seen| *seen == what).unwrap_or_else(|| panic!("no {what}: {answered:?}"))
    };
    let beats = answered[at("frames")..at("result")].iter().filter(|what| **what == "beat").count();
    assert!(beats >= 3, "{beats} beats in seven seconds: the lease would end");
}

#[tokio::test]
async fn a_stopped_worker_delivers_its_result_without_frames() {
    let (answered, left) = last_run(Duration::from_secs(600), true).await;
    // A heartbeat may follow, since it goes on until the worker ends.
    let last = answered.iter().rfind(|what| **what != "beat");
    assert_eq!((left, last), (0, Some(&"result")), "{answered:?}");
}
