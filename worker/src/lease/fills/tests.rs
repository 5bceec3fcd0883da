//! Uploads and downloads of fills, against a server that refuses, damages or delays them.

use std::sync::Mutex;

use roost_api::ids::JobId;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::from_value;
use roost_solver::{CpuOptions, Flow, Limits, Moment, Observer, Progress, check, simulate};
use serde_json::json;
use tokio_util::sync::CancellationToken;

use super::*;
use crate::WorkerConfig;
use crate::client::digest;
use crate::client::tests::answering_after;

/// Takes the filled state of a run and stops it there.
#[derive(Default)]
struct Filling(Option<Checkpoint>);

impl Observer for Filling {
    fn progress(&mut self, _: &Progress) -> Flow {
        if self.0.is_some() { Flow::Cancel } else { Flow::Continue }
    }

    fn wants_checkpoint(&mut self, moment: Moment) -> bool {
        moment == Moment::Start
    }

    fn checkpoint(&mut self, checkpoint: Checkpoint) {
        self.0 = Some(checkpoint);
    }
}

fn filled() -> Checkpoint {
    let scenario = from_value(&json!({
        "experiment": "hopper",
        "product": {"count": 1, "subparticle_radius_m": 0.01},
        "equipment": {"hopper_width_m": 0.2},
        "numerics": {"timestep_s": "auto", "duration_s": 0.1, "rest_speed_m_s": 0.2},
    }));
    let checked = check(&scenario.unwrap(), &Meshes::default(), &Limits::NONE).unwrap();
    let mut filling = Filling::default();
    simulate(&checked, CpuOptions { threads: 1 }, &mut filling);
    filling.0.expect("it was filled")
}

/// A session with a server that gives the same answer to each request of a method, and the requests that it has answered.
async fn session(
    answers: Vec<(&'static str, &'static str, Vec<u8>)>,
) -> (Arc<Session>, Arc<Mutex<Vec<String>>>, tempfile::TempDir) {
    let seen: Arc<Mutex<Vec<String>>> = Arc::default();
    let requests = seen.clone();
    let address = answering_after("application/json", move |request| {
        let line = request.lines().next().unwrap_or_default().to_owned();
        let method = line.split(' ').next().unwrap_or_default().to_owned();
        let named = if line.contains("&digest=") && method == "delete" { " of a digest" } else { "" };
        requests.lock().unwrap().push(format!("{method}{named}"));
        let known = answers.iter().find(|(of, ..)| *of == method);
        let (status, body) = known.map_or(("204 No Content", String::new()), |(_, status, body)| {
            (*status, String::from_utf8_lossy(body).into_owned())
        });
        (Duration::ZERO, (status.to_owned(), body))
    })
    .await;
    let folder = tempfile::tempdir().unwrap();
    let config = WorkerConfig::new(address, "worker", folder.path());
    (Arc::new(Session::open(config, &CancellationToken::new()).unwrap()), seen, folder)
}

fn key() -> AttemptKey {
    (JobId::new(), 1)
}

#[tokio::test]
async fn a_fill_is_uploaded_beside_the_run_and_a_run_without_one_uploads_none() {
    let receipt = br#"{"received": 1000000000, "recorded": true}"#.to_vec();
    let (session, seen, _folder) = session(vec![("put", "200 OK", receipt)]).await;
    let order = FillOrder { stored: None, limit_bytes: 1 << 30 };
    let (server, upload) = share(&session, key(), order.clone());
    assert!(server.download.is_none());
    server.upload.send(filled()).unwrap();
    upload.finish().await;
    assert_eq!(*seen.lock().unwrap(), ["put"]);
    let (server, upload) = share(&session, key(), order);
    drop(server);
    upload.finish().await;
    assert_eq!(seen.lock().unwrap().len(), 1);
}

#[tokio::test]
async fn a_fill_that_the_server_does_not_take_is_withdrawn() {
    let refusal = br#"{"type":"/problems/x","title":"x","status":413,"detail":"no"}"#.to_vec();
    for (limit_bytes, expected) in [(1 << 30, vec!["put", "delete"]), (9, vec!["delete"])] {
        let (session, seen, _folder) = session(vec![("put", "413 Payload Too Large", refusal.clone())]).await;
        let (server, upload) = share(&session, key(), FillOrder { stored: None, limit_bytes });
        server.upload.send(filled()).unwrap();
        upload.finish().await;
        assert_eq!(*seen.lock().unwrap(), expected, "{limit_bytes}");
    }
}

#[tokio::test]
async fn a_lost_or_damaged_fill_is_withdrawn_and_the_run_fills_by_itself() {
    let no_checkpoint = b"no checkpoint".to_vec();
    let missing = br#"{"type":"/problems/x","title":"x","status":404,"detail":"no"}"#.to_vec();
    let stored = |of: &[u8]| StoredFill { bytes: of.len() as u64, digest: digest(of) };
    for (status, body, expected, downloads) in [
        ("200 OK", no_checkpoint.clone(), stored(&no_checkpoint), 1),
        ("200 OK", no_checkpoint.clone(), stored(b"other bytes"), MAX_TRIES as usize),
        ("404 Not Found", missing, stored(&no_checkpoint), 1),
    ] {
        let (session, seen, _folder) = session(vec![("get", status, body)]).await;
        let order = FillOrder { stored: Some(expected), limit_bytes: 1 << 30 };
        let (server, _upload) = share(&session, key(), order);
        assert!(server.download.expect("stored").await.is_none(), "{status}");
        let mut requests = vec!["get"; downloads];
        requests.push("delete of a digest");
        assert_eq!(*seen.lock().unwrap(), requests, "{status}");
    }
}
