//! Delivers the outbox to the server.

use std::collections::VecDeque;
use std::io;

use tokio_util::sync::CancellationToken;
use tracing::Instrument;

use super::frames;
use super::session::Session;
use crate::backoff::Backoff;
use crate::outbox::Delivery;

/// Stores a delivery in the outbox and wakes [`run`]. Where the disk cannot be written, sends it directly; repeats both until one succeeds.
pub(super) async fn store(session: &Session, mut delivery: Delivery) {
    let mut backoff = Backoff::default();
    loop {
        let (outbox, copy) = (session.outbox.clone(), delivery.clone());
        match on_disk(move || outbox.put(&copy)).await {
            Ok(_) => return session.outbox_changed.notify_one(),
            Err(error) => {
                tracing::error!(%error, folder = %session.config.state_dir.display(), "cannot write to the outbox");
                let key = (delivery.job_id, delivery.attempt);
                match delivery.send(&session.client).await {
                    Ok(_) => return session.attempts.remove(key),
                    Err(refusal) => {
                        if let Some(report) = delivery.clone().as_failure(&refusal) {
                            delivery = report;
                        }
                    }
                }
                backoff.pause().await;
            }
        }
    }
}

/// Delivers until the runs are over and the outbox is empty.
pub(super) async fn run(session: &Session, runs_over: &CancellationToken) {
    let mut backoff = Backoff::default();
    loop {
        // Read before the outbox: the delivery of the last run is in it by then.
        let is_last = runs_over.is_cancelled();
        match deliver_waiting(session).await {
            Ok(true) if is_last => return,
            Ok(true) => {
                backoff.reset();
                tokio::select! {
                    () = session.outbox_changed.notified() => {}
                    () = runs_over.cancelled() => {}
                }
            }
            Ok(false) => backoff.pause().await,
            Err(error) => {
                tracing::error!(%error, "cannot read the outbox");
                backoff.pause().await;
            }
        }
    }
}

/// Sends every waiting delivery once; returns whether the outbox is empty then.
pub(super) async fn deliver_waiting(session: &Session) -> io::Result<bool> {
    let outbox = session.outbox.clone();
    let (mut is_empty, mut has_warned) = (true, false);
    let mut paths = VecDeque::from(on_disk(move || outbox.waiting()).await?);
    // A pass ends its uploads after a failure: each upload has its turn to be the first.
    let first = session.uploads.failures() % paths.len().max(1);
    paths.rotate_left(first);
    let mut uploads = frames::Pass::default();
    while let Some(path) = paths.pop_front() {
        let (outbox, from) = (session.outbox.clone(), path.clone());
        let Some(delivery) = on_disk(move || outbox.read(&from)).await? else { continue };
        let key = (delivery.job_id, delivery.attempt);
        if !frames::upload(session, &delivery, &path, &mut uploads).await {
            is_empty = false;
            continue;
        }
        let span = tracing::debug_span!("delivery", job = %key.0, attempt = key.1);
        match delivery.send(&session.client).instrument(span).await {
            Ok(_) => {
                let outbox = session.outbox.clone();
                on_disk(move || outbox.remove(&path)).await?;
            }
            Err(error) if error.is_transient() => {
                tracing::debug!(%error, "delivery failed; the outbox keeps it");
                is_empty = false;
                continue;
            }
            Err(error) if error.is_access_refused() => {
                if !std::mem::replace(&mut has_warned, true) {
                    tracing::warn!(%error, "the server refuses the token of this worker; deliveries wait in the outbox");
                }
                is_empty = false;
                continue;
            }
            Err(error) => {
                tracing::error!(job = %delivery.job_id, %error, "the server refuses a delivery; moved it to `refused`");
                let outbox = session.outbox.clone();
                on_disk(move || outbox.set_aside(&path)).await?;
                if let Some(report) = delivery.clone().as_failure(&error) {
                    let outbox = session.outbox.clone();
                    paths.push_front(on_disk(move || outbox.put(&report)).await?);
                    continue;
                }
            }
        }
        session.uploads.forget(key);
        session.attempts.remove(key);
    }
    Ok(is_empty)
}

