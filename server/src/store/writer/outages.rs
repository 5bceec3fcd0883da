//! Times in which no heartbeat could be stored, so that no lease may expire because of them.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// A transaction, or a wait for one, that takes longer is an outage. Only PostgreSQL has outages. Tests run on busy machines.
pub(in crate::store) const STALL: Duration = Duration::from_secs(if cfg!(test) { 30 } else { 5 });

/// Counts outages: new connections, failed transactions and stalls. Leases are renewed after each.
#[derive(Default)]
pub(in crate::store) struct Outages {
    noted: AtomicU64,
    /// Those whose leases are renewed.
    mended: AtomicU64,
}

impl Outages {
    /// Notes one.
    pub(in crate::store) fn note(&self) {
        self.noted.fetch_add(1, Ordering::AcqRel);
    }

    /// The number of outages, if leases are not yet renewed after the newest.
    pub(in crate::store) fn unmended(&self) -> Option<u64> {
        let noted = self.noted.load(Ordering::Acquire);
        (noted > self.mended.load(Ordering::Acquire)).then_some(noted)
    }

    /// Leases are renewed after this number of outages.
    pub(in crate::store) fn mend(&self, noted: u64) {
        self.mended.fetch_max(noted, Ordering::AcqRel);
    }
}
