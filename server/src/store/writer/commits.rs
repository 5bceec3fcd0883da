//! The number of commits, for caches of what readers see.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Counts the commits of the writer. Readers can see a commit before the writer knows of it: in between, no number is settled.
#[derive(Clone, Default)]
pub(in crate::store) struct Commits {
    begun: Arc<AtomicU64>,
    ended: Arc<AtomicU64>,
}

impl Commits {
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

    /// Number of commits that readers can see; none during a commit.
    pub(in crate::store) fn settled(&self) -> Option<u64> {
        let ended = self.count();
        (self.begun.load(Ordering::SeqCst) == ended).then_some(ended)
    }
}
