//! The view of the farm for forecasts: workers with their slots, running jobs, lengths of the queues, and measured speed.
//!
//! All requests share one view, which is used for 20 times as long as it took, but for 5 s at most. It costs 5 % of one reader, whatever
//! the number of requests, and more only if it takes more than 0.25 s.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use quick_cache::sync::Cache;
use roost_api::ids::SweepId;
use roost_api::job::Needs;
use roost_api::time::Timestamp;
use roost_solver::scenario;
use serde_json::Value;
use tokio::sync::Mutex;

use super::{AppState, MeshCacheError};
use crate::mesh;
use crate::queue::Rounds;
use crate::store::{OnlineWorker, QueueGroup, RunningJob, StoreError, StoredScenario, meets};

/// A view is used for this many times the duration of taking it.
const REUSE: u32 = 20;
/// Its maximum age: one that took long must not stay in use for minutes.
const MAX_AGE: Duration = Duration::from_secs(5);
/// Queues whose scenarios are sampled, by priority.
const SAMPLED_QUEUES: usize = 16;
/// Cost of a job of which nothing is known, in seconds.
const UNKNOWN_S: f64 = 60.0;
/// Scenarios whose cost is remembered.
const MAX_ESTIMATES: usize = 20_000;

/// A finished run.
#[derive(Clone, Debug)]
pub(crate) struct MeasuredRun {
    pub(crate) backend: String,
    /// From claim to result, in seconds.
    pub(crate) took_s: f64,
    /// Wall time by the check, in seconds.
    pub(crate) estimate_s: f64,
}

/// A view of the farm.
#[derive(Debug)]
pub(crate) struct FarmView {
    /// Online workers with their slots.
    pub(crate) workers: Vec<(OnlineWorker, u32)>,
    pub(crate) running: Vec<RunningJob>,
    /// Queued jobs that claims look at, with the mean cost of one, in seconds.
    pub(crate) groups: Vec<(QueueGroup, Option<f64>)>,
    pub(crate) rounds: Rounds,
    /// Finished runs.
    pub(crate) finished: Vec<MeasuredRun>,
    /// When its first part was read: later registrations may be missing.
    pub(crate) made_at: Timestamp,
    taken: Instant,
    cost: Duration,
}

/// The newest view, and costs of scenarios by their digest.
pub(crate) struct FarmViews {
    newest: Mutex<Option<Arc<FarmView>>>,
    estimates: Cache<String, f64>,
}

impl Default for FarmViews {
    fn default() -> Self {
        Self { newest: Mutex::default(), estimates: Cache::new(MAX_ESTIMATES) }
    }
}

impl FarmView {
    /// Whether a worker can take jobs with either needs.
    pub(crate) fn compete(&self, one: &Needs, other: &Needs) -> bool {
        let mut active = self.workers.iter().filter(|(worker, _)| !worker.draining);
        active.any(|(worker, _)| meets(worker, one) && meets(worker, other))
    }

    /// The cost of a job of which nothing is known, in seconds.
    pub(crate) fn typical_s(&self) -> f64 {
        let known: Vec<f64> = self.finished.iter().map(|run| run.estimate_s).collect();
        if known.is_empty() { UNKNOWN_S } else { known.iter().sum::<f64>() / known.len() as f64 }
    }

    /// Why no worker can take jobs with these needs.
    pub(crate) fn why_no_slot(&self, needs: &Needs) -> String {
        match self.workers.iter().any(|(worker, _)| !worker.draining) {
            true if self.compete(needs, needs) => "a worker is about to claim them".to_owned(),
            true => "no online worker has what the jobs need".to_owned(),
            false => "no worker is online".to_owned(),
        }
    }
}

impl AppState {
    /// A recent view of the farm. Of several requests, one takes it, and the others wait.
    pub(crate) async fn farm_view(&self) -> Result<Arc<FarmView>, StoreError> {
        let mut newest = self.farm_views.newest.lock().await;
        if let Some(view) =
            newest.as_ref().filter(|view| view.taken.elapsed() < MAX_AGE.min(REUSE * view.cost))
        {
            return Ok(view.clone());
        }
        let view = Arc::new(self.take_view().await?);
        *newest = Some(view.clone());
        Ok(view)
    }

