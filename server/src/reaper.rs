//! The reaper: the background tasks of a server.
//!
//! One task ends expired leases, attempts beyond `max_wall_s`, and pauses before a retry, and removes the
//! progress of ended jobs. The second removes checkpoints that are no longer needed. The third deletes what an
//! interrupted submission or deletion left, old events, answers, sweeps and jobs, and objects that nothing names. The fourth keeps the
//! temporary tables of a leader on PostgreSQL small.

use std::time::Duration;

use roost_api::job::AttemptOutcome;
use roost_api::time::Timestamp;

use crate::queue::JobChange;
use crate::repeated_failure::RepeatedFailure;
use crate::state::App;
use crate::store::{Expired, StoreError};

/// Interval of deletion.
const DELETE_EVERY: Duration = Duration::from_secs(600);

/// Interval at which the temporary tables of a leader on PostgreSQL are filled again.
const REFILL_EVERY: Duration = Duration::from_secs(60);

/// Interval of the removal of checkpoints.
const REMOVE_EVERY: Duration = Duration::from_secs(1);

/// Time after which jobs share a withdrawn fill again.
const WITHDRAWN: Duration = Duration::from_secs(3600);

/// After a downtime longer than this the clock may be wrong, and the server deletes nothing until it has run
/// for as long.
const DAY: Duration = Duration::from_secs(24 * 3600);

/// Runs all tasks until the server shuts down.
pub(crate) async fn run(app: App) {
    // The next start completes an interrupted deletion.
    let deleting = app.shutdown.run_until_cancelled(delete_old(&app));
    let removing = app.shutdown.run_until_cancelled(remove_checkpoints(&app));
    let refilling = app.shutdown.run_until_cancelled(refill_leader_tables(&app));
    tokio::join!(expire(&app), removing, deleting, refilling);
}

async fn expire(app: &App) {
    let mut checks = RepeatedFailure::of("checking leases");
    let interval = (app.config.lease / 4).clamp(Duration::from_millis(20), Duration::from_secs(1));
    let mut next = NextLook::default();
    while app.shutdown.run_until_cancelled(tokio::time::sleep(interval)).await.is_some() {
        checks.note(tick(app, &mut next).await);
    }
}

/// Removes the objects of checkpoints that were replaced or whose job has ended, and incomplete uploads of jobs that no longer run. A
/// task of its own, since a bucket may be slow.
async fn remove_checkpoints(app: &App) {
    let mut removals = RepeatedFailure::of("removing old checkpoints");
    loop {
        tokio::time::sleep(REMOVE_EVERY).await;
        removals.note(remove_unneeded(app).await);
    }
}

async fn refill_leader_tables(app: &App) {
    let mut refills = RepeatedFailure::of("filling the temporary tables");
    loop {
        tokio::time::sleep(REFILL_EVERY).await;
        refills.note(app.store.refill_leader_tables().await);
    }
}

async fn remove_unneeded(app: &App) -> Result<(), StoreError> {
    app.store.remove_unnamed_objects().await?;
    for uploads in [&app.checkpoint_uploads, &app.fill_uploads] {
        let uploading = uploads.jobs();
        if uploading.is_empty() {
            continue;
        }
        let running = app.store.running_of(&uploading).await?;
        // An upload that began meanwhile stays.
        let ended = uploading.into_iter().filter(|job| !running.contains(job));
        for part in uploads.take(ended) {
            app.store.discard(part).await;
        }
    }
    Ok(())
}