/// Runs file work outside the async threads, since an fsync can be slow.
async fn on_disk<T: Send + 'static>(work: impl FnOnce() -> io::Result<T> + Send + 'static) -> io::Result<T> {
    tokio::task::spawn_blocking(work).await.map_err(io::Error::other)?
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use roost_api::job::AttemptOutcome;
    use roost_api::lease::ResultDelivery;
    use roost_solver::mesh::Meshes;
    use roost_solver::{CpuOptions, Flow, Limits, Progress, check, scenario, simulate};
    use serde_json::json;

    use super::*;
    use crate::WorkerConfig;
    use crate::client::RecordedFrames;
    use crate::client::tests::{answering, answering_by};
    use crate::outbox::Content;

    /// A small result.
    fn result() -> roost_api::RunResult {
        let document = json!({
            "experiment": "hopper",
            "product": {"count": 1, "subparticle_radius_m": 0.009},
            "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
            "numerics": {"timestep_s": "auto", "duration_s": 0.05},
        });
        let scenario = scenario::from_value(&document).unwrap();
        let checked = check(&scenario, &Meshes::default(), &Limits::NONE).unwrap();
        simulate(&checked, CpuOptions { threads: 1 }, &mut |_: &Progress| Flow::Cancel)
    }

    /// A session with one delivery in its outbox.
    async fn session_with(server: &str, content: Content) -> (Session, tempfile::TempDir) {
        let folder = tempfile::tempdir().unwrap();
        let config = WorkerConfig::new(server, "worker", folder.path());
        let session = Session::open(config, &CancellationToken::new()).unwrap();
        let delivery = Delivery { job_id: roost_api::ids::JobId::new(), attempt: 2, content, frames: None };
        store(&session, delivery).await;
        (session, folder)
    }

    /// Delivers to a server that refuses every result; returns the reports that it accepts.
    async fn reports_after_refusal(
        status: &'static str,
        content: Content,
    ) -> (Vec<String>, tempfile::TempDir) {
        let accepted = Arc::new(Mutex::new(Vec::new()));
        let reports = accepted.clone();
        let server = answering_by("application/problem+json", move |request| {
            let (head, body) = request.split_once("\r\n\r\n").unwrap();
            if head.contains("/failure http") && !body.contains("series") {
                reports.lock().unwrap().push(body.to_owned());
                return ("200 OK".to_owned(), "{}".to_owned());
            }
            let code = &status[..3];
            let problem =
                format!(r#"{{"type":"/problems/x","title":"x","status":{code},"detail":"over 8 MiB"}}"#);
            (status.to_owned(), problem)
        })
        .await;
        let (session, folder) = session_with(&server, content).await;
        assert!(deliver_waiting(&session).await.unwrap(), "the outbox is empty");
        assert!(session.outbox.waiting().unwrap().is_empty());
        let reports = accepted.lock().unwrap().clone();
        (reports, folder)
    }

    #[tokio::test]
    async fn a_refused_result_becomes_a_failure_report() {
        let worker_id = roost_api::ids::WorkerId::new();
        for status in ["413 Payload Too Large", "400 Bad Request", "422 Unprocessable Entity"] {
            let delivery = ResultDelivery { worker_id, result: result(), filled_by: None };
            let (reports, _folder) = reports_after_refusal(status, Content::Result(delivery)).await;
            assert_eq!(reports.len(), 1, "{status}");
            assert!(reports[0].contains(r#""outcome":"worker""#), "{status}: {}", reports[0]);
            assert!(reports[0].contains("refused the result: over 8 mib"), "{status}: {}", reports[0]);
        }
    }

    /// Adds deliveries to an outbox, with recorded frames or without.
    async fn add_deliveries(session: &Session, with_frames: &[bool]) {
        for has_frames in with_frames {
            let job_id = roost_api::ids::JobId::new();
            let folder = session.outbox.frames_folder(job_id, 1);
            std::fs::create_dir(&folder).unwrap();
            std::fs::write(folder.join(roost_frames::STREAM), "frames").unwrap();
            let frames = has_frames.then_some(RecordedFrames { count: 1, stopped: None });
            let content = Content::Failure(failure());
            store(session, Delivery { job_id, attempt: 1, content, frames }).await;
        }
    }

    fn failure() -> roost_api::lease::FailureReport {
        roost_api::lease::FailureReport {
            worker_id: roost_api::ids::WorkerId::new(),
            outcome: AttemptOutcome::Worker,
            message: "stopped".to_owned(),
            result: None,
        }
    }

    #[tokio::test]
    async fn after_a_failed_upload_only_deliveries_without_frames_follow() {
        let requests = Arc::new(Mutex::new(Vec::new()));
        let seen = requests.clone();
        let server = answering_by("application/json", move |request| {
            let line = request.lines().next().unwrap().to_owned();
            let is_upload = line.starts_with("put ");
            seen.lock().unwrap().push(line);
            (if is_upload { "503 Service Unavailable" } else { "200 OK" }.to_owned(), "{}".to_owned())
        })
        .await;
        let (session, _folder) = session_with(&server, Content::Failure(failure())).await;
        add_deliveries(&session, &[true, false, true, true, false]).await;
        let mut first_uploads = std::collections::HashSet::new();
        for _ in 0..3 {
            requests.lock().unwrap().clear();
            assert!(!deliver_waiting(&session).await.unwrap(), "three deliveries wait");
            assert_eq!(session.outbox.waiting().unwrap().len(), 3);
            let uploads: Vec<_> =
                requests.lock().unwrap().iter().filter(|line| line.starts_with("put ")).cloned().collect();
            assert_eq!(uploads.len(), 1, "{uploads:?}");
            first_uploads.extend(uploads);
        }
        assert_eq!(first_uploads.len(), 3, "the uploads take turns: {first_uploads:?}");
    }

    #[tokio::test]
    async fn a_result_waits_for_a_valid_token() {
        for (status, content_type) in [
            ("401 Unauthorized", "application/problem+json"),
            ("403 Forbidden", "application/problem+json"),
            ("401 Unauthorized", "text/html"),
        ] {
            let body = match content_type {
                "text/html" => "<h1>nginx</h1>".to_owned(),
                _ => {
                    format!(r#"{{"type":"/problems/x","title":"x","status":{},"detail":"no"}}"#, &status[..3])
                }
            };
            let server = answering(status, content_type, &body).await;
            let delivery = ResultDelivery {
                worker_id: roost_api::ids::WorkerId::new(),
                result: result(),
                filled_by: None,
            };
            let (session, _folder) = session_with(&server, Content::Result(delivery)).await;
            assert!(!deliver_waiting(&session).await.unwrap(), "{status}: it waits");
            assert_eq!(session.outbox.waiting().unwrap().len(), 1, "{status} {content_type}");
        }
    }

    #[tokio::test]
    async fn a_refused_partial_result_keeps_the_outcome() {
        let report = roost_api::lease::FailureReport {
            worker_id: roost_api::ids::WorkerId::new(),
            outcome: AttemptOutcome::Timeout,
            message: "stopped".to_owned(),
            result: Some(result()),
        };
        let (reports, _folder) =
            reports_after_refusal("413 Payload Too Large", Content::Failure(report)).await;
        assert_eq!(reports.len(), 1);
        assert!(reports[0].contains(r#""outcome":"timeout""#), "{}", reports[0]);
    }
}