    async fn take_view(&self) -> Result<FarmView, StoreError> {
        let (began, made_at) = (Instant::now(), self.clock.now());
        let workers = self.store.online_workers(made_at, self.config.lease).await?;
        let with_slots = |worker: OnlineWorker| {
            let slots = self.slots.of(&worker.id, &worker.backend, worker.threads, worker.jobs);
            (worker, slots)
        };
        let workers = workers.into_iter().map(with_slots).collect();
        let running = self.store.jobs_running().await?;
        let (queues, rounds) = self.store.queue_groups().await?;
        let mut groups = Vec::with_capacity(queues.len());
        for group in queues {
            let scenarios = if groups.len() < SAMPLED_QUEUES {
                self.store.sampled_queue(&group).await?
            } else {
                Vec::new()
            };
            groups.push((group, self.mean_estimate(&scenarios).await?));
        }
        let finished = self.measured_runs(None).await?;
        let (taken, cost) = (Instant::now(), began.elapsed());
        Ok(FarmView { workers, running, groups, rounds, finished, made_at, taken, cost })
    }

    /// Finished runs of a sweep, or of all jobs, as far as the check knows their cost.
    pub(crate) async fn measured_runs(&self, sweep: Option<SweepId>) -> Result<Vec<MeasuredRun>, StoreError> {
        let runs = self.store.finished_runs(sweep).await?;
        let scenarios: Vec<_> = runs.iter().map(|run| run.scenario.clone()).collect();
        let estimates = self.estimates(&scenarios).await?;
        let measured = runs.into_iter().filter_map(|run| {
            let estimate_s = *estimates.get(&run.scenario.digest)?;
            Some(MeasuredRun { backend: run.backend, took_s: run.took_s, estimate_s })
        });
        Ok(measured.collect())
    }

    /// The mean cost of scenarios by the check, in seconds; none without a known one.
    pub(crate) async fn mean_estimate(
        &self,
        scenarios: &[StoredScenario],
    ) -> Result<Option<f64>, StoreError> {
        let estimates = self.estimates(scenarios).await?;
        let known: Vec<f64> =
            scenarios.iter().filter_map(|one| estimates.get(&one.digest).copied()).collect();
        Ok((!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64))
    }

    /// Costs of scenarios by the check, in seconds, by digest. A scenario that the check refuses now is left out.
    async fn estimates(&self, scenarios: &[StoredScenario]) -> Result<HashMap<String, f64>, StoreError> {
        let (mut known, mut documents) = (HashMap::new(), HashMap::new());
        for scenario in scenarios {
            match self.farm_views.estimates.get(&scenario.digest) {
                Some(estimate_s) => drop(known.insert(scenario.digest.clone(), estimate_s)),
                None => drop(documents.insert(scenario.digest.clone(), scenario.body.clone())),
            }
        }
        if documents.is_empty() {
            return Ok(known);
        }
        let parsed = documents.into_iter().filter_map(|(digest, body)| {
            let document: Value = serde_json::from_str(&body).ok()?;
            Some((digest, document))
        });
        let (digests, documents): (Vec<String>, Vec<Value>) = parsed.unzip();
        let documents = Value::Array(documents);
        let meshes = match self.mesh_cache.meshes_of(&documents, &self.store).await {
            Ok(meshes) => meshes,
            Err(MeshCacheError::Store(error)) => return Err(error),
            // Too many at once: the scenarios without a mesh are known all the same.
            Err(_) => Default::default(),
        };
        let limits = self.config.limits;
        let check = move || {
            let documents = documents.as_array().into_iter().flatten();
            let estimate_s = |document: &Value| {
                let scenario = scenario::from_value(document).ok()?;
                let estimate_s = mesh::check(&scenario, &meshes, &limits).ok()?.wall_s;
                (estimate_s > 0.0).then_some(estimate_s)
            };
            documents.map(estimate_s).collect::<Vec<_>>()
        };
        let Ok(checked) = tokio::task::spawn_blocking(check).await else { return Ok(known) };
        for (digest, estimate_s) in digests.into_iter().zip(checked) {
            if let Some(estimate_s) = estimate_s {
                self.farm_views.estimates.insert(digest.clone(), estimate_s);
                known.insert(digest, estimate_s);
            }
        }
        Ok(known)
    }
}
