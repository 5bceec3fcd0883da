//! The reaper: ends leases that ran out, so that what a dead worker held is run by another.

use std::time::Duration;

use crate::app::App;
use crate::queue::JobChange;

/// Looks for expired leases until the server shuts down.
pub(crate) async fn run(app: App) {
    let interval = (app.config.lease / 4).clamp(Duration::from_millis(20), Duration::from_secs(1));
    while app.shutdown.run_until_cancelled(tokio::time::sleep(interval)).await.is_some() {
        match app.store.expire_leases(app.config.attempts, app.clock.lease_now()).await {
            Ok(changes) => {
                for (job, change) in &changes {
                    tracing::warn!(%job, ?change, "lease expired");
                    app.progress.forget(*job);
                }
                if changes.iter().any(|(_, change)| *change == JobChange::Requeue) {
                    app.work.notify_waiters();
                }
            }
            Err(error) => tracing::error!(%error, "leases could not be looked through"),
        }
    }
}
