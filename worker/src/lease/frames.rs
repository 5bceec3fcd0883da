//! Frames of a run: recorded beside the outbox while it runs, uploaded before the result that they belong to. They may fail; the
//! result goes all the same.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

use roost_api::frames::FramesOrder;
use roost_frames::{Options, Recorder, STREAM};
use roost_solver::scenario::{self, Timestep};
use serde_json::Value;

use super::held::Key;
use super::session::Session;
use crate::outbox::{Delivery, Recorded};
use crate::runner::Pictures;

/// So often an upload may fail while the server takes everything else.
const TRIES: u32 = 5;

/// The frames of a run under way.
#[derive(Debug)]
pub(super) struct Recording {
    recorder: Arc<Mutex<Recorder>>,
    folder: PathBuf,
}

impl Recording {
    /// Begins to record; none when that cannot be, and the run then goes without.
    pub(super) fn start(folder: PathBuf, scenario: &Value, order: FramesOrder) -> Option<Self> {
        // Of a scenario that cannot be read the run will say so.
        let scenario = scenario::from_value(scenario).ok()?;
        let timestep_s = match scenario.numerics.timestep_s {
            Timestep::Fixed(timestep_s) => timestep_s,
            Timestep::Auto(_) => 0.0, // never longer than samples are apart, which is all that counts here
        };
        let FramesOrder { interval_s, limit_bytes } = order;
        let options = Options { interval_s, vtk: false, web: true, limit_bytes };
        match Recorder::create(&folder, &scenario, timestep_s, options) {
            Ok(recorder) => Some(Self { recorder: Arc::new(Mutex::new(recorder)), folder }),
            Err(error) => {
                tracing::warn!(%error, folder = %folder.display(), "runs without frames");
                None
            }
        }
    }

    /// For the run.
    pub(super) fn pictures(&self) -> Pictures {
        self.recorder.clone()
    }

    /// Brings the stream to its end; none when there is no frame in it.
    pub(super) fn finish(self) -> Option<Recorded> {
        let report = self.recorder.lock().unwrap_or_else(PoisonError::into_inner).finish();
        if let Some(why) = &report.stopped {
            tracing::warn!(why, "frames end before the run");
        }
        if report.frames == 0 {
            self.discard();
            return None;
        }
        Some(Recorded { count: report.frames, stopped: report.stopped })
    }

    /// Forgets it.
    pub(super) fn discard(self) {
        let _ = fs::remove_dir_all(self.folder);
    }
}

/// Uploads that need not be tried again: how often they have failed, or that they are done.
#[derive(Debug, Default)]
pub(super) struct Uploads {
    failed: Mutex<HashMap<Key, u32>>,
    given_up: AtomicBool,
}

impl Uploads {
    /// Whether an upload is done or has failed too often.
    fn is_over(&self, key: Key) -> bool {
        self.given_up.load(Relaxed) || self.lock().get(&key).is_some_and(|failed| *failed >= TRIES)
    }

    /// From now on everything goes without its frames.
    pub(super) fn give_up(&self) {
        self.given_up.store(true, Relaxed);
    }

    fn done(&self, key: Key) {
        self.lock().insert(key, TRIES);
    }

    fn failed(&self, key: Key) {
        *self.lock().entry(key).or_default() += 1;
    }

    /// The delivery is through.
    pub(super) fn forget(&self, key: Key) {
        self.lock().remove(&key);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<Key, u32>> {
        self.failed.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Uploads what lies beside a delivery; says whether the delivery may go.
pub(super) async fn send_ahead(session: &Session, delivery: &Delivery, path: &Path) -> bool {
    let key = (delivery.job_id, delivery.attempt);
    let Some(recorded) = delivery.frames.as_ref().filter(|_| !session.uploads.is_over(key)) else {
        return true;
    };
    let stream = path.with_extension(crate::outbox::FRAMES).join(STREAM);
    let sent = session.client.upload_frames(key.0, key.1, delivery.content.worker_id(), recorded, &stream);
    match sent.await {
        Ok(()) => session.uploads.done(key),
        Err(error) if error.is_transient() => {
            // Where the server is away, nothing counts against the frames.
            if session.client.is_there().await {
                session.uploads.failed(key);
            }
            tracing::debug!(%error, "frames were not uploaded");
            return session.uploads.is_over(key);
        }
        // Of a token the delivery will speak; it is not the frames' fault.
        Err(error) if error.is_about_access() => return true,
        Err(error) => {
            tracing::warn!(job = %key.0, attempt = key.1, %error, "the result goes without its frames");
            session.uploads.done(key);
        }
    }
    true
}
