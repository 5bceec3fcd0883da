//! Uploads and downloads of checkpoints, against a server that cuts, refuses or delays them.

use roost_api::ids::JobId;
use roost_solver::mesh::Meshes;
use roost_solver::{CpuOptions, Flow, Limits, Moment, Observer, Progress, check, scenario, simulate};
use serde_json::json;
use std::sync::Mutex;
use std::time::Instant;
use tokio_util::sync::CancellationToken;

use super::*;
use crate::WorkerConfig;
use crate::client::digest;
use crate::client::tests::answering_after;
use crate::stop::Stop;

/// Takes the first checkpoint of a run and stops it.
#[derive(Default)]
struct Keeper(Option<Checkpoint>);

impl Observer for Keeper {
    fn progress(&mut self, _progress: &Progress) -> Flow {
        Flow::Cancel
    }

    fn wants_checkpoint(&mut self, moment: Moment) -> bool {
        moment == Moment::Step
    }

    fn checkpoint(&mut self, checkpoint: Checkpoint) {
        self.0 = Some(checkpoint);
    }
}

fn checkpoint() -> Checkpoint {
    let document = json!({
        "experiment": "hopper",
        "product": {"count": 1, "subparticle_radius_m": 0.009},
        "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
        "numerics": {"timestep_s": "auto", "duration_s": 0.05},
    });
    let scenario = scenario::from_value(&document).unwrap();
    let checked = check(&scenario, &Meshes::default(), &Limits::NONE).unwrap();
    let mut keeper = Keeper::default();
    simulate(&checked, CpuOptions { threads: 1 }, &mut keeper);
    keeper.0.expect("a run of more than one step")
}

const KEY: fn() -> AttemptKey = || (JobId::new(), 1);
const ORDER: CheckpointOrder = CheckpointOrder { interval_s: 300.0, limit_bytes: 1 << 30 };

fn session(server: &str) -> (Arc<Session>, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let config = WorkerConfig::new(server, "worker", folder.path());
    (Arc::new(Session::open(config, &CancellationToken::new()).unwrap()), folder)
}

