//! Claims jobs while slots are free, and brings every claimed attempt to the outbox.

use std::sync::Arc;
use std::time::Duration;

use roost_api::job::AttemptOutcome;
use roost_api::lease::{
    ClaimReply, ClaimRequest, ClaimedAttempt, FailureReport, MAX_CLAIMED_JOBS, ResultDelivery,
};
use tokio_util::task::TaskTracker;
use tracing::field::Empty;
use tracing::{Instrument, Span};
use uuid::Uuid;

use super::attempts::AttemptKey;
use super::checkpoints::Uploader;
use super::deliver;
use super::fills::FillUpload;
use super::frames::FrameRecording;
use super::session::Session;
use crate::backoff::Backoff;
use crate::client::ClientError;
use crate::meshes::MeshSource;
use crate::outbox::{Content, Delivery};
use crate::runner::{Extras, Resources, Run, RunEnd};
use crate::slots::{Slot, SlotPool, bodies};

/// Time that a stopping worker waits for the answer to its last claim.
const LAST_CLAIM: Duration = Duration::from_secs(1);

/// Claims jobs until a stop, as many as slots and memory allow. The runs continue in `runs`.
pub(super) async fn run(session: &Arc<Session>, runs: &TaskTracker) {
    let device = &session.config.device;
    let pool = SlotPool::new(session.config.slots, device, session.config.resolved_threads());
    loop {
        let capacity = async { (device.runs_that_fit().await, pool.wait().await) };
        let (fitting, free) = tokio::select! {
            biased;
            () = session.stop_claiming.cancelled() => return,
            capacity = capacity => capacity,
        };
        let asked = free.min(fitting).min(MAX_CLAIMED_JOBS as usize);
        let Some(reply) = claim(session, asked).await else { return };
        let bodies: Vec<u64> = reply.attempts.iter().map(|attempt| bodies(&attempt.scenario)).collect();
        let slots = pool.assign(&bodies, asked, fitting);
        for (attempt, slot) in reply.attempts.into_iter().zip(slots) {
            start(session, runs, attempt, slot);
        }
    }
}

/// One claim, repeated with the same request id until it is answered; none after a stop.
async fn claim(session: &Session, max_jobs: usize) -> Option<ClaimReply> {
    let mut request = ClaimRequest {
        request_id: Uuid::now_v7(),
        worker_id: session.worker_id,
        max_jobs: max_jobs as u32,
        wait_s: session.config.claim_wait.as_secs_f64(),
        shares_fills: true,
    };
    let mut backoff = Backoff::default();
    loop {
        let answer = tokio::select! {
            biased;
            () = session.stop_claiming.cancelled() => {
                // The open claim may have got jobs: repeat it once, and release them.
                (request.max_jobs, request.wait_s) = (1, 0.0);
                let last = tokio::time::timeout(LAST_CLAIM, session.client.claim(&request)).await;
                if let Ok(Ok(reply)) = last {
                    release(session, reply).await;
                }
                return None;
            }
            answer = session.client.claim(&request) => answer,
        };
        match answer {
            Ok(reply) => return Some(reply),
            Err(error) => recover(session, &error, &mut backoff).await,
        }
    }
}

/// Waits or registers again after a failed claim; returns at once after a stop.
async fn recover(session: &Session, error: &ClientError, backoff: &mut Backoff) {
    let recovery = async {
        if error.problem_status() == Some(404) {
            return session.register_again().await;
        }
        if error.is_transient() {
            tracing::debug!(%error, "claim failed; retrying");
        } else {
            tracing::error!(%error, "the server refuses the claim; retrying");
        }
        backoff.pause().await;
    };
    session.stop_claiming.run_until_cancelled(recovery).await;
}

async fn release(session: &Session, reply: ClaimReply) {
    for ClaimedAttempt { job_id, attempt, .. } in reply.attempts {
        let report = FailureReport {
            worker_id: session.worker_id,
            outcome: AttemptOutcome::Released,
            message: "claimed by a worker that is stopping".to_owned(),
            result: None,
        };
        let delivery = Delivery { job_id, attempt, content: Content::Failure(report), frames: None };
        deliver::store(session, delivery).await;
    }
}

