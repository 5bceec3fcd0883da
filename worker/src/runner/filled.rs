//! Filled states of runs: where a run starts from one, and where it leaves its own.

use roost_api::job::AttemptOutcome;
use roost_solver::{Checked, Checkpoint};

use super::{Extras, RunEnd, thread_ended};
use crate::checkpoints::Resume;
use crate::device::Device;
use crate::fills::FillCache;

/// What a run starts from.
pub(super) struct Start {
    pub(super) resume: Option<Resume>,
    pub(super) fills: Option<FillCache>,
}

impl Extras {
    /// Takes what the run starts from.
    pub(super) fn start(&mut self) -> Start {
        Start { resume: self.resume.take(), fills: self.fills.clone().filter(|_| self.frames.is_none()) }
    }
}

/// Gets the reason when the solver refuses a filled state.
pub(super) type Refused = Box<dyn FnOnce(String) + Send>;

/// The filled state that a run starts from, if the cache has it, and the function that deletes a refused one.
pub(super) async fn load(
    cache: FillCache,
    device: &Device,
    checked: &Checked,
) -> Result<(Option<Checkpoint>, Refused), RunEnd> {
    let stamp = device.stamp(checked).map_err(|why| RunEnd::failed(AttemptOutcome::Worker, why))?;
    let discarding = (cache.clone(), stamp.clone());
    let refused = move |reason: String| {
        tracing::warn!(reason, "a filled state was refused; the hopper is filled again");
        discarding.0.discard(&discarding.1);
    };
    let filled = tokio::task::spawn_blocking(move || cache.load(&stamp)).await.map_err(thread_ended)?;
    Ok((filled, Box::new(refused)))
}

/// Stores the filled state of a run beside it.
pub(super) struct Filled {
    cache: Option<FillCache>,
    storing: Option<std::thread::JoinHandle<()>>,
}

impl Filled {
    /// Without a cache nothing is stored.
    pub(super) fn new(cache: Option<FillCache>) -> Self {
        Self { cache, storing: None }
    }

    pub(super) fn is_wanted(&self) -> bool {
        self.cache.is_some()
    }

    pub(super) fn store(&mut self, filled: Checkpoint) {
        let cache = self.cache.clone();
        self.storing = cache.map(|cache| {
            std::thread::spawn(move || {
                if let Err(error) = cache.store(&filled) {
                    tracing::warn!(%error, "a filled state was not stored");
                }
            })
        });
    }

    /// Waits until it is stored.
    pub(super) fn finish(&mut self) {
        if let Some(storing) = self.storing.take() {
            let _ = storing.join();
        }
    }
}
