//! The depth of the queue by needs, beside the workers that could claim the jobs.

use std::collections::BTreeSet;

use roost_api::forecast::DurationRange;
use roost_api::job::Needs;
use roost_api::queue::{NeedsDepth, QueueDepth};

use super::AppState;
use super::farm_view::FarmView;
use crate::forecast::Batch;
use crate::store::{StoreError, meets};

impl AppState {
    /// The depth of the queue, from the view of the farm that forecasts share.
    pub(crate) async fn queue_depth(&self) -> Result<QueueDepth, StoreError> {
        let view = self.farm_view().await?;
        let mut by_needs = Vec::new();
        for (needs, batch) in batches(&view) {
            by_needs.push(self.needs_depth(&view, needs, batch).await?);
        }
        by_needs.sort_by_key(|group| std::cmp::Reverse(group.jobs));
        let queued = by_needs.iter().map(|group| group.jobs).sum::<u64>();
        let running = view.running.len() as u64;
        Ok(QueueDepth { queued, running, total: queued + running, by_needs, made_at: view.made_at })
    }

    async fn needs_depth(
        &self,
        view: &FarmView,
        needs: Needs,
        batch: Batch,
    ) -> Result<NeedsDepth, StoreError> {
        let takers = view.workers.iter().filter(|(worker, _)| !worker.draining && meets(worker, &needs));
        let takers: Vec<_> = takers.collect();
        let mut backends: BTreeSet<&str> = takers.iter().map(|(worker, _)| worker.backend.as_str()).collect();
        if backends.is_empty() {
            // Workers to come may be like those that have finished runs.
            let of_need = |backend: &&str| needs.backend.as_ref().is_none_or(|needed| needed == backend);
            backends = view.finished.iter().map(|run| run.backend.as_str()).filter(of_need).collect();
        }
        let (speed, _) = self.speed(view, None, &backends).await?;
        let (low, high) = speed.range();
        Ok(NeedsDepth {
            jobs: batch.jobs,
            workers: takers.len() as u64,
            slots: takers.iter().map(|(_, slots)| u64::from(*slots)).sum(),
            free_slots: takers
                .iter()
                .map(|(worker, slots)| u64::from(slots.saturating_sub(worker.jobs)))
                .sum(),
            job_time: DurationRange {
                shortest_s: low * batch.estimate_s,
                longest_s: high * batch.estimate_s,
            },
            finished_runs: speed.runs() as u64,
            needs,
        })
    }
}

/// Number and mean cost of the queued jobs by needs.
fn batches(view: &FarmView) -> Vec<(Needs, Batch)> {
    let mut found: Vec<(Needs, Batch)> = Vec::new();
    for (group, estimate_s) in &view.groups {
        let batch = Batch { jobs: group.jobs, estimate_s: estimate_s.unwrap_or_else(|| view.typical_s()) };
        match found.iter_mut().find(|(needs, _)| *needs == group.needs) {
            Some((_, known)) => *known = known.with(batch),
            None => found.push((group.needs.clone(), batch)),
        }
    }
    found
}