/// Deletes old data. A task of its own, since it may take long.
async fn delete_old(app: &App) {
    let mut clock = tokio::time::interval(DELETE_EVERY);
    clock.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut logged = None;
    loop {
        clock.tick().await;
        if let Err(error) = app.store.delete_leftovers().await {
            tracing::error!(error = error.as_dyn(), "finding hidden sweeps failed");
        }
        let doubt = clock_doubt(app);
        if let Some(reason) = doubt {
            if doubt != logged {
                tracing::error!("automatic deletion is paused: {reason}");
            }
            logged = doubt;
            continue;
        }
        logged = None;
        if let Err(error) = app.store.forget_before(ago(app, app.config.memory)).await {
            tracing::error!(error = error.as_dyn(), "deleting old events failed");
        }
        // For some time, a session that has expired is refused as such.
        if let Err(error) = app.store.forget_sessions(ago(app, app.config.memory)).await {
            tracing::error!(error = error.as_dyn(), "deleting expired sessions failed");
        }
        let (unused, withdrawn) = (ago(app, app.config.fill_max_age), ago(app, WITHDRAWN));
        match app.store.prune_fills(unused, withdrawn).await {
            Ok(0) => {}
            Ok(fills) => tracing::info!(fills, "deleted unused fills"),
            Err(error) => tracing::error!(error = error.as_dyn(), "deleting unused fills failed"),
        }
        if let Some(age) = app.config.prune_after {
            prune(app, age).await;
        }
        match app.store.forget_workers(ago(app, app.config.memory)).await {
            Ok(0) => {}
            Ok(workers) => {
                tracing::info!(workers, "deleted workers without stored attempts")
            }
            Err(error) => tracing::error!(error = error.as_dyn(), "deleting old workers failed"),
        }
        match app.store.sweep_objects(ago(app, DAY)).await {
            Ok(0) => {}
            Ok(objects) => tracing::info!(objects, "deleted objects that nothing names"),
            Err(error) => tracing::error!(error = error.as_dyn(), "deleting unnamed objects failed"),
        }
    }
}

fn ago(app: &App, time: Duration) -> Timestamp {
    app.clock.now().plus_ms(-ms(time))
}

fn ms(time: Duration) -> i64 {
    i64::try_from(time.as_millis()).unwrap_or(i64::MAX)
}

/// Why the clock may be wrong. A clock that is years ahead makes everything old enough for deletion.
fn clock_doubt(app: &App) -> Option<&'static str> {
    if app.clock.jump_ms().is_some() {
        return Some(
            "the clock has jumped since the server started: correct it, or restart the server if it is right",
        );
    }
    // The clock may have jumped while no server ran.
    let gap_ms = ms(app.config.prune_after.unwrap_or_default().max(DAY));
    let is_far = app.newest_at_start.is_some_and(|newest| newest.0 < app.clock.started().plus_ms(-gap_ms).0);
    (is_far && app.clock.uptime() < DAY).then_some(
        "at the start of the server, its clock was far ahead of the newest record: deletion starts after a day; `roost prune` works meanwhile",
    )
}

/// Deletes sweeps and jobs that ended longer ago than `age`.
async fn prune(app: &App, age: Duration) {
    match app.prune(ago(app, age)).await {
        Ok(pruned) if !pruned.is_empty() => {
            let (sweeps, jobs, meshes) = (pruned.sweeps.len(), pruned.jobs, pruned.meshes.len());
            tracing::info!(sweeps, jobs, meshes, "deleted old sweeps, jobs and meshes");
        }
        Ok(_) => {}
        Err(error) => tracing::error!(error = error.as_dyn(), "deleting old sweeps and jobs failed"),
    }
}

/// When leases and deadlines are looked at next. A look reads all running jobs. A lease that begins afterwards lasts longer than the pause
/// until the next look. The earlier deadline of a job that a late heartbeat took out of the queue may be noticed late, by half a lease at
/// most.
#[derive(Default)]
pub(crate) struct NextLook {
    /// On the clock of leases; none for now.
    due: Option<Timestamp>,
}

impl NextLook {
    fn is_due(&self, now: Timestamp) -> bool {
        self.due.is_none_or(|due| due <= now)
    }

