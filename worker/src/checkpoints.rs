//! Checkpoints of a run: the run's thread puts them into a slot, and another task takes and uploads them.

use std::fmt;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use roost_solver::Checkpoint;
use tokio::sync::Notify;

use crate::stop::Stop;

/// The newest checkpoint of a run that nobody has taken. Clones share it.
#[derive(Clone, Debug)]
pub struct CheckpointSlot(Arc<Shared>);

struct Shared {
    interval: Duration,
    /// Whether a cancelled run records one.
    at_cancel: bool,
    state: Mutex<State>,
    changed: Notify,
}

impl fmt::Debug for Shared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shared").field("interval", &self.interval).finish_non_exhaustive()
    }
}

struct State {
    newest: Option<Checkpoint>,
    taken_at: Instant,
    is_closed: bool,
}

impl CheckpointSlot {
    /// An empty slot for a checkpoint at every interval of wall time.
    pub fn new(interval: Duration) -> Self {
        Self::with(interval, false)
    }

    /// The same, with a last checkpoint when the run is cancelled.
    pub fn also_at_cancel(interval: Duration) -> Self {
        Self::with(interval, true)
    }

    fn with(interval: Duration, at_cancel: bool) -> Self {
        let state = State { newest: None, taken_at: Instant::now(), is_closed: false };
        Self(Arc::new(Shared { interval, at_cancel, state: Mutex::new(state), changed: Notify::new() }))
    }

    /// Whether the run shall record a checkpoint now: at the interval, and before it is handed back.
    pub(crate) fn wants(&self, stop: Option<Stop>) -> bool {
        match stop {
            Some(Stop::Release | Stop::Preempt) => true,
            Some(Stop::Cancel) => self.0.at_cancel,
            Some(Stop::Abandon | Stop::Timeout) => false,
            None => self.lock().taken_at.elapsed() >= self.0.interval,
        }
    }

    /// Replaces the checkpoint that nobody has taken.
    pub(crate) fn put(&self, checkpoint: Checkpoint) {
        let mut state = self.lock();
        (state.newest, state.taken_at) = (Some(checkpoint), Instant::now());
        self.0.changed.notify_one();
    }

    /// The run has ended: there will be no further checkpoint.
    pub fn close(&self) {
        self.lock().is_closed = true;
        self.0.changed.notify_one();
    }

    /// Waits for a checkpoint and takes it; none once the slot is closed and empty.
    pub async fn take(&self) -> Option<Checkpoint> {
        loop {
            {
                let mut state = self.lock();
                if state.newest.is_some() || state.is_closed {
                    return state.newest.take();
                }
            }
            self.0.changed.notified().await;
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The checkpoint that a run continues from.
pub struct Resume {
    /// Loads it; none if it cannot be used, and the run begins at zero.
    pub checkpoint: Pin<Box<dyn Future<Output = Option<Checkpoint>> + Send>>,
    /// Gets the reason when the solver refuses it. The run then begins at zero. Called in the run's thread. Without it the run
    /// fails.
    pub refused: Option<Box<dyn FnOnce(String) + Send>>,
}

impl fmt::Debug for Resume {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Resume")
    }
}
