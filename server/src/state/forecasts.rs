//! Why jobs wait, and forecasts of jobs, sweeps and studies: the view of the farm, given to the decisions of `queue` and `forecast`.

use std::collections::BTreeSet;

use roost_api::forecast::{
    CostForecast, Forecast, ForecastBasis, LearnedFrom, RunRange, WaitCount, WaitReason,
};
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{JobState, JobView, Needs};
use roost_api::sweep::SweepView;

use super::AppState;
use super::farm_view::{FarmView, MeasuredRun};
use crate::forecast::{
    Batch, Farm, Progressed, Queue, SHARE, Span, Spans, Speed, cost_without_workers, durations, forecast,
    no_forecast, range, with_spans,
};
use crate::queue::JobsBefore;
use crate::store::{StoreError, meets};

/// Number of finished runs of a sweep from which on it is forecast from these alone.
const ENOUGH_OF_SWEEP: usize = 5;
/// Seed of the simulated futures: the same facts give the same forecast.
const SEED: u64 = 1;

/// Running jobs that a forecast is about.
#[derive(Clone, Copy)]
enum OwnRunning {
    None,
    Job(JobId),
    Sweep(SweepId),
}

/// The jobs of a forecast.
struct Subject<'a> {
    needs: &'a Needs,
    /// The sweep whose finished runs are the best teachers.
    sweep: Option<SweepId>,
    own: OwnRunning,
    queue: Queue,
}

impl AppState {
    /// The forecast of a job.
    pub(crate) async fn job_forecast(&self, job: &JobView) -> Result<Forecast, StoreError> {
        let now = self.clock.now();
        let left = u64::from(!job.state.is_ended());
        let runs_left = RunRange { least: left, most: left };
        let none = |detail: &str| no_forecast(detail, runs_left, now);
        if job.state.is_ended() {
            return Ok(none("the job has ended"));
        }
        let view = self.farm_view().await?;
        let scenario = self.store.scenario_of(job.id).await?;
        let estimate_s = self.mean_estimate(scenario.as_slice()).await?.unwrap_or_else(|| view.typical_s());
        let stored = self.store.queued_job(job.id).await?;
        let Some(stored) = stored.filter(|_| job.state == JobState::Queued) else {
            let (needs, own) = (self.store.needs_of_job(job.id).await?, OwnRunning::Job(job.id));
            let subject = Subject { needs: &needs, sweep: job.sweep_id, own, queue: Queue::default() };
            let made = self.simulated(&view, &subject, estimate_s).await?;
            return Ok(made.map_or_else(
                || none("the job has just started"),
                |(spans, basis)| Forecast {
                    end: Some(range(now, spans.end)),
                    basis: Some(basis),
                    no_forecast: None,
                    ..none("")
                },
            ));
        };
        let waiting = self.waiting(job.id).await?;
        let waits =
            waiting.as_ref().map(|it| WaitCount { reason: it.reason, jobs: 1, detail: it.detail.clone() });
        let base = Forecast { waiting: waits.into_iter().collect(), ..none("") };
        if let Some(it) = waiting.filter(|it| is_stuck(it.reason)) {
            return Ok(Forecast { no_forecast: Some(it.detail), ..base });
        }
        let (_, ahead) = self.before(&view, stored.place, &stored.job.needs).await?;
        let queue = Queue { ahead, own: Batch { jobs: 1, estimate_s }, ..Queue::default() };
        let held_s =
            stored.job.retry_at.map_or(0.0, |at| (at.0 - self.clock.lease_now().0).max(0) as f64 / 1000.0);
        let subject = Subject { needs: &stored.job.needs, sweep: job.sweep_id, own: OwnRunning::None, queue };
        let made = self.simulated(&view, &subject, estimate_s).await?;
        Ok(match made {
            Some((spans, basis)) => with_spans(base, now, &spans.held(held_s), basis),
            None => Forecast { no_forecast: Some("no worker can take the job".to_owned()), ..base },
        })
    }

    /// The forecast of a sweep. Paused jobs are not part of its end.
    pub(crate) async fn sweep_forecast(&self, sweep: &SweepView) -> Result<Forecast, StoreError> {
        let left = sweep.counts.queued + sweep.counts.running;
        self.forecast_of(sweep, RunRange { least: left, most: left }).await
    }

