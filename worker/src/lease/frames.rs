//! Frames of a run: recorded in the outbox, and uploaded before its result. The result is delivered even if they fail.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use roost_api::frames::FramesOrder;
use roost_frames::{FrameRecorder, Options, STREAM};
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
pub(super) struct FrameRecording {
    recorder: Arc<Mutex<FrameRecorder>>,
    folder: PathBuf,
}

impl FrameRecording {
    /// Starts to record; none when the recorder cannot start, and the job runs without frames.
    pub(super) fn start(folder: PathBuf, scenario: &Value, order: FramesOrder) -> Option<Self> {
        // The run reports an invalid scenario.
        let scenario = scenario::from_value(scenario).ok()?;
        let timestep_s = match scenario.numerics.timestep_s {
            Timestep::Fixed(timestep_s) => timestep_s,
            Timestep::Auto(_) => 0.0, // an automatic step is never longer than the sample interval, which decides here
        };
        let FramesOrder { interval_s, limit_bytes } = order;
        let options = Options { interval_s, vtk: false, web: true, limit_bytes };
        match FrameRecorder::create(&folder, &scenario, timestep_s, options) {
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
    /// Since when each upload has failed while the server answered; none once it is done.
    failing: Mutex<HashMap<AttemptKey, Option<Instant>>>,
    failures: AtomicUsize,
    has_given_up: AtomicBool,
}

/// The failure that the uploads of one pass over the outbox have met. After it, the pass tries no further upload: each would take
/// as long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Pass {
    /// No failure.
    #[default]
    Clear,
    /// An upload failed, and the server answers.
    Failed,
    /// The server does not answer.
    ServerAway,
}

impl Uploads {
    /// Whether an upload is done or may not be tried.
    fn is_over(&self, key: AttemptKey) -> bool {
        self.has_given_up.load(Relaxed) || self.lock().get(&key).is_some_and(Option::is_none)
    }

    /// Number of failures. It decides which upload a pass tries first.
    pub(super) fn failures(&self) -> usize {
        self.failures.load(Relaxed)
    }

    /// Delivers all further results without frames.
    pub(super) fn give_up(&self) {
        self.has_given_up.store(true, Relaxed);
    }

    fn done(&self, key: AttemptKey) {
        self.lock().insert(key, None);
    }

    /// Notes that an upload cannot be done now, though the server answers; returns whether this has lasted too long.
    fn failed(&self, key: AttemptKey) -> bool {
        let since = *self.lock().entry(key).or_insert_with(|| Some(Instant::now()));
        since.is_none_or(|since| since.elapsed() > PATIENCE)
    }

    /// Starts the patience of all uploads again: the time in which the server does not answer does not count.
    fn server_is_away(&self) {
        self.lock().retain(|_, since| since.is_none());
    }

    /// Forgets an attempt after its delivery.
    pub(super) fn forget(&self, key: AttemptKey) {
        self.lock().remove(&key);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<AttemptKey, Option<Instant>>> {
        self.failing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Uploads the frames of a delivery, unless an upload of this pass has failed; returns whether the delivery may follow.
pub(super) async fn upload(session: &Session, delivery: &Delivery, path: &Path, pass: &mut Pass) -> bool {
    let key = (delivery.job_id, delivery.attempt);
    let Some(recorded) = delivery.frames.as_ref().filter(|_| !session.uploads.is_over(key)) else {
        return true;
    };
    if *pass != Pass::Clear {
        return is_too_late(session, key, *pass);
    }
    let stream = path.with_extension(crate::outbox::FRAMES_EXTENSION).join(STREAM);
    let sent = session.client.upload_frames(key.0, key.1, delivery.content.worker_id(), recorded, &stream);
    match sent.await {
        Ok(()) => session.uploads.done(key),
        Err(error) if error.is_transient() => {
            session.uploads.failures.fetch_add(1, Relaxed);
            *pass = if session.client.is_reachable().await { Pass::Failed } else { Pass::ServerAway };
            tracing::debug!(%error, ?pass, "frames were not uploaded");
            return is_too_late(session, key, *pass);
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

/// Whether to deliver a result without its frames, after the failure of an upload.
fn is_too_late(session: &Session, key: AttemptKey, pass: Pass) -> bool {
    if pass == Pass::ServerAway {
        session.uploads.server_is_away();
        return false;
    }
    let is_late = session.uploads.failed(key);
    if is_late {
        tracing::warn!(job = %key.0, attempt = key.1, "the result is delivered without its frames");
    }
    is_late
}

#[cfg(test)]
mod tests {
    use roost_api::ids::JobId;

    use super::*;

    /// Sets the begin of the failures further back than the patience.
    fn wait_for_long(uploads: &Uploads, key: AttemptKey) -> Option<()> {
        let long_ago = Instant::now().checked_sub(PATIENCE + Duration::from_secs(1))?;
        uploads.lock().insert(key, Some(long_ago));
        Some(())
    }

    #[test]
    fn an_upload_is_over_when_it_is_done_or_has_failed_for_long() {
        let (uploads, key) = (Uploads::default(), (JobId::new(), 1));
        for _ in 0..100 {
            assert!(!uploads.failed(key), "a bucket may be out of order for minutes");
        }
        let Some(()) = wait_for_long(&uploads, key) else {
            return; // the machine has just started
        };
        assert!(!uploads.is_over(key), "it is tried once more");
        assert!(uploads.failed(key), "the first failure counts");
        uploads.forget(key);
        assert!(!uploads.failed(key));
        uploads.done(key);
        assert!(uploads.is_over(key));
    }

    #[test]
    fn time_without_the_server_does_not_count() {
        let (uploads, key, done) = (Uploads::default(), (JobId::new(), 1), (JobId::new(), 1));
        uploads.done(done);
        let Some(()) = wait_for_long(&uploads, key) else {
            return; // the machine has just started
        };
        uploads.server_is_away();
        assert!(!uploads.is_over(key));
        assert!(!uploads.failed(key), "the patience begins when the server answers again");
        assert!(uploads.is_over(done), "no frames are sent twice");
    }
}
