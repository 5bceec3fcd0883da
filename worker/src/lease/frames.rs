//! Frames of a run: recorded in the outbox, and uploaded before its result. The result is delivered even if they fail.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use roost_api::frames::FramesOrder;
use roost_frames::{Options, Recorder, STREAM};
use roost_solver::scenario::{self, Timestep};
use serde_json::Value;

use super::attempts::AttemptKey;
use super::session::Session;
use crate::client::RecordedFrames;
use crate::outbox::Delivery;
use crate::runner::FrameObserver;

/// Time in which an upload may fail, while the server answers, before the result goes without frames. A bucket of the server may be out of
/// order for some minutes.
const PATIENCE: Duration = Duration::from_secs(600);

/// The frames of a running job.
#[derive(Debug)]
pub(super) struct Recording {
    recorder: Arc<Mutex<Recorder>>,
    folder: PathBuf,
}

impl Recording {
    /// Starts to record; none when the recorder cannot start, and the job the job runs without frames.
    pub(super) fn start(folder: PathBuf, scenario: &Value, order: FramesOrder) -> Option<Self> {
        // The run reports an invalid scenario.
        let scenario = scenario::from_value(scenario).ok()?;
        let timestep_s = match scenario.numerics.timestep_s {
            Timestep::Fixed(timestep_s) => timestep_s,
            Timestep::Auto(_) => 0.0, // an automatic step is never longer than the sample interval, which decides here
        };
        let FramesOrder { interval_s, limit_bytes } = order;
        let options = Options { interval_s, vtk: false, web: true, limit_bytes };
        match Recorder::create(&folder, &scenario, timestep_s, options) {
            Ok(recorder) => Some(Self { recorder: Arc::new(Mutex::new(recorder)), folder }),
            Err(error) => {
                tracing::warn!(%error, folder = %folder.display(), "the job runs without frames");
                None
            }
        }
    }

    /// The observer for the run.
    pub(super) fn observer(&self) -> FrameObserver {
        self.recorder.clone()
    }

    /// Ends the stream; none when it has no frame.
    pub(super) fn finish(self) -> Option<RecordedFrames> {
        let report = self.recorder.lock().unwrap_or_else(PoisonError::into_inner).finish();
        if let Some(why) = &report.stopped {
            tracing::warn!(why, "frames end before the run");
        }
        if report.frames == 0 {
            self.discard();
            return None;
        }
        Some(RecordedFrames { count: report.frames, stopped: report.stopped })
    }

    /// Removes the recording.
    pub(super) fn discard(self) {
        let _ = fs::remove_dir_all(self.folder);
    }
}

/// The failures of uploads.
#[derive(Debug, Default)]
pub(super) struct Uploads {
    /// When each upload failed first; none once it is done.
    failing: Mutex<HashMap<AttemptKey, Option<Instant>>>,
    has_given_up: AtomicBool,
}

impl Uploads {
    /// Whether an upload is done or has failed for too long.
    fn is_over(&self, key: AttemptKey) -> bool {
        let is_over = |failing: &Option<Instant>| failing.is_none_or(|since| since.elapsed() > PATIENCE);
        self.has_given_up.load(Relaxed) || self.lock().get(&key).is_some_and(is_over)
    }

    /// Delivers all further results without frames.
    pub(super) fn give_up(&self) {
        self.has_given_up.store(true, Relaxed);
    }

    fn done(&self, key: AttemptKey) {
        self.lock().insert(key, None);
    }

    fn failed(&self, key: AttemptKey) {
        self.lock().entry(key).or_insert_with(|| Some(Instant::now()));
    }

    /// Forgets an attempt after its delivery.
    pub(super) fn forget(&self, key: AttemptKey) {
        self.lock().remove(&key);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<AttemptKey, Option<Instant>>> {
        self.failing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Uploads the frames of a delivery; returns whether the delivery may follow.
pub(super) async fn upload(session: &Session, delivery: &Delivery, path: &Path) -> bool {
    let key = (delivery.job_id, delivery.attempt);
    let Some(recorded) = delivery.frames.as_ref().filter(|_| !session.uploads.is_over(key)) else {
        return true;
    };
    let stream = path.with_extension(crate::outbox::FRAMES_EXTENSION).join(STREAM);
    let sent = session.client.upload_frames(key.0, key.1, delivery.content.worker_id(), recorded, &stream);
    match sent.await {
        Ok(()) => session.uploads.done(key),
        Err(error) if error.is_transient() => {
            // No failure counts while the server does not answer.
            if session.client.is_reachable().await {
                session.uploads.failed(key);
            }
            let is_over = session.uploads.is_over(key);
            tracing::debug!(%error, is_over, "frames were not uploaded");
            if is_over {
                tracing::warn!(job = %key.0, attempt = key.1, "the result is delivered without its frames");
            }
            return is_over;
        }
        // The delivery reports a refused token.
        Err(error) if error.is_access_refused() => return true,
        Err(error) => {
            tracing::warn!(job = %key.0, attempt = key.1, %error, "the result is delivered without its frames");
            session.uploads.done(key);
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use roost_api::ids::JobId;

    use super::*;

    #[test]
    fn an_upload_is_over_when_it_is_done_or_has_failed_for_long() {
        let (uploads, key) = (Uploads::default(), (JobId::new(), 1));
        for _ in 0..100 {
            uploads.failed(key);
        }
        assert!(!uploads.is_over(key), "a bucket may be out of order for minutes");
        let Some(long_ago) = Instant::now().checked_sub(PATIENCE + Duration::from_secs(1)) else {
            return; // the machine has just started
        };
        uploads.lock().insert(key, Some(long_ago));
        uploads.failed(key);
        assert!(uploads.is_over(key), "the first failure counts");
        uploads.forget(key);
        assert!(!uploads.is_over(key));
        uploads.done(key);
        assert!(uploads.is_over(key));
    }
}
