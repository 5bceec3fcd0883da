//! Numbers of the jobs of projects, for listings.
//!
//! The count reads all queued jobs. All requests share one count, which is used for 20 times as long as it took: it costs at most 5 % of
//! one reader, whatever the number of requests.

use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::Mutex;

use super::AppState;
use crate::store::{ProjectCounts, StoreError};

/// A count is used for this many times the duration of taking it.
const REUSE: u32 = 20;

/// The newest count.
#[derive(Default)]
pub(crate) struct RecentCounts(Mutex<Option<Taken>>);

struct Taken {
    counts: Arc<ProjectCounts>,
    at: Instant,
    cost: Duration,
}

impl AppState {
    /// A recent count. Of several requests, one takes it, and the others wait.
    pub(crate) async fn project_counts(&self) -> Result<Arc<ProjectCounts>, StoreError> {
        let mut newest = self.recent_counts.0.lock().await;
        if let Some(taken) = newest.as_ref().filter(|taken| taken.at.elapsed() < REUSE * taken.cost) {
            return Ok(taken.counts.clone());
        }
        let began = Instant::now();
        let counts = Arc::new(self.store.project_counts().await?);
        *newest = Some(Taken { counts: counts.clone(), at: Instant::now(), cost: began.elapsed() });
        Ok(counts)
    }
}