/// Starts one attempt. It is inserted before the first await, so that a drain right after the claim finds it.
fn start(session: &Arc<Session>, runs: &TaskTracker, claimed: ClaimedAttempt, slot: Slot) {
    let ClaimedAttempt {
        job_id,
        attempt,
        scenario,
        max_wall_s,
        frames,
        checkpoints,
        checkpoint,
        shared_fill,
        fill,
        ..
    } = claimed;
    let key = (job_id, attempt);
    tracing::info!(job = %job_id, attempt, threads = slot.threads, "running");
    let meshes = MeshSource::Server(session.meshes.clone());
    let resources = Resources::new(session.config.device.clone(), slot.threads);
    let folder = session.outbox.frames_folder(job_id, attempt);
    let recording = frames.and_then(|order| FrameRecording::start(folder, &scenario, order));
    let uploader = checkpoints.map(|order| Uploader::start(session.clone(), key, order));
    let (server_fill, fill_upload) = fill.map(|order| super::fills::share(session, key, order)).unzip();
    let extras = Extras {
        frames: recording.as_ref().map(FrameRecording::observer),
        checkpoints: uploader.as_ref().map(Uploader::slot),
        fills: shared_fill.then(|| session.fills.clone()),
        server_fill,
        resume: checkpoint.map(|stored| super::checkpoints::resume(session, key, stored)),
    };
    let run = Run::start_observed(scenario, meshes, resources, max_wall_s, extras);
    session.attempts.insert(key, &run);
    let span = tracing::debug_span!("attempt", job = %job_id, attempt, outcome = Empty);
    let ending = finish(session.clone(), key, run, (recording, uploader, fill_upload), slot);
    runs.spawn(ending.instrument(span));
}

/// Waits for the end of a run and puts its result into the outbox. The slot is free as soon as the run ends.
async fn finish(
    session: Arc<Session>,
    (job_id, attempt): AttemptKey,
    run: Run,
    (recording, uploader, fill_upload): (Option<FrameRecording>, Option<Uploader>, Option<FillUpload>),
    slot: Slot,
) {
    let (end, filled_by) = run.end_with_fill().await;
    drop(slot);
    match (&end, fill_upload) {
        (RunEnd::Abandoned, Some(upload)) => upload.abort(),
        // The server takes the fill of a running attempt only.
        (_, Some(upload)) => upload.finish().await,
        (_, None) => {}
    }
    let end = after_checkpoint(end, uploader).await;
    // The frames of an attempt that is handed back or abandoned are discarded.
    let has_frames = match end {
        RunEnd::Finished(_) => true,
        RunEnd::Failed { outcome, .. } => {
            !matches!(outcome, AttemptOutcome::Released | AttemptOutcome::Preempted)
        }
        RunEnd::Abandoned => false,
    };
    let frames = tokio::task::spawn_blocking(move || match recording {
        Some(recording) if has_frames => recording.finish(),
        Some(recording) => {
            recording.discard();
            None
        }
        None => None,
    });
    let frames = frames.await.unwrap_or_default();
    let worker_id = session.worker_id;
    let content = match end {
        RunEnd::Finished(result) => {
            tracing::info!(job = %job_id, attempt, wall_s = result.performance.wall_s, "finished");
            Span::current().record("outcome", "finished");
            Content::Result(ResultDelivery { worker_id, result, filled_by })
        }
        RunEnd::Failed { outcome, message, result } => {
            tracing::warn!(job = %job_id, attempt, %outcome, message, "ended without a result");
            Span::current().record("outcome", outcome.to_string());
            Content::Failure(FailureReport { worker_id, outcome, message, result })
        }
        RunEnd::Abandoned => {
            Span::current().record("outcome", "abandoned");
            tracing::warn!(job = %job_id, attempt, "abandoned: the server gave the job to another attempt");
            return session.attempts.remove((job_id, attempt));
        }
    };
    deliver::store(&session, Delivery { job_id, attempt, content, frames }).await;
}

/// Ends the uploads of checkpoints. A run that is handed back with a stored checkpoint is preempted.
async fn after_checkpoint(end: RunEnd, uploader: Option<Uploader>) -> RunEnd {
    let Some(uploader) = uploader else { return end };
    match end {
        RunEnd::Failed { outcome: AttemptOutcome::Released, message, result } => {
            let is_stored = uploader.finish().await;
            let outcome = if is_stored { AttemptOutcome::Preempted } else { AttemptOutcome::Released };
            RunEnd::Failed { outcome, message, result }
        }
        other => {
            uploader.abort();
            other
        }
    }
}

#[cfg(test)]
mod tests {
    use roost_api::ids::JobId;
    use serde_json::json;
    use tokio_util::sync::CancellationToken;

    use super::*;
    use crate::{Slots, WorkerConfig};

    #[tokio::test]
    async fn a_drain_right_after_a_claim_stops_the_run() {
        let folder = tempfile::tempdir().unwrap();
        let config = WorkerConfig::new("http://127.0.0.1:1", "worker", folder.path());
        let session = Arc::new(Session::open(config, &CancellationToken::new()).unwrap());
        let claimed: ClaimedAttempt = serde_json::from_value(json!({
            "job_id": JobId::new(), "attempt": 1, "scenario": {}, "lease_expires_at": "2030-01-01T00:00:00Z",
        }))
        .unwrap();
        // One thread and no await: no spawned task has run yet.
        let slot = SlotPool::new(Slots::Auto, &session.config.device, 1).assign(&[1], 1, 1).remove(0);
        start(&session, &TaskTracker::new(), claimed, slot);
        assert_eq!(session.attempts.beats().len(), 1);
    }
}
