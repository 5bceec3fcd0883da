//! Candidates of a claim: of the eligible jobs of all queues, the first ones of each owner.

use std::collections::{HashMap, HashSet};

use futures_util::TryStreamExt;

use super::claims::{Claim, FillDevice};
use super::columns::Columns;
use super::database::{Connection, query};
use super::eligible_jobs::{eligible_jobs, eligible_jobs_of_writer};
use super::workers::online_window;
use super::{Store, StoreError};
use crate::clock::Now;
use crate::queue::{EligibleJob, Owner, OwnerQueue, Project};

impl Store {
    /// Whether a claim would find a job. Uses a reader.
    pub(crate) async fn has_work(&self, claim: Claim, now: Now) -> Result<bool, StoreError> {
        let (since, until) = online_window(now.wall, claim.lease);
        let found = query(eligible_jobs(self.readers.engine()))
            .bind(claim.worker.to_string())
            .bind(since.0)
            .bind(until.0)
            .bind(1)
            .bind(claim.shares_fills)
            .bind(1)
            .fetch_optional(&self.readers)
            .await?;
        Ok(found.is_some())
    }
}

/// Numbers of the fills that the jobs of one batch of claims would compute. Devices that differ share none.
#[derive(Default)]
pub(super) struct FillNumbers(HashMap<(String, FillDevice), u32>);

impl FillNumbers {
    fn number(&mut self, digest: String, device: &FillDevice) -> u32 {
        let next = self.0.len() as u32;
        *self.0.entry((digest, device.clone())).or_insert(next)
    }
}

/// The first jobs that a worker can run: up to `max` of each owner, and more where many would compute the same fill. Priorities below
/// those that suffice are not read.
///
/// An owner with many large sweeps has as many queues, whose first jobs have nearly equal positions. A few jobs of each queue then
/// suffice. Only if one of these queues could have more jobs before the last one that counts, more are read: at first as many as each
/// queue would have if all went on as they began.
pub(super) async fn candidates(
    tx: &mut Connection,
    claim: Claim,
    now: Now,
    max: usize,
    fills: (&mut FillNumbers, &FillDevice),
) -> Result<Vec<OwnerQueue>, StoreError> {
    let few = list(tx, claim, now, (max, max.min(FEW)), (&mut *fills.0, fills.1)).await?;
    if let Some(first) = few.iter().map(|owner| owner.first(max, max.min(FEW))).collect() {
        return Ok(first);
    }
    let share = few.iter().map(|owner| owner.share(max)).max().unwrap_or(max);
    if share < max {
        let some = list(tx, claim, now, (max, share), (&mut *fills.0, fills.1)).await?;
        if let Some(first) = some.iter().map(|owner| owner.first(max, share)).collect() {
            return Ok(first);
        }
    }
    let all = list(tx, claim, now, (max, max), (&mut *fills.0, fills.1)).await?;
    let all: Vec<_> = all.into_iter().map(OwnerJobs::merged).collect();
    let is_short = |queue: &OwnerQueue| queue.jobs.len() >= max && distinct(&queue.jobs) < max;
    if all.iter().any(is_short) {
        let more = list(tx, claim, now, (max, max + PASSED_OVER), fills).await?;
        return Ok(more.into_iter().map(OwnerJobs::merged).collect());
    }
    Ok(all)
}

/// Jobs of each queue that a claim reads at first.
const FEW: usize = 2;

/// Jobs of one queue that a claim reads beyond those it asks for.
const PASSED_OVER: usize = 500;

/// The number of jobs that can run at the same time: of those that would compute the same fill, one.
fn distinct(jobs: &[EligibleJob]) -> usize {
    let mut fills = HashSet::new();
    jobs.iter().filter(|job| job.fill.is_none_or(|fill| fills.insert(fill))).count()
}

/// The place of a job among those of its owner and priority: its position, then its age.
type Place = (i64, i64);

/// Jobs of an owner at one priority, by queue.
struct OwnerJobs {
    priority: i32,
    project: Project,
    owner: Owner,
    queues: Vec<(i64, Vec<(Place, EligibleJob)>)>,
}

impl OwnerJobs {
    /// Its jobs, the first ones first.
    fn merged(self) -> OwnerQueue {
        let Self { priority, project, owner, queues } = self;
        let mut jobs: Vec<_> = queues.into_iter().flat_map(|(_, jobs)| jobs).collect();
        jobs.sort_by_key(|(place, _)| *place);
        OwnerQueue { priority, project, owner, jobs: jobs.into_iter().map(|(_, job)| job).collect() }
    }

    /// Of its first [`FEW`] jobs of each queue: the number of jobs of a queue among the first `max`, if the queues go on as they began.
    fn share(&self, max: usize) -> usize {
        let jobs = || self.queues.iter().map(|(_, jobs)| jobs);
        if jobs().flatten().any(|(_, job)| job.fill.is_some()) {
            return max;
        }
        let end = jobs()
            .filter(|jobs| jobs.len() >= FEW)
            .filter_map(|jobs| jobs.last())
            .map(|(place, _)| place)
            .min();
        let begins_before = |jobs: &&Vec<_>| jobs.first().map(|(place, _)| place) <= end;
        max.min(max.div_ceil(jobs().filter(begins_before).count().max(1)) + FEW)
    }

