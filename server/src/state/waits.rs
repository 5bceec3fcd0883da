//! Why queued jobs wait, and which jobs come before them.

use roost_api::forecast::{WaitReason, Waiting};
use roost_api::ids::JobId;
use roost_api::job::Needs;

use super::AppState;
use super::farm_view::FarmView;
use crate::forecast::Batch;
use crate::queue::{JobsBefore, why_waiting};
use crate::store::{CountedJobs, QueueGroup, QueuePlace, StoreError, by_owner};

/// Queues of one owner in which the jobs before a place are counted.
const COUNTED_QUEUES: usize = 32;

impl AppState {
    /// Why a queued job waits; none in any other state.
    pub(crate) async fn waiting(&self, id: JobId) -> Result<Option<Waiting>, StoreError> {
        let Some(stored) = self.store.queued_job(id).await? else { return Ok(None) };
        let (now, lease) = (self.clock.now(), self.config.lease);
        let shares_fills = self.config.fill_limit_bytes > 0;
        let mut sights = self.store.sights(id, shares_fills, now, lease).await?;
        for (worker, sight) in &mut sights {
            sight.slots = self.slots.of(worker, &sight.backend, sight.slots, sight.jobs);
        }
        let sights: Vec<_> = sights.into_iter().map(|(_, sight)| sight).collect();
        let view = self.farm_view().await?;
        let (before, _) = self.before(&view, stored.place, &stored.job.needs).await?;
        let cause = why_waiting(&stored.job, &sights, before);
        let has_place = sights.iter().any(|worker| worker.fits && !worker.draining);
        Ok(Some(Waiting {
            reason: cause.reason,
            detail: cause.detail,
            since: stored.since,
            until: stored.job.retry_at.filter(|_| cause.reason == WaitReason::RetryPause),
            behind: has_place.then_some(before.total()),
            fill_job_id: cause.fill_job,
        }))
    }

    /// Jobs that come before a place in the queue, for workers with these needs, and their cost.
    pub(super) async fn before(
        &self,
        view: &FarmView,
        place: QueuePlace,
        needs: &Needs,
    ) -> Result<(JobsBefore, Batch), StoreError> {
        let groups: Vec<_> =
            view.groups.iter().filter(|(group, _)| view.compete(&group.needs, needs)).collect();
        let of = |group: &QueueGroup, jobs: u64| {
            let estimate_s =
                groups.iter().find(|(one, _)| one == group).and_then(|(_, estimate_s)| *estimate_s);
            Batch { jobs, estimate_s: estimate_s.unwrap_or_else(|| view.typical_s()) }
        };
        let (mut before, mut batch) = (JobsBefore { is_exact: true, ..Default::default() }, Batch::default());
        for (group, _) in groups.iter().filter(|(group, _)| group.priority > place.priority) {
            before.higher += group.jobs;
            batch = batch.with(of(group, group.jobs));
        }
        let competing: Vec<QueueGroup> = groups.iter().map(|(group, _)| group.clone()).collect();
        let mut owners = by_owner(&competing, place.priority);
        let (mut own, mut counted) = (0, Vec::new());
        for group in owners.remove(&place.owner).unwrap_or_default() {
            // Groups of one queue follow each other.
            if counted.last().is_none_or(|(queue, _)| *queue != group.queue) {
                let jobs = if counted.len() < COUNTED_QUEUES {
                    Some(self.store.jobs_before(group.queue, place).await?)
                } else {
                    None
                };
                counted.push((group.queue, jobs));
            }
            let counted = counted.last().and_then(|(_, jobs)| jobs.as_ref());
            let is_exact = counted.is_some_and(CountedJobs::are_all);
            let jobs = counted.map_or(0, |jobs| jobs.of(&group.needs));
            // At least those that were counted come before the place.
            let jobs =
                if is_exact { jobs } else { share_before(group, place.position).max(jobs).min(group.jobs) };
            before.is_exact &= is_exact;
            own += jobs;
            batch = batch.with(of(group, jobs));
        }
        let total = |groups: &[&QueueGroup]| groups.iter().map(|group| group.jobs).sum::<u64>();
        let others = owners
            .iter()
            .filter_map(|(owner, groups)| Some((groups.first()?.project, *owner, total(groups))));
        let project = self.store.project_of(place.owner).await?;
        before.same = view.rounds.jobs_before(place.priority, (project, place.owner, own), others);
        let all: u64 = owners.values().map(|groups| total(groups)).sum();
        for group in owners.values().flatten() {
            let share = (before.same - own) as f64 / all.max(1) as f64;
            batch = batch.with(of(group, (share * group.jobs as f64).round() as u64));
        }
        Ok((before, batch))
    }
}

/// The share of a long queue before a position: positions of a sweep count upwards without gaps.
fn share_before(group: &QueueGroup, position: i64) -> u64 {
    let span = (group.last - group.first + 1) as f64;
    let share = ((position - group.first) as f64 / span).clamp(0.0, 1.0);
    (share * group.jobs as f64) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::queue::Project;

    #[test]
    fn long_queues_are_shared_by_position() {
        let group = QueueGroup {
            priority: 0,
            project: Project { id: 0, share: 1 },
            owner: 0,
            queue: 1,
            needs: Needs::default(),
            jobs: 1_000_000,
            first: 500,
            last: 1_000_499,
        };
        let found = [0, 500, 250_500, 1_000_499, 5_000_000].map(|position| share_before(&group, position));
        assert_eq!(found, [0, 0, 250_000, 999_999, 1_000_000]);
    }
}
