//! The decider: the background task that grows studies.
//!
//! For each running study it reads the trials, decides on a thread of its own, and stores proposals and answer in one transaction. A
//! decision depends on the stored rows alone, so that a server that was killed goes on as if nothing had happened. No claim or result
//! waits for a decision, and one study with slow decisions does not hold up the others.

use std::collections::{HashMap, HashSet};
use std::pin::pin;
use std::time::Duration;

use futures_util::stream::{self, FuturesUnordered};
use futures_util::{Stream, StreamExt};
use roost_api::ids::SweepId;
use roost_api::study::{Driver, StudyState};
use roost_api::sweep::StateCounts;
use tokio::sync::Semaphore;
use tokio::time::{MissedTickBehavior, interval};

use crate::repeated_failure::RepeatedFailure;
use crate::state::App;
use crate::store::{AskedRuns, MAX_PROPOSALS, StoreError, StoredStudy};
use crate::study::Study;

/// Interval between looks at the trials of running studies.
const INTERVAL: Duration = Duration::from_millis(200);

/// Minimum number of queued runs that a study keeps, so that a worker finds the next one at once.
pub(crate) const MIN_QUEUED: usize = 4;

/// Studies that are decided about at once.
const AT_ONCE: usize = 2;

/// Runs until the server shuts down.
pub(crate) async fn run(app: App) {
    app.shutdown.run_until_cancelled(decide_always(&app)).await;
}

async fn decide_always(app: &App) {
    let places = Semaphore::new(AT_ONCE);
    decide_about(looks(app), |id, before| decide(app, id, before, &places)).await;
}

/// The running studies, found again and again.
fn looks(app: &App) -> impl Stream<Item = Result<Vec<SweepId>, StoreError>> {
    let mut ticks = interval(INTERVAL);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    stream::unfold(ticks, async move |mut ticks| {
        ticks.tick().await;
        Some((running_studies(app).await, ticks))
    })
}

/// Decides about the studies that each look finds, one decision about each at a time.
///
/// Looks and decisions are polled together. A decision that waits for a connection of the store may get it at any moment, and would
/// keep it from a look while nobody polls it: all reads of the server would then wait, until the wait for a connection times out.
async fn decide_about<F>(
    looks: impl Stream<Item = Result<Vec<SweepId>, StoreError>>,
    decide: impl Fn(SweepId, Option<Tally>) -> F,
) where
    F: Future<Output = Result<Option<Tally>, StoreError>>,
{
    let (mut seen, mut busy) = (HashMap::new(), HashSet::new());
    let mut decisions = FuturesUnordered::new();
    let mut failures = RepeatedFailure::of("looking at studies");
    let mut looks = pin!(looks);
    loop {
        tokio::select! {
            Some((id, outcome)) = decisions.next() => {
                busy.remove(&id);
                let outcome: Result<Option<Tally>, StoreError> = outcome;
                match outcome {
                    Ok(Some(tally)) => drop(seen.insert(id, tally)),
                    Ok(None) => {}
                    Err(error) => {
                        tracing::error!(error = error.as_dyn(), study = %id, "deciding about a study failed");
                    }
                }
            }
            found = looks.next() => {
                let Some(found) = found else { return };
                let Some(running) = failures.note(found) else { continue };
                seen.retain(|id, _| running.contains(id));
                for id in running.into_iter().filter(|id| busy.insert(*id)) {
                    let decision = decide(id, seen.get(&id).copied());
                    decisions.push(async move { (id, decision.await) });
                }
            }
        }
    }
}

async fn running_studies(app: &App) -> Result<Vec<SweepId>, StoreError> {
    app.store.expire_handed_out(app.clock.now()).await?;
    app.store.running_studies().await
}

/// The state on which a decision depends: it is made again when this has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Tally {
    counts: StateCounts,
    /// Queued jobs that are not paused.
    waiting: u64,
    max_runs: u32,
    /// Changes of its ranges and of its runs that are no jobs, and retries of its jobs.
    news: i64,
    driver: Driver,
}

impl Tally {
    /// Number of runs to propose: as many as run now shall wait. More would be chosen without the results of those that run.
    fn wanted(&self) -> usize {
        if self.driver == Driver::Client {
            return 0;
        }
        let (waiting, running) = (self.waiting as usize, self.counts.running as usize);
        running.max(MIN_QUEUED).saturating_sub(waiting).min(MAX_PROPOSALS)
    }