    /// Its first `max` jobs; none if they are not certain, because only `limit` jobs of each queue were read, or would compute fills.
    fn first(&self, max: usize, limit: usize) -> Option<OwnerQueue> {
        let mut jobs: Vec<_> = self.queues.iter().flat_map(|(_, jobs)| jobs).copied().collect();
        jobs.sort_by_key(|(place, _)| *place);
        jobs.truncate(max);
        let end = if jobs.len() < max { None } else { jobs.last().map(|(place, _)| *place) };
        let is_known = |(_, jobs): &(i64, Vec<(Place, EligibleJob)>)| {
            // A queue that gave fewer jobs has no others.
            jobs.len() < limit || jobs.last().is_some_and(|(place, _)| end.is_some_and(|end| *place >= end))
        };
        let is_certain = self.queues.iter().all(is_known) && jobs.iter().all(|(_, job)| job.fill.is_none());
        let Self { priority, project, owner, .. } = *self;
        let jobs = jobs.into_iter().map(|(_, job)| job).collect();
        is_certain.then_some(OwnerQueue { priority, project, owner, jobs })
    }
}

/// Up to `limit` jobs of each queue, until there are `max` that can run at the same time.
async fn list(
    tx: &mut Connection,
    claim: Claim,
    now: Now,
    (max, limit): (usize, usize),
    (numbers, device): (&mut FillNumbers, &FillDevice),
) -> Result<Vec<OwnerJobs>, StoreError> {
    let (since, until) = online_window(now.wall, claim.lease);
    let mut rows = query(eligible_jobs_of_writer(tx.engine()))
        .bind(claim.worker.to_string())
        .bind(since.0)
        .bind(until.0)
        .bind(i64::try_from(limit).unwrap_or(i64::MAX))
        .bind(claim.shares_fills)
        .bind(i64::try_from(limit.max(max)).unwrap_or(i64::MAX))
        .fetch(&mut *tx);
    let mut owners: Vec<OwnerJobs> = Vec::new();
    let (mut found, mut fills) = (0, HashSet::new());
    while let Some(row) = rows.try_next().await? {
        let (priority, owner) = (row.column("priority")?, row.column("owner")?);
        let project = Project { id: row.column("project")?, share: row.number("share")? };
        let queue: i64 = row.column("queue")?;
        let last = owners.last().map(|last| (last.priority, last.owner));
        if last.is_some_and(|(before, _)| before > priority && found >= max) {
            break;
        }
        if last != Some((priority, owner)) {
            owners.push(OwnerJobs { priority, project, owner, queues: Vec::new() });
        }
        if let Some(OwnerJobs { queues, .. }) = owners.last_mut() {
            if queues.last().is_none_or(|(last, _)| *last != queue) {
                queues.push((queue, Vec::new()));
            }
            let fill: Option<String> = row.column("fill")?;
            let fill = fill.map(|digest| numbers.number(digest, device));
            found += usize::from(fill.is_none_or(|fill| fills.insert(fill)));
            let job = EligibleJob { seq: row.column("seq")?, alone: row.column("alone")?, fill };
            if let Some((_, jobs)) = queues.last_mut() {
                jobs.push(((row.column("queue_position")?, job.seq), job));
            }
        }
    }
    for jobs in owners.iter_mut().flat_map(|owner| &mut owner.queues).map(|(_, jobs)| jobs) {
        jobs.sort_by_key(|(place, _)| *place);
    }
    Ok(owners)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An owner with these positions in each queue; jobs are numbered in this order.
    fn owner(queues: &[&[i64]]) -> OwnerJobs {
        let mut seqs = 1..;
        let mut job = |position: &i64| {
            let seq = seqs.next().unwrap();
            ((*position, seq), EligibleJob { seq, alone: false, fill: None })
        };
        let queues = queues.iter().map(|jobs| jobs.iter().map(&mut job).collect());
        let queues = (1..).zip(queues).collect();
        OwnerJobs { priority: 0, project: Project { id: 1, share: 1 }, owner: 1, queues }
    }

    fn first(queues: &[&[i64]], max: usize) -> Option<Vec<i64>> {
        let first = owner(queues).first(max, 2)?;
        Some(first.jobs.iter().map(|job| job.seq).collect())
    }

    #[test]
    fn first_jobs_of_many_queues_need_few_of_each() {
        assert_eq!(first(&[&[1, 2], &[1, 2], &[1, 2]], 3), Some(vec![1, 3, 5]));
        assert_eq!(first(&[&[7, 8], &[7, 8]], 3), Some(vec![1, 3, 2]));
        // Queues that have no more jobs.
        assert_eq!(first(&[&[1], &[5], &[]], 3), Some(vec![1, 2]));
        assert_eq!(first(&[], 3), Some(vec![]));
    }

    #[test]
    fn jobs_before_the_last_one_that_counts_must_be_known() {
        // A third job of the first queue could come before the job at position 5.
        assert_eq!(first(&[&[1, 2], &[5]], 3), None);
        assert_eq!(first(&[&[1, 2], &[5]], 2), Some(vec![1, 2]));
        assert_eq!(first(&[&[1, 2]], 3), None);
    }

    #[test]
    fn queues_that_advance_together_share_the_jobs() {
        let even = [7, 8].as_slice();
        assert_eq!(owner(&[even; 10]).share(40), 4 + FEW);
        assert_eq!(owner(&[even; 10]).share(5), 1 + FEW);
        // Only the first queue has jobs before the others begin.
        assert_eq!(owner(&[&[1, 2], even, even]).share(40), 40);
        assert_eq!(owner(&[&[1, 2], &[1], even]).share(40), 20 + FEW, "a queue of one job takes part");
        let mut computing = owner(&[even; 10]);
        computing.queues[0].1[0].1.fill = Some(1);
        assert_eq!(computing.share(40), 40, "some jobs of its queue may have to wait");
    }

    #[test]
    fn jobs_that_would_compute_fills_need_all() {
        let mut owner = owner(&[&[1]]);
        owner.queues[0].1[0].1.fill = Some(1);
        assert_eq!(owner.first(3, 2), None);
    }
}
