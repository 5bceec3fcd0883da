//! The reaper: ends leases that ran out, so that what a dead worker held is run by another, runs that are long past their
//! `max_wall_s`, and pauses before another attempt; clears the progress of jobs that run no longer, and objects that nothing names.

use std::time::Duration;

use roost_api::job::AttemptOutcome;
use roost_api::time::Timestamp;

use crate::app::App;
use crate::queue::JobChange;
use crate::store::StoreError;

/// Old events and answers are cleared away so often.
const CLEAR_EVERY: Duration = Duration::from_secs(600);

/// A server that was stopped for no longer than this is not taken for one whose clock has jumped. One that was stopped for longer
/// deletes nothing until it has run for so long.
const DAY: Duration = Duration::from_secs(24 * 3600);

/// Looks for what has run out, and beside it clears away what nobody needs, until the server shuts down.
pub(crate) async fn run(app: App) {
    // What is deleted half is gone on with at the next start.
    let clearing = app.shutdown.run_until_cancelled(clear(&app));
    tokio::join!(expire(&app), clearing);
}

async fn expire(app: &App) {
    let interval = (app.config.lease / 4).clamp(Duration::from_millis(20), Duration::from_secs(1));
    while app.shutdown.run_until_cancelled(tokio::time::sleep(interval)).await.is_some() {
        if let Err(error) = tick(app).await {
            tracing::error!(error = error.as_dyn(), "leases could not be looked through");
        }
    }
}

/// May take long, while leases must not wait.
async fn clear(app: &App) {
    let mut clock = tokio::time::interval(CLEAR_EVERY);
    clock.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut said = None;
    loop {
        clock.tick().await;
        let doubt = doubt(app);
        if doubt.is_some() {
            if doubt != said {
                tracing::error!("nothing old is deleted by itself: {}", doubt.unwrap_or_default());
            }
            said = doubt;
            continue;
        }
        said = None;
        if let Err(error) = app.store.forget_before(ago(app, app.config.memory)).await {
            tracing::error!(error = error.as_dyn(), "old events could not be cleared away");
        }
        if let Some(age) = app.config.prune_after {
            prune(app, age).await;
        }
        match app.store.forget_workers(ago(app, app.config.memory)).await {
            Ok(0) => {}
            Ok(workers) => {
                tracing::info!(workers, "removed workers that are gone and ran nothing that is kept")
            }
            Err(error) => tracing::error!(error = error.as_dyn(), "workers could not be looked through"),
        }
        match app.store.sweep_objects(ago(app, DAY)).await {
            Ok(0) => {}
            Ok(objects) => tracing::info!(objects, "removed objects that nothing names"),
            Err(error) => tracing::error!(error = error.as_dyn(), "objects could not be looked through"),
        }
    }
}

fn ago(app: &App, time: Duration) -> Timestamp {
    app.clock.now().plus_ms(-ms(time))
}

fn ms(time: Duration) -> i64 {
    i64::try_from(time.as_millis()).unwrap_or(i64::MAX)
}

/// Why the clock may be wrong: one that is years ahead makes everything old enough to be deleted.
fn doubt(app: &App) -> Option<&'static str> {
    if app.clock.jump_ms().is_some() {
        return Some(
            "the clock has jumped since the server started; correct it, or restart the server if it is right",
        );
    }
    // A clock that jumped while no server ran.
    let gap_ms = ms(app.config.prune_after.unwrap_or_default().max(DAY));
    let is_far = app.newest_at_start.is_some_and(|newest| newest.0 < app.clock.started().plus_ms(-gap_ms).0);
    (is_far && app.clock.uptime() < DAY).then_some(
        "when the server started, its clock was far past the newest record; it waits for a day, and `roost prune` works meanwhile",
    )
}

/// Deletes what ended longer ago than `age`.
async fn prune(app: &App, age: Duration) {
    match app.prune(ago(app, age)).await {
        Ok(gone) if !gone.is_empty() => {
            let (sweeps, jobs, meshes) = (gone.sweeps.len(), gone.jobs, gone.meshes.len());
            tracing::info!(sweeps, jobs, meshes, "deleted what ended long ago");
        }
        Ok(_) => {}
        Err(error) => tracing::error!(error = error.as_dyn(), "what ended long ago could not be deleted"),
    }
}

async fn tick(app: &App) -> Result<(), StoreError> {
    let passed = app.store.pass_time(app.config.retry, app.clock.both()).await?;
    for (place, (job, change)) in passed.changes.iter().enumerate() {
        tracing::warn!(%job, ?change, "an attempt ran out of time");
        app.progress.forget(*job);
        let is_lost = place < passed.lost;
        app.metrics.attempt_ended(if is_lost { AttemptOutcome::Lost } else { AttemptOutcome::Timeout });
    }
    let requeued = |change: &JobChange| matches!(change, JobChange::Requeue { not_before: None, .. });
    if passed.rested > 0 || passed.changes.iter().any(|(_, change)| requeued(change)) {
        app.work.notify_waiters();
    }
    // What `roost token` does shall be felt at once, or nearly.
    app.access.update(app.store.tokens().await?);
    // A beat that was answered before the job ended may note its progress after.
    let shown = app.progress.jobs();
    if !shown.is_empty() {
        let running = app.store.running_of(&shown).await?;
        shown.into_iter().filter(|job| !running.contains(job)).for_each(|job| app.progress.forget(job));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use roost_api::ids::JobId;
    use serde_json::json;

    use super::*;
    use crate::config::ServerConfig;
    use crate::server::Server;

    #[tokio::test]
    async fn progress_of_a_job_that_does_not_run_is_cleared() {
        let dir = tempfile::tempdir().unwrap();
        let listen = ([127, 0, 0, 1], 0).into();
        let config = ServerConfig { listen, data: dir.path().to_owned(), ..ServerConfig::default() };
        let server = Server::bind(config).await.unwrap();
        let progress = json!({"phase": "process", "time_s": 1.0, "simulated_s": 2.0, "fraction": 0.5,
            "subparticles": 9, "particle_steps": 10, "wall_s": 0.1, "discharged_kg": 3.0});
        server.app.progress.set(JobId::new(), None, serde_json::from_value(progress).unwrap());
        tick(&server.app).await.unwrap();
        assert_eq!(server.app.progress.jobs(), []);
        server.app.store.close().await;
    }
}