/// A server that takes a whole checkpoint, after answers of its own to the first requests. Returns its address, and the offsets of
/// the requests that it has answered.
async fn server(first: Vec<(Duration, &'static str, String)>) -> (String, Arc<Mutex<Vec<String>>>) {
    let seen: Arc<Mutex<Vec<String>>> = Arc::default();
    let (requests, number) = (seen.clone(), Arc::new(Mutex::new(0)));
    let address = answering_after("application/json", move |request| {
        let line = request.lines().next().unwrap_or_default().to_owned();
        let value = |name: &str| {
            let rest = line.split(&format!("{name}=")).nth(1).unwrap_or_default();
            rest.split(['&', ' ']).next().unwrap_or_default().to_owned()
        };
        requests.lock().unwrap().push(format!("{} {}", line.split(' ').next().unwrap(), value("offset")));
        let mut number = number.lock().unwrap();
        *number += 1;
        match first.get(*number - 1) {
            Some((time, status, body)) => (*time, ((*status).to_owned(), body.clone())),
            None => {
                let body = format!(r#"{{"received": {}, "recorded": true}}"#, value("bytes"));
                (Duration::ZERO, ("200 OK".to_owned(), body))
            }
        }
    })
    .await;
    (address, seen)
}

fn receipt(received: u64) -> (Duration, &'static str, String) {
    (Duration::ZERO, "200 OK", format!(r#"{{"received": {received}, "recorded": false}}"#))
}

fn problem(status: &'static str) -> (Duration, &'static str, String) {
    let code = &status[..3];
    (Duration::ZERO, status, format!(r#"{{"type":"/problems/x","title":"x","status":{code},"detail":"no"}}"#))
}

#[tokio::test]
async fn upload_resumes_at_the_offset_of_the_server() {
    let first = vec![receipt(100), problem("503 Service Unavailable"), receipt(0), receipt(70)];
    let (address, seen) = server(first).await;
    let (session, _folder) = session(&address);
    let uploader = Uploader::start(session, KEY(), ORDER);
    uploader.slot().put(checkpoint());
    assert!(uploader.finish().await, "{seen:?}");
    // After 503 the same part again; after the restart of the server from its beginning.
    assert_eq!(*seen.lock().unwrap(), ["put 0", "put 100", "put 100", "put 0", "put 70"]);
}

#[tokio::test]
async fn a_failed_upload_is_followed_by_the_next_checkpoint() {
    let (address, seen) = server(vec![problem("507 Insufficient Storage"); 5]).await;
    let (session, _folder) = session(&address);
    let uploader = Uploader::start(session, KEY(), ORDER);
    uploader.slot().put(checkpoint());
    while seen.lock().unwrap().len() < 5 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    uploader.slot().put(checkpoint());
    assert!(uploader.finish().await, "{seen:?}");
    assert_eq!(seen.lock().unwrap().len(), 6);
}

#[tokio::test]
async fn a_refused_or_too_long_checkpoint_is_not_stored() {
    for (refusal, limit_bytes, requests) in [("409 Conflict", 1 << 30, 1), ("413 Payload Too Large", 9, 0)] {
        let (address, seen) = server(vec![problem(refusal)]).await;
        let (session, _folder) = session(&address);
        let uploader = Uploader::start(session, KEY(), CheckpointOrder { limit_bytes, ..ORDER });
        uploader.slot().put(checkpoint());
        assert!(!uploader.finish().await, "{refusal}");
        assert_eq!(seen.lock().unwrap().len(), requests, "{refusal}");
    }
}

#[tokio::test]
async fn only_one_upload_runs_and_the_newest_checkpoint_follows() {
    let slow = (Duration::from_secs(2), "200 OK", r#"{"received": 1000000000, "recorded": true}"#.to_owned());
    let (address, seen) = server(vec![slow]).await;
    let (session, _folder) = session(&address);
    let uploader = Uploader::start(session, KEY(), ORDER);
    uploader.slot().put(checkpoint());
    while seen.lock().unwrap().is_empty() {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let newer = [(); 3].map(|()| checkpoint());
    // The run does not wait: the last of these replaces the others.
    newer.into_iter().for_each(|one| uploader.slot().put(one));
    assert!(uploader.finish().await);
    assert_eq!(seen.lock().unwrap().len(), 2);
}

#[tokio::test]
async fn a_slow_last_upload_does_not_delay_the_end_of_the_worker() {
    let never = (Duration::from_secs(600), "200 OK", String::new());
    let (address, _seen) = server(vec![never]).await;
    let (session, _folder) = session(&address);
    session.stop_claiming.cancel();
    let uploader = Uploader::start(session, KEY(), ORDER);
    uploader.slot().put(checkpoint());
    let began = Instant::now();
    assert!(!uploader.finish().await);
    assert!(began.elapsed() < LAST_UPLOAD + Duration::from_secs(30), "{:?}", began.elapsed());
}

#[tokio::test]
async fn the_last_upload_of_a_paused_job_has_no_time_limit() {
    let slow =
        (LAST_UPLOAD + Duration::from_secs(1), "200 OK", r#"{"received": 1000000000, "recorded": true}"#);
    let (address, _seen) = server(vec![(slow.0, slow.1, slow.2.to_owned())]).await;
    let (session, _folder) = session(&address);
    let uploader = Uploader::start(session, KEY(), ORDER);
    uploader.slot().put(checkpoint());
    assert!(uploader.finish().await);
}

#[tokio::test]
async fn a_run_without_checkpoints_is_not_stored() {
    let (address, seen) = server(Vec::new()).await;
    let (session, _folder) = session(&address);
    assert!(!Uploader::start(session, KEY(), ORDER).finish().await);
    assert!(seen.lock().unwrap().is_empty());
}

/// Bytes with the digest of [`stored`], which are no checkpoint.
const FOREIGN: &str = "no checkpoint, but with the right digest";

fn stored() -> CheckpointView {
    CheckpointView {
        attempt: 1,
        simulated_s: 1.0,
        bytes: FOREIGN.len() as u64,
        digest: digest(FOREIGN.as_bytes()),
        solver_revision: 1,
        backend: "cpu".to_owned(),
        device: "a".to_owned(),
    }
}

#[tokio::test]
async fn a_download_is_repeated_and_a_failure_of_the_server_discards_no_checkpoint() {
    let refusals = ["503 Service Unavailable", "401 Unauthorized"];
    for (limit, refusal) in [Duration::ZERO, LONGEST_DOWNLOAD].into_iter().zip(refusals) {
        let (address, seen) = server(vec![problem(refusal)]).await;
        let (session, _folder) = session(&address);
        let resume = resume_within(limit, &session, (JobId::new(), 2), stored());
        assert!(resume.checkpoint.await.is_none());
        assert_eq!(*seen.lock().unwrap(), ["get "], "{refusal}");
    }
    let mut answers = vec![problem(refusals[0]); MAX_TRIES as usize];
    answers.push((Duration::ZERO, "200 OK", FOREIGN.to_owned()));
    let (address, seen) = server(answers).await;
    let (session, _folder) = session(&address);
    assert!(resume(&session, (JobId::new(), 2), stored()).checkpoint.await.is_none());
    assert_eq!(*seen.lock().unwrap(), ["get ", "get ", "get ", "get ", "get ", "get ", "delete "]);
}

#[tokio::test]
async fn a_checkpoint_that_cannot_be_used_is_discarded() {
    let wrong = (Duration::ZERO, "200 OK", "other bytes".to_owned());
    let right = (Duration::ZERO, "200 OK", FOREIGN.to_owned());
    for (answers, downloads) in [(vec![wrong; 5], 5), (vec![right], 1), (vec![problem("404 Not Found")], 1)] {
        let (address, seen) = server(answers).await;
        let (session, _folder) = session(&address);
        let resume = resume(&session, (JobId::new(), 2), stored());
        assert!(resume.checkpoint.await.is_none());
        let mut expected = vec!["get "; downloads];
        expected.push("delete ");
        assert_eq!(*seen.lock().unwrap(), expected);
    }
}

#[test]
fn a_run_records_at_its_interval_and_before_it_is_handed_back() {
    let slot = CheckpointSlot::new(Duration::from_secs(300));
    assert!(!slot.wants(None));
    for (why, wants) in [
        (Stop::Release, true),
        (Stop::Preempt, true),
        (Stop::Cancel, false),
        (Stop::Abandon, false),
        (Stop::Timeout, false),
    ] {
        assert_eq!(slot.wants(Some(why)), wants, "{why:?}");
    }
    let slot = CheckpointSlot::new(Duration::from_secs(1));
    std::thread::sleep(Duration::from_millis(1100));
    assert!(slot.wants(None));
    let next = checkpoint();
    let put = Instant::now();
    slot.put(next);
    assert!(!slot.wants(None) || put.elapsed() >= Duration::from_secs(1), "the interval begins again");
}
