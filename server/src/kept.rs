//! What was worked out of sweeps and holds while their version is the same: shared by all who ask meanwhile.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use roost_api::ids::SweepId;

/// So many are remembered; then all are forgotten.
const KEPT: usize = 1000;

/// The newest of each sweep.
pub(crate) struct Kept<T>(Mutex<HashMap<SweepId, Entry<T>>>);

struct Entry<T> {
    version: String,
    since: Instant,
    value: T,
}

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<T: Clone> Kept<T> {
    /// What was worked out of this version.
    pub(crate) fn get(&self, id: SweepId, version: &str) -> Option<T> {
        self.find(id, |entry| entry.version == version)
    }

    /// What was worked out within this time, of whichever version.
    pub(crate) fn within(&self, id: SweepId, age: Duration) -> Option<T> {
        self.find(id, |entry| entry.since.elapsed() < age)
    }

    /// Remembers what was worked out after its version was looked up: it may be newer than that, and is never older.
    pub(crate) fn put(&self, id: SweepId, version: String, value: T) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() >= KEPT {
            kept.clear();
        }
        kept.insert(id, Entry { version, since: Instant::now(), value });
    }

    fn find(&self, id: SweepId, is_right: impl FnOnce(&Entry<T>) -> bool) -> Option<T> {
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.get(&id).filter(|entry| is_right(entry)).map(|entry| entry.value.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_counts_for_its_version_or_for_a_moment() {
        let (kept, id) = (Kept::default(), SweepId::new());
        assert_eq!(kept.get(id, "1"), None);
        kept.put(id, "1".to_owned(), 7);
        assert_eq!(
            (kept.get(id, "1"), kept.get(id, "2"), kept.get(SweepId::new(), "1")),
            (Some(7), None, None)
        );
        assert_eq!(
            (kept.within(id, Duration::from_secs(60)), kept.within(id, Duration::ZERO)),
            (Some(7), None)
        );
        kept.put(id, "2".to_owned(), 8);
        assert_eq!((kept.get(id, "1"), kept.get(id, "2")), (None, Some(8)));
        for _ in 0..2 * KEPT {
            kept.put(SweepId::new(), String::new(), 9);
        }
        assert!(kept.0.lock().unwrap().len() <= KEPT);
    }
}