    /// Whether a decision could bring something new after an earlier one: a new answer, or further runs.
    fn is_news_after(&self, before: &Self) -> bool {
        let results = |tally: &Self| {
            (tally.counts.succeeded, tally.counts.failed, tally.counts.cancelled, tally.max_runs, tally.news)
        };
        let has_results = results(self) != results(before);
        has_results || (self != before && self.wanted() > 0)
    }
}

/// A study with what a decision about it depends on; none once it is deleted.
async fn with_tally(app: &App, id: SweepId) -> Result<Option<(StoredStudy, Tally)>, StoreError> {
    let Some(stored) = app.store.study(id).await? else { return Ok(None) };
    let (counts, waiting) = app.store.study_counts(id).await?;
    let tally =
        Tally { counts, waiting, max_runs: stored.max_runs, news: stored.news, driver: stored.driver };
    Ok(Some((stored, tally)))
}

/// Decides about a study if its runs have changed, when one of the places is free. Returns its runs before the decision, or none if the
/// decision was not stored.
async fn decide(
    app: &App,
    id: SweepId,
    before: Option<Tally>,
    places: &Semaphore,
) -> Result<Option<Tally>, StoreError> {
    let Some((_, tally)) = with_tally(app, id).await? else { return Ok(None) };
    if before.is_some_and(|before| !tally.is_news_after(&before)) {
        return Ok(before);
    }
    let _place = places.acquire().await;
    // Runs may have ended while the decision waited for its place, or the study was paused.
    let Some((stored, tally)) = with_tally(app, id).await? else { return Ok(None) };
    if stored.state != StudyState::Running {
        return Ok(None);
    }
    let mut trials = app.store.trials_of(id, 0..u32::MAX).await?;
    let observations = app.store.observations(id).await?;
    let present = stored.present()?;
    let study = match tokio::task::spawn_blocking(move || Study::stored(present)).await {
        Ok(Ok(study)) => study,
        Ok(Err(faults)) => return pause(app, id, &first_of(&faults)).await.map(|()| None),
        Err(error) => return pause(app, id, &error.to_string()).await.map(|()| None),
    };
    app.curve_points.complete(&app.store, &study, &mut trials).await?;
    let work = tokio::task::spawn_blocking(move || {
        let decided = study.decide(&trials, &observations, tally.wanted())?;
        Ok::<_, Vec<roost_api::Fault>>((study.sweep_spec(), decided))
    });
    let (sweep, decided) = match work.await {
        Ok(Ok(work)) => work,
        Ok(Err(faults)) => return pause(app, id, &first_of(&faults)).await.map(|()| None),
        Err(error) => return pause(app, id, &error.to_string()).await.map(|()| None),
    };
    let (count, finished) = (decided.trials.len(), decided.finished);
    let now = app.clock.now();
    let none = AskedRuns { request: None, runs: Vec::new(), expires_at: now };
    let made = app.store.store_decision(&stored, &sweep, decided, none, now).await?;
    let is_stored = made.is_some();
    if is_stored && count > 0 {
        app.work.notify_waiters();
    }
    if is_stored && let Some(end) = finished {
        tracing::info!(study = %id, %end, "a study is finished");
    }
    Ok(is_stored.then_some(tally))
}

fn first_of(faults: &[roost_api::Fault]) -> String {
    faults.first().map(ToString::to_string).unwrap_or_default()
}

/// Pauses a study that cannot be decided about: it would fail again at once.
pub(crate) async fn pause(app: &App, id: SweepId, reason: &str) -> Result<(), StoreError> {
    tracing::error!(study = %id, reason, "a study cannot go on and is paused");
    app.store.change_study(id, &[StudyState::Running], StudyState::Paused, Some(reason.to_owned())).await
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use tokio::task::yield_now;

    use super::*;

    /// Uses the only connection for a moment.
    async fn read(connections: &Semaphore) {
        let _connection = connections.acquire().await;
        yield_now().await;
    }

    #[tokio::test]
    async fn a_look_waits_for_no_connection_of_a_decision_that_stands_still() {
        let connections = Semaphore::new(1);
        let studies: Vec<SweepId> = (0..5).map(|_| SweepId::new()).collect();
        let looks = stream::unfold(0, async |look| {
            read(&connections).await;
            (look < 100).then(|| (Ok(studies.clone()), look + 1))
        });
        let decisions = Cell::new(0);
        let decide = async |_, _| {
            read(&connections).await;
            read(&connections).await;
            decisions.set(decisions.get() + 1);
            Ok(None)
        };
        let ended = tokio::time::timeout(Duration::from_secs(20), decide_about(looks, decide)).await;
        assert!(ended.is_ok(), "looks and decisions wait for each other");
        assert!(decisions.get() > studies.len(), "{}", decisions.get());
    }
}
