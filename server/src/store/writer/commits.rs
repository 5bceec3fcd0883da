//! The number of commits, for caches of what readers see.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// After this time without a transaction, another server may lead, and write. The writer of PostgreSQL makes one every two seconds.
pub(super) const ALONE: Duration = Duration::from_secs(5);

/// Counts the commits of the writer. Readers can see a commit before the writer knows of it: in between, no number is settled.
#[derive(Clone, Default)]
pub(in crate::store) struct Commits {
    begun: Arc<AtomicU64>,
    ended: Arc<AtomicU64>,
    /// The begin of the last transaction on PostgreSQL.
    last: Arc<Mutex<Option<Instant>>>,
}

impl Commits {
    /// Notes that a transaction on PostgreSQL has begun, which was asked for then: no other server had written before.
    pub(super) fn note_alone(&self, asked: Instant) {
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(asked);
    }

    fn is_alone(&self) -> bool {
        let last = *self.last.lock().unwrap_or_else(PoisonError::into_inner);
        last.is_none_or(|last| last.elapsed() < ALONE)
    }

    /// Notes that the statement of a commit starts.
    pub(super) fn begin(&self) {
        self.begun.fetch_add(1, Ordering::SeqCst);
    }

    /// Notes that the last commit is visible, or will never be.
    pub(super) fn end(&self) {
        self.ended.store(self.begun.load(Ordering::SeqCst), Ordering::SeqCst);
    }

    /// Number of commits that have ended.
    pub(in crate::store) fn count(&self) -> u64 {
        self.ended.load(Ordering::SeqCst)
    }

    /// Number of commits that readers can see; none during a commit, and none while another server may write.
    pub(in crate::store) fn settled(&self) -> Option<u64> {
        let ended = self.count();
        (self.begun.load(Ordering::SeqCst) == ended && self.is_alone()).then_some(ended)
    }
}
