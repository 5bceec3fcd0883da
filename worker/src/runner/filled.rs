//! Filled states of runs: where a run starts from one, and where it leaves its own.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use roost_api::job::{AttemptOutcome, FilledBy};
use roost_solver::{Checked, Checkpoint};
use tokio::sync::oneshot;

use super::{Extras, RunEnd, thread_ended};
use crate::checkpoints::Resume;
use crate::device::Device;
use crate::fills::{FillCache, FillTurn, ServerFill, is_fill_of};

/// The state from which a run starts.
pub(super) struct Start {
    pub(super) resume: Option<Resume>,
    pub(super) fills: Option<Fills>,
}

/// Where a run finds a filled state.
pub(super) struct Fills {
    server: Option<ServerFill>,
    filled: Filled,
}

impl Extras {
    /// Takes what the run starts from. Runs with frames share no fill, since frames show it.
    pub(super) fn start(&mut self) -> (Start, Filled) {
        let cache = self.fills.take().filter(|_| self.frames.is_none());
        let server = self.server_fill.take();
        let filled = Filled::new(cache.clone());
        let fills = cache.map(|_| Fills { server, filled: filled.clone() });
        (Start { resume: self.resume.take(), fills }, filled)
    }
}

/// Gets the reason when the solver refuses a filled state.
pub(super) type Refused = Box<dyn FnOnce(String) + Send>;

impl Fills {
    /// The run continues from a checkpoint, which may be older than its fill.
    pub(super) fn keep(self) {
        self.filled.lock().upload = self.server.map(|server| server.upload);
    }

    /// The filled state that the run starts from, of this worker or of the server, and the function that discards a refused one. A run
    /// without one fills by itself. Other runs of this process with the same fill wait for it.
    pub(super) async fn load(
        self,
        device: &Device,
        checked: &Checked,
    ) -> Result<(Option<Checkpoint>, Option<Refused>), RunEnd> {
        let Self { server, filled } = self;
        let stamp = device.stamp(checked).map_err(|why| RunEnd::failed(AttemptOutcome::Worker, why))?;
        let Some(cache) = filled.lock().cache.clone() else { return Ok((None, None)) };
        let Some(turn) = cache.turn(&stamp).await else { return Ok((None, None)) };
        let own = blocking({
            let (cache, stamp) = (cache.clone(), stamp.clone());
            move || cache.load(&stamp)
        })
        .await?;
        let is_own = own.is_some();
        let (mut found, mut withdraw) = (own, None);
        if let Some(ServerFill { download, upload, refused }) = server {
            match (download, &found) {
                // The server lacks it: other workers need not compute it.
                (None, Some(own)) => drop(upload.send(own.clone())),
                (Some(_), Some(_)) => {}
                (download, None) => {
                    filled.lock().upload = Some(upload);
                    if let Some(download) = download {
                        (found, withdraw) = (download.await, Some(refused));
                    }
                }
            }
        }
        if found.is_none() {
            filled.will_fill(turn);
            return Ok((None, None));
        }
        filled.lock().filled_by = Some(FilledBy::Shared);
        let refused: Refused = Box::new({
            let (cache, stamp, filled) = (cache.clone(), stamp.clone(), filled.clone());
            move |reason: String| {
                tracing::warn!(reason, "a filled state was refused; the hopper is filled again");
                cache.discard(&stamp);
                if let Some(withdraw) = withdraw {
                    withdraw(reason);
                }
                filled.lock().filled_by = Some(FilledBy::Attempt);
            }
        });
        match found {
            Some(found) if is_own => Ok((Some(found), Some(refused))),
            Some(found) if is_fill_of(&found, &stamp) => {
                let kept = move || {
                    keep(&cache, &found);
                    found
                };
                Ok((Some(blocking(kept).await?), Some(refused)))
            }
            _ => {
                refused("it is not the fill of this run".to_owned());
                Ok((None, None))
            }
        }
    }
}

async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, RunEnd> {
    tokio::task::spawn_blocking(work).await.map_err(thread_ended)
}

fn keep(cache: &FillCache, filled: &Checkpoint) {
    if let Err(error) = cache.store(filled) {
        tracing::warn!(%error, "a filled state was not stored");
    }
}

/// Keeps the filled state of a run beside it. Clones share it.
#[derive(Clone, Debug)]
pub(super) struct Filled(Arc<Mutex<State>>);

#[derive(Debug)]
struct State {
    /// Without one nothing is kept.
    cache: Option<FillCache>,
    /// Takes the fill for the server.
    upload: Option<oneshot::Sender<Checkpoint>>,
    /// Held until the fill is kept.
    turn: Option<FillTurn>,
    filled_by: Option<FilledBy>,
    storing: Option<std::thread::JoinHandle<()>>,
}

impl Filled {
    fn new(cache: Option<FillCache>) -> Self {
        let (upload, turn, filled_by, storing) = (None, None, None, None);
        Self(Arc::new(Mutex::new(State { cache, upload, turn, filled_by, storing })))
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The run fills by itself. Others get their turn when its fill is kept.
    fn will_fill(&self, turn: FillTurn) {
        let mut state = self.lock();
        (state.turn, state.filled_by) = (Some(turn), Some(FilledBy::Attempt));
    }

    pub(super) fn is_wanted(&self) -> bool {
        self.lock().cache.is_some()
    }

    /// Where the filled state came from; none before it is known, and for runs that share none.
    pub(super) fn filled_by(&self) -> Option<FilledBy> {
        self.lock().filled_by
    }

    pub(super) fn store(&self, filled: Checkpoint) {
        let mut state = self.lock();
        let Some(cache) = state.cache.clone() else { return };
        let (upload, turn) = (state.upload.take(), state.turn.take());
        state.storing = Some(std::thread::spawn(move || {
            keep(&cache, &filled);
            if let Some(upload) = upload {
                drop(upload.send(filled));
            }
            drop(turn);
        }));
    }

    /// Waits until it is kept. A run that has not filled leaves none.
    pub(super) fn finish(&self) {
        let (storing, _, _) = {
            let mut state = self.lock();
            (state.storing.take(), state.upload.take(), state.turn.take())
        };
        if let Some(storing) = storing {
            let _ = storing.join();
        }
    }
}