    /// The forecast of a sweep with a range of runs that are left. Runs that do not exist yet count as queued ones.
    pub(crate) async fn forecast_of(
        &self,
        sweep: &SweepView,
        runs_left: RunRange,
    ) -> Result<Forecast, StoreError> {
        let (now, counts) = (self.clock.now(), sweep.counts);
        let none = |detail: &str| no_forecast(detail, runs_left, now);
        if runs_left.most == 0 {
            return Ok(none("all runs have ended"));
        }
        let view = self.farm_view().await?;
        let paused = sweep.paused.min(counts.queued);
        let (in_pause, first_in_pause) = self.store.jobs_in_pause(sweep.id).await?;
        let ends = self.store.sweep_ends(sweep.id).await?;
        let mut waiting = Vec::new();
        let mut add = |reason, jobs, detail: &str| {
            if jobs > 0 {
                waiting.push(WaitCount { reason, jobs, detail: detail.to_owned() });
            }
        };
        add(WaitReason::Paused, paused, "a user has paused them");
        if let Some(first) = first_in_pause
            && let Some(it) = self.waiting(first).await?
        {
            add(it.reason, in_pause, &it.detail);
        }
        let claimable = counts.queued.saturating_sub(paused + in_pause);
        let mut free = claimable;
        let (mut needs, mut stuck) = (None, None);
        let (mut ahead, mut between) = (Batch::default(), Batch::default());
        if let Some((first, first_place, last_place)) = ends
            && let Some(stored) = self.store.queued_job(first).await?
            && let Some(it) = self.waiting(first).await?
        {
            let needs = &*needs.insert(stored.job.needs);
            if is_stuck(it.reason) {
                add(it.reason, free, &it.detail);
                stuck = Some(it.detail);
            } else {
                let (for_fills, computing) =
                    self.store.waiting_for_fills(sweep.id, now, self.config.lease).await?;
                if let Some(computing) = computing {
                    let for_fills = for_fills.min(free);
                    add(
                        WaitReason::WaitingForFill,
                        for_fills,
                        &format!("job {computing} computes their filled state"),
                    );
                    free -= for_fills;
                }
                let is_first_behind = matches!(it.reason, WaitReason::Behind | WaitReason::WaitingForFill);
                if !is_first_behind {
                    add(it.reason, free.min(1), &it.detail);
                }
                let (before, batch) = self.before(&view, first_place, needs).await?;
                let rest = if is_first_behind { free } else { free.saturating_sub(1) };
                let first_behind =
                    if is_first_behind { before } else { JobsBefore { same: before.same + 1, ..before } };
                add(WaitReason::Behind, rest, &first_behind.in_words());
                let (last, all) = self.before(&view, last_place, needs).await?;
                ahead = batch;
                let others = last.total().saturating_sub(before.total() + claimable.saturating_sub(1));
                between = Batch { jobs: others, estimate_s: all.estimate_s };
            }
        }
        let base = Forecast { waiting, ..none("") };
        let is_paused = paused == counts.queued && counts.running == 0 && paused > 0;
        if stuck.is_some() || is_paused {
            let detail = stuck.unwrap_or_else(|| "every job that has not ended is paused".to_owned());
            return Ok(Forecast { no_forecast: Some(detail), ..base });
        }
        let needs = match needs {
            Some(needs) => needs,
            // No job is queued now; further ones need the same.
            None => self.store.needs_of_sweep(sweep.id).await?,
        };
        let scenarios = self.store.sampled_sweep(sweep.id, sweep.points).await?;
        let estimate_s = self.mean_estimate(&scenarios).await?.unwrap_or_else(|| view.typical_s());
        let unpaused = |runs: u64| runs.saturating_sub(counts.running + paused);
        let queue = |runs: u64| Queue { ahead, between, own: Batch { jobs: unpaused(runs), estimate_s } };
        let subject = |runs| Subject {
            needs: &needs,
            sweep: Some(sweep.id),
            own: OwnRunning::Sweep(sweep.id),
            queue: queue(runs),
        };
        let Some((spans, basis)) = self.simulated(&view, &subject(runs_left.most), estimate_s).await? else {
            return Ok(Forecast { no_forecast: Some(view.why_no_slot(&needs)), ..base });
        };
        let mut made = with_spans(base, now, &spans, basis);
        if runs_left.least < runs_left.most
            && let Some((fewest, _)) = self.simulated(&view, &subject(runs_left.least), estimate_s).await?
        {
            let low_s = if runs_left.least == 0 { 0.0 } else { fewest.end.low_s };
            made.end = Some(range(now, Span { low_s, high_s: spans.end.high_s }));
        }
        if counts.running + counts.ended() > 0 {
            made.start = None;
        }
        Ok(made)
    }

