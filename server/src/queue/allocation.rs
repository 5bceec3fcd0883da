//! Allocation of jobs to claims.
//!
//! Claims of one batch get the jobs that they would get one after the other.
//!
//! Jobs that were lost together run alone from then on, so that a job that kills its worker takes no others with it. Such a job
//! goes to an idle worker, which gets nothing else. At the head of the queue it blocks the jobs behind it: otherwise a worker that
//! runs several jobs would never be idle.

use super::fair_share::{OwnerQueue, Rounds, ScheduledJob, Taken};

/// The jobs that a worker holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct WorkerLoad {
    /// Jobs that it runs or has yet to deliver.
    pub jobs: u32,
    /// Whether one of them runs alone.
    pub alone: bool,
}

/// The demand of a claim.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Demand {
    /// Index of the list of jobs that its worker can run.
    pub list: usize,
    /// The load of its worker.
    pub load: WorkerLoad,
    /// Maximum number of jobs.
    pub max_jobs: usize,
}

/// The jobs of a claim.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Allocation {
    /// The jobs, in the order of the queue.
    pub jobs: Vec<ScheduledJob>,
    /// Whether a job waits until the worker is idle.
    pub held_back: bool,
}

/// Allocates jobs to the claims in their order, and advances the rounds. Each list holds, of each owner queue, as many jobs as all
/// claims demand together, or all that exist.
pub(crate) fn allocate(
    demands: &[Demand],
    lists: &[Vec<OwnerQueue>],
    rounds: &mut Rounds,
) -> Vec<Allocation> {
    let mut taken = Taken::default();
    let mut get = |demand: &Demand| {
        let mut jobs = rounds.next_jobs(&lists[demand.list], &taken, demand.max_jobs);
        let is_any = !jobs.is_empty();
        let alone: Vec<_> = jobs.iter().map(|next| next.job.alone).collect();
        jobs.truncate(batch(demand.load, &alone));
        for next in &jobs {
            rounds.record(next);
            taken.add(next.job);
        }
        Allocation { held_back: jobs.is_empty() && is_any, jobs }
    };
    demands.iter().map(&mut get).collect()
}

/// The number of jobs that a worker gets. `alone` says, in the order of the queue, which jobs run alone.
fn batch(load: WorkerLoad, alone: &[bool]) -> usize {
    match alone {
        _ if load.alone => 0,
        [true, ..] => usize::from(load.jobs == 0),
        others => others.iter().take_while(|alone| !**alone).count(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fair_share::{EligibleJob, Project};
    use super::*;

    /// Jobs of one owner.
    fn owner_queue(owner: i64, jobs: impl IntoIterator<Item = (i64, bool)>) -> OwnerQueue {
        let jobs = jobs.into_iter().map(|(seq, alone)| EligibleJob { seq, alone, fill: None }).collect();
        OwnerQueue { priority: 0, project: Project { id: 0, share: 1 }, owner, jobs }
    }

    fn numbers(allocation: &Allocation) -> Vec<i64> {
        allocation.jobs.iter().map(|next| next.job.seq).collect()
    }

    #[test]
    fn jobs_that_run_alone_get_an_idle_worker() {
        let idle = WorkerLoad::default();
        let busy = WorkerLoad { jobs: 1, alone: false };
        let taken = WorkerLoad { jobs: 1, alone: true };
        for (load, alone, expected) in [
            (idle, vec![], 0),
            (idle, vec![false, false, false], 3),
            (idle, vec![false, true, false], 1),
            (idle, vec![true, false], 1),
            (idle, vec![true, true], 1),
            (busy, vec![true, false], 0),
            (busy, vec![false, true], 1),
            (taken, vec![false], 0),
            (taken, vec![true], 0),
        ] {
            assert_eq!(batch(load, &alone), expected, "{load:?} {alone:?}");
        }
    }

    #[test]
    fn a_job_goes_to_one_claim_only() {
        let any = |jobs: [i64; 3]| vec![owner_queue(1, jobs.map(|seq| (seq, false)))];
        let demand = |list, max_jobs| Demand { list, load: WorkerLoad::default(), max_jobs };
        let gets = |demands: &[Demand], lists: &[Vec<OwnerQueue>]| -> Vec<Vec<i64>> {
            allocate(demands, lists, &mut Rounds::default()).iter().map(numbers).collect()
        };
        // Both kinds of workers can run jobs 1 and 3.
        let lists = [any([1, 2, 3]), any([1, 3, 4])];
        let claims = [demand(1, 2), demand(0, 1), demand(1, 1), demand(0, 1)];
        assert_eq!(gets(&claims, &lists), [vec![1, 3], vec![2], vec![4], vec![]]);
        assert!(gets(&[], &[]).is_empty());
    }

    #[test]
    fn fair_share_rounds_advance_within_a_batch_of_claims() {
        let many = |from| (from..from + 10).map(|seq| (seq, false));
        // The second list is of workers that can run no job of the second owner.
        let lists = [vec![owner_queue(1, many(0)), owner_queue(2, many(10))], vec![owner_queue(1, many(0))]];
        let demand = |list, max_jobs| Demand { list, load: WorkerLoad::default(), max_jobs };
        let mut rounds = Rounds::default();
        let allocations = allocate(&[demand(1, 3), demand(0, 4)], &lists, &mut rounds);
        assert_eq!(allocations.iter().map(numbers).collect::<Vec<_>>(), [vec![0, 1, 2], vec![10, 3, 11, 4]]);
        let taken = Taken { jobs: [0, 1, 2, 3, 4, 10, 11].into(), ..Taken::default() };
        assert_eq!(rounds.next_jobs(&lists[0], &taken, 1)[0].job.seq, 12);
    }

    #[test]
    fn a_job_that_runs_alone_goes_to_the_next_idle_worker() {
        let list = vec![owner_queue(1, [(1, true), (2, false)])];
        let demand = |jobs| Demand { list: 0, load: WorkerLoad { jobs, alone: false }, max_jobs: 2 };
        let claims = [demand(1), demand(0), demand(1), demand(0)];
        let allocations = allocate(&claims, &[list], &mut Rounds::default());
        let allocations: Vec<_> = allocations.iter().map(|it| (numbers(it), it.held_back)).collect();
        assert_eq!(allocations, [(vec![], true), (vec![1], false), (vec![2], false), (vec![], false)]);
    }
}
