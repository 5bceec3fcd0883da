//! Values computed from sweeps, cached for as long as the version of the sweep holds.

use std::sync::Arc;
use std::time::{Duration, Instant};

use quick_cache::sync::Cache;
use roost_api::ids::SweepId;

/// Maximum number of sweeps in a cache.
const MAX_SWEEPS: usize = 1000;

/// The newest value of each sweep.
pub(crate) struct SweepCache<T>(Cache<SweepId, Arc<Entry<T>>>);

struct Entry<T> {
    version: String,
    computed: Instant,
    value: T,
}

impl<T> Default for SweepCache<T> {
    fn default() -> Self {
        Self(Cache::new(MAX_SWEEPS))
    }
}

impl<T: Clone> SweepCache<T> {
    /// The value of this version.
    pub(crate) fn get(&self, id: SweepId, version: &str) -> Option<T> {
        self.find(id, |entry| entry.version == version)
    }

    /// The value of any version that was computed within this time.
    pub(crate) fn get_recent(&self, id: SweepId, age: Duration) -> Option<T> {
        self.find(id, |entry| entry.computed.elapsed() < age)
    }

    /// Stores a value that was computed after its version was read: it may be newer than the version, never
    /// older.
    pub(crate) fn insert(&self, id: SweepId, version: String, value: T) {
        self.0.insert(id, Arc::new(Entry { version, computed: Instant::now(), value }));
    }

    fn find(&self, id: SweepId, matches: impl FnOnce(&Entry<T>) -> bool) -> Option<T> {
        self.0.get(&id).filter(|entry| matches(entry)).map(|entry| entry.value.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_is_found_by_version_or_by_age_and_the_cache_is_bounded() {
        let (cache, id) = (SweepCache::default(), SweepId::new());
        assert_eq!(cache.get(id, "1"), None);
        cache.insert(id, "1".to_owned(), 7);
        let found = (cache.get(id, "1"), cache.get(id, "2"), cache.get(SweepId::new(), "1"));
        assert_eq!(found, (Some(7), None, None));
        let recent = (cache.get_recent(id, Duration::from_secs(60)), cache.get_recent(id, Duration::ZERO));
        assert_eq!(recent, (Some(7), None));
        cache.insert(id, "2".to_owned(), 8);
        assert_eq!((cache.get(id, "1"), cache.get(id, "2")), (None, Some(8)));
        for _ in 0..2 * MAX_SWEEPS {
            cache.insert(SweepId::new(), String::new(), 9);
        }
        assert!(cache.0.len() <= MAX_SWEEPS);
    }
}