    /// The forecast of a document that is not submitted: a number of runs, each of which takes this long by the check.
    pub(crate) async fn cost_forecast(
        &self,
        (runs, estimate_s): (RunRange, f64),
        needs: &Needs,
        priority: i32,
    ) -> Result<CostForecast, StoreError> {
        let (now, view) = (self.clock.now(), self.farm_view().await?);
        let competing = view.groups.iter().filter(|(group, _)| view.compete(&group.needs, needs));
        let (mut ahead, mut between) = (Batch::default(), Batch::default());
        for (group, estimate_s) in competing {
            let batch = |jobs| Batch { jobs, estimate_s: estimate_s.unwrap_or_else(|| view.typical_s()) };
            match group.priority.cmp(&priority) {
                std::cmp::Ordering::Greater => ahead = ahead.with(batch(group.jobs)),
                // Sweeps alternate.
                std::cmp::Ordering::Equal => between = between.with(batch(group.jobs.min(runs.most))),
                std::cmp::Ordering::Less => {}
            }
        }
        let queue = |jobs| Queue { ahead, between, own: Batch { jobs, estimate_s } };
        let subject = |jobs| Subject { needs, sweep: None, own: OwnRunning::None, queue: queue(jobs) };
        let fewest = self.simulated(&view, &subject(runs.least), estimate_s).await?;
        let most = self.simulated(&view, &subject(runs.most), estimate_s).await?;
        let Some(((fewest, _), (most, basis))) = fewest.zip(most) else {
            return Ok(cost_without_workers(runs, estimate_s, view.why_no_slot(needs)));
        };
        let span = Span { low_s: fewest.end.low_s, high_s: most.end.high_s };
        Ok(CostForecast {
            runs,
            processor: Some(durations(Span { low_s: fewest.work.low_s, high_s: most.work.high_s })),
            duration: Some(durations(span)),
            end: Some(range(now, span)),
            no_forecast: None,
            basis: Some(basis),
        })
    }

    /// Simulates the farm as some jobs see it. None without a slot for them.
    async fn simulated(
        &self,
        view: &FarmView,
        subject: &Subject<'_>,
        estimate_s: f64,
    ) -> Result<Option<(Spans, ForecastBasis)>, StoreError> {
        let now = self.clock.now();
        let is_own = |job: JobId, sweep: Option<SweepId>| match subject.own {
            OwnRunning::None => false,
            OwnRunning::Job(own) => own == job,
            OwnRunning::Sweep(own) => sweep == Some(own),
        };
        let fitting =
            view.workers.iter().filter(|(worker, _)| !worker.draining && meets(worker, subject.needs));
        let fitting: Vec<_> = fitting.collect();
        let ids: BTreeSet<&str> = fitting.iter().map(|(worker, _)| worker.id.as_str()).collect();
        let running = view.running.iter().filter_map(|job| {
            let is_own = is_own(job.id, job.sweep);
            let progress = self.progress.done(job.id);
            let elapsed_s = (now.0 - job.started_at.0).max(0) as f64 / 1000.0;
            let (done, elapsed_s) = progress.map_or((None, elapsed_s), |(done, wall_s)| (Some(done), wall_s));
            (is_own || ids.contains(job.worker.as_str())).then_some(Progressed {
                elapsed_s,
                done,
                estimate_s,
                is_own,
            })
        });
        let running: Vec<Progressed> = running.collect();
        let has_own = running.iter().any(|job| job.is_own);
        if matches!(subject.own, OwnRunning::Job(_)) && !has_own {
            return Ok(None);
        }
        let slots: usize = fitting.iter().map(|(_, slots)| *slots as usize).sum();
        // The worker of a running job may be draining.
        let slots = slots.max(usize::from(has_own));
        let backends = fitting.iter().map(|(worker, _)| worker.backend.as_str()).collect();
        let (speed, learned_from) = self.speed(view, subject.sweep, &backends).await?;
        let basis = ForecastBasis {
            workers: fitting.len() as u64,
            slots: slots as u64,
            finished_runs: speed.runs() as u64,
            learned_from,
            time_ratio: speed.median(),
            share: SHARE,
        };
        let (farm, queue) = (Farm { slots, running }, subject.queue);
        let simulate = move || forecast(&farm, &queue, &speed, SEED);
        let spans = tokio::task::spawn_blocking(simulate).await.ok().flatten();
        Ok(spans.map(|spans| (spans, basis)))
    }

    /// The speed by finished runs of the sweep where there are enough, else of the backends, else a guess.
    pub(super) async fn speed(
        &self,
        view: &FarmView,
        sweep: Option<SweepId>,
        backends: &BTreeSet<&str>,
    ) -> Result<(Speed, LearnedFrom), StoreError> {
        let of = |runs: &[MeasuredRun], backends: Option<&BTreeSet<&str>>| {
            let runs =
                runs.iter().filter(|run| backends.is_none_or(|known| known.contains(run.backend.as_str())));
            Speed::learned(runs.map(|run| (run.took_s, run.estimate_s)))
        };
        if let Some(sweep) = sweep {
            let speed = of(&self.measured_runs(Some(sweep)).await?, None);
            if speed.runs() >= ENOUGH_OF_SWEEP {
                return Ok((speed, LearnedFrom::Sweep));
            }
        }
        let speed = of(&view.finished, Some(backends));
        let learned_from = if speed.runs() > 0 { LearnedFrom::Backend } else { LearnedFrom::Nothing };
        Ok((speed, learned_from))
    }
}

/// Whether a job with this reason starts at no time that could be named.
fn is_stuck(reason: WaitReason) -> bool {
    let none_claims = matches!(reason, WaitReason::Paused | WaitReason::BudgetUsed);
    none_claims || matches!(reason, WaitReason::NoWorker | WaitReason::NoFittingWorker)
}
