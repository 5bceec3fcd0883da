//! The memory of a graphics adapter, or of the machine, that the runs of a worker share. A run that does not fit goes back to the queue at once; the worker claims
//! no more until as much memory is free.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};

const MIB: u64 = 1 << 20;

/// Memory that runs share.
#[derive(Debug)]
pub(crate) struct MemoryBudget {
    /// A permit for each free MiB.
    free: Arc<Semaphore>,
    total_mib: u32,
    /// Memory that the last run asked for; 0 before the first.
    last_run_mib: AtomicU32,
    /// Runs that have started and not asked for memory yet.
    pending: watch::Sender<usize>,
}

/// A run that has started, until it has its memory or has ended.
#[derive(Debug)]
pub(crate) struct PendingRun(Arc<MemoryBudget>);

impl Drop for PendingRun {
    fn drop(&mut self) {
        self.0.pending.send_modify(|runs| *runs -= 1);
    }
}

/// The memory of one run, which returns to the budget on drop.
#[derive(Debug)]
pub(crate) struct MemoryShare(
    #[expect(dead_code, reason = "its drop returns the memory")] OwnedSemaphorePermit,
);

impl MemoryBudget {
    pub(crate) fn new(total_mib: u32) -> Self {
        Self {
            free: Arc::new(Semaphore::new(total_mib as usize)),
            total_mib,
            last_run_mib: AtomicU32::new(0),
            pending: watch::Sender::new(0),
        }
    }

    /// Announces a run that will ask for memory.
    pub(crate) fn announce_run(self: &Arc<Self>) -> PendingRun {
        self.pending.send_modify(|runs| *runs += 1);
        PendingRun(self.clone())
    }

    /// Takes memory for a run, if that much is free. A run larger than the budget takes all of it. A run that does not fit still sets the
    /// size that [`Self::runs_that_fit`] waits for.
    pub(crate) fn take(&self, bytes: u64) -> Option<MemoryShare> {
        let mib = u32::try_from(bytes.div_ceil(MIB)).unwrap_or(u32::MAX).clamp(1, self.total_mib);
        self.last_run_mib.store(mib, Relaxed);
        self.free.clone().try_acquire_many_owned(mib).ok().map(MemoryShare)
    }

    /// The number of further runs that fit, if they are as large as the last one; none before the first. Waits until one fits and no run is
    /// pending.
    pub(crate) async fn runs_that_fit(&self) -> Option<usize> {
        // An error is impossible: `self` holds the sender.
        let _ = self.pending.subscribe().wait_for(|runs| *runs == 0).await;
        let last_run = self.last_run_mib.load(Relaxed);
        if last_run == 0 {
            return None;
        }
        let _one = self.free.acquire_many(last_run).await.expect("the semaphore is never closed");
        Some(1 + self.free.available_permits() / last_run as usize)
    }
}

#[cfg(test)]
mod tests {
    use std::future::Future;
    use std::pin::pin;
    use std::task::{Context, Poll, Waker};

    use super::*;

    /// The value of a future that is ready.
    fn ready<T>(future: impl Future<Output = T>) -> Option<T> {
        match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(value) => Some(value),
            Poll::Pending => None,
        }
    }

    #[test]
    fn as_many_runs_fit_as_the_memory_holds() {
        let budget = Arc::new(MemoryBudget::new(100));
        assert_eq!(ready(budget.runs_that_fit()), Some(None), "no size is known yet");
        let pending = budget.announce_run();
        assert_eq!(ready(budget.runs_that_fit()), None, "the size of the pending run is unknown");
        let first = budget.take(30 * MIB).expect("it fits");
        drop(pending);
        assert_eq!(ready(budget.runs_that_fit()), Some(Some(2)));
        let second = budget.take(30 * MIB - 1).expect("it fits");
        let third = budget.take(40 * MIB).expect("it fits");
        assert_eq!(ready(budget.runs_that_fit()), None, "all memory is taken");
        drop(first);
        assert_eq!(ready(budget.runs_that_fit()), None, "30 MiB are too little for another of 40 MiB");
        drop(second);
        assert_eq!(ready(budget.runs_that_fit()), Some(Some(1)));
        drop(third);
        assert_eq!(ready(budget.runs_that_fit()), Some(Some(2)));
    }

    #[test]
    fn a_run_larger_than_the_budget_runs_alone_and_before_others() {
        let budget = Arc::new(MemoryBudget::new(100));
        let small = budget.take(1).expect("it fits");
        assert!(budget.take(1 << 40).is_none());
        assert_eq!(ready(budget.runs_that_fit()), None, "another run would come before the large one");
        drop(small);
        assert_eq!(ready(budget.runs_that_fit()), Some(Some(1)));
        let all = budget.take(1 << 40).expect("it is alone");
        assert!(budget.take(1).is_none());
        drop(all);
        assert!(budget.take(1).is_some());
    }
}