    /// After a look that found this first end. Half a lease is left for claims that waited for the store.
    fn found(&mut self, first_end: Option<Timestamp>, now: Timestamp, lease: Duration) {
        let latest = now.plus_ms(ms(lease / 2));
        self.due = Some(first_end.map_or(latest, |end| end.min(latest)));
    }
}

/// Ends what has expired: leases, deadlines and pauses.
async fn expire_now(app: &App, next: &mut NextLook) -> Result<Expired, StoreError> {
    let now = app.clock.both();
    let has_ended = if next.is_due(now.lease) {
        let first_end = app.store.first_end().await?;
        next.found(first_end, now.lease, app.config.lease);
        first_end.is_some_and(|end| end <= now.lease)
    } else {
        false
    };
    if has_ended || app.store.has_ended_pause(now).await? {
        return app.store.expire(app.config.retry, now).await;
    }
    Ok(Expired::default())
}

/// Checks leases, deadlines and pauses once.
pub(crate) async fn tick(app: &App, next: &mut NextLook) -> Result<(), StoreError> {
    let until = app.clock.lease_now().plus_ms(ms(app.config.lease));
    if let Some(running) = app.store.renew_after_outage(until).await? {
        tracing::warn!(running, "PostgreSQL did not answer for a while: leases are renewed");
    }
    let passed = expire_now(app, next).await?;
    for (place, (job, change)) in passed.changes.iter().enumerate() {
        tracing::warn!(%job, ?change, "an attempt timed out or lost its lease");
        app.progress.remove(*job);
        let is_lost = place < passed.lost;
        app.metrics.attempt_ended(if is_lost { AttemptOutcome::Lost } else { AttemptOutcome::Timeout });
    }
    let requeued = |change: &JobChange| matches!(change, JobChange::Requeue { not_before: None, .. });
    // Jobs that waited for a fill of an ended attempt.
    let ended_fills = app.store.forget_ended_fills().await?;
    if ended_fills > 0 || passed.resumed > 0 || passed.changes.iter().any(|(_, change)| requeued(change)) {
        app.work.notify_waiters();
    }
    // Changes by `roost token` and `roost project` take effect within a second.
    app.follow_changes().await?;
    // A late heartbeat may have added the progress of a job that has ended.
    let known = app.progress.jobs();
    if !known.is_empty() {
        let running = app.store.running_of(&known).await?;
        known.into_iter().filter(|job| !running.contains(job)).for_each(|job| app.progress.remove(job));
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

    #[test]
    fn the_next_look_is_at_the_first_end_or_after_half_a_lease() {
        let mut next = NextLook::default();
        assert!(next.is_due(Timestamp(0)), "the first look is at once");
        let lease = Duration::from_secs(10);
        for (first_end, due) in
            [(Some(103_000), 103_000), (Some(109_000), 105_000), (None, 105_000), (Some(99_000), 99_000)]
        {
            next.found(first_end.map(Timestamp), Timestamp(100_000), lease);
            assert_eq!(
                (next.is_due(Timestamp(due - 1)), next.is_due(Timestamp(due))),
                (false, true),
                "{due}"
            );
        }
    }

    #[tokio::test]
    async fn progress_of_an_ended_job_is_removed() {
        let dir = tempfile::tempdir().unwrap();
        let listen = ([127, 0, 0, 1], 0).into();
        let config = ServerConfig { listen, data: dir.path().to_owned(), ..ServerConfig::default() };
        let server = Server::bind(config).await.unwrap();
        let progress = json!({"phase": "process", "time_s": 1.0, "simulated_s": 2.0, "fraction": 0.5,
            "subparticles": 9, "particle_steps": 10, "wall_s": 0.1, "discharged_kg": 3.0});
        server.app().progress.set(JobId::new(), None, serde_json::from_value(progress).unwrap());
        tick(&server.app(), &mut NextLook::default()).await.unwrap();
        assert_eq!(server.app().progress.jobs(), []);
        server.app().store.close().await;
    }
}
