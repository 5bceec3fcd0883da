//! Requests to stop a run.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

/// Interval at which a run that has not begun checks its stop flag.
const STOP_POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Why a run stops before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Stop {
    /// The job was cancelled; its partial result is kept.
    Cancel = 1,
    /// The worker stops and releases the attempt.
    Release,
    /// The attempt is stale: no report.
    Abandon,
    /// The run exceeded its wall time.
    Timeout,
    /// The job was paused; the attempt is released.
    Preempt,
}

/// A request to stop, which the solver checks with every progress report.
#[derive(Clone, Debug, Default)]
pub struct StopFlag(Arc<AtomicU8>);

impl StopFlag {
    /// Asks the run to stop. The first reason stays, except that `Abandon` beats all others.
    pub fn set(&self, why: Stop) {
        if why == Stop::Abandon {
            self.0.store(why as u8, Ordering::Relaxed);
        } else {
            let _ = self.0.compare_exchange(0, why as u8, Ordering::Relaxed, Ordering::Relaxed);
        }
    }

    /// The reason to stop, if any.
    pub fn get(&self) -> Option<Stop> {
        [Stop::Cancel, Stop::Release, Stop::Abandon, Stop::Timeout, Stop::Preempt]
            .into_iter()
            .find(|why| *why as u8 == self.0.load(Ordering::Relaxed))
    }

    /// Waits for a request to stop.
    pub(crate) async fn wait(&self) -> Stop {
        loop {
            if let Some(why) = self.get() {
                return why;
            }
            tokio::time::sleep(STOP_POLL_INTERVAL).await;
        }
    }
}
