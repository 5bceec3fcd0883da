//! Fair share: the order of the queue.
//!
//! 1. Jobs of a higher priority come first.
//! 2. Within a priority, owners alternate. An owner is a token that submitted jobs; a server without tokens has one owner.
//! 3. The jobs of one owner at one priority form an *owner queue*. Its sweeps alternate, and a sweep's design points come by index.
//!    Each job has its *position* in this queue: the jobs of a sweep count upwards from the position that the queue has reached
//!    when they are submitted, and a single job gets the position reached. Jobs of equal position come by age.
//!
//! Owners alternate in *rounds*, which count upwards in each priority. An owner has one job per round, and the job of the earlier
//! round is next. An owner that returns starts in the current round: it does not wait behind the others, and gets no compensation
//! for its absence. A job that is claimed again, after a retry or a lost lease, takes a round again.

use std::collections::{HashMap, HashSet};

/// The owner of a job: a row of `owners`.
pub(crate) type Owner = i64;

/// A queued job that a worker can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EligibleJob {
    /// Its number; older jobs have lower numbers.
    pub seq: i64,
    /// Whether it runs alone.
    pub alone: bool,
}

/// The first eligible jobs of one owner at one priority.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct OwnerQueue {
    /// Higher is claimed first.
    pub priority: i32,
    /// Their owner.
    pub owner: Owner,
    /// By position, then age.
    pub jobs: Vec<EligibleJob>,
}

/// A job in the order of claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ScheduledJob {
    /// The job.
    pub job: EligibleJob,
    /// Its priority.
    pub priority: i32,
    /// Its owner.
    pub owner: Owner,
    /// The round that it takes.
    pub round: i64,
}

/// The rounds that owners have reached.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Rounds {
    last: HashMap<(i32, Owner), i64>,
    current: HashMap<i32, i64>,
}

impl Rounds {
    /// Records the round of a claimed job.
    pub(crate) fn record(&mut self, priority: i32, owner: Owner, round: i64) {
        let last = self.last.entry((priority, owner)).or_insert(round);
        *last = round.max(*last);
        let newest = self.current.entry(priority).or_insert(round);
        *newest = round.max(*newest);
    }

    /// The round of an owner's next job of that priority.
    fn next(&self, priority: i32, owner: Owner) -> i64 {
        let current = self.current.get(&priority).copied().unwrap_or(0);
        self.last.get(&(priority, owner)).map_or(current, |last| current.max(last + 1))
    }

    /// The next jobs of these queues, at most `max`, without `taken` ones.
    pub(crate) fn next_jobs(
        &self,
        queues: &[OwnerQueue],
        taken: &HashSet<i64>,
        max: usize,
    ) -> Vec<ScheduledJob> {
        let mut next = Vec::new();
        for OwnerQueue { priority, owner, jobs } in queues {
            let (priority, owner) = (*priority, *owner);
            let rounds = self.next(priority, owner)..;
            let free = jobs.iter().filter(|job| !taken.contains(&job.seq)).take(max);
            next.extend(free.zip(rounds).map(|(job, round)| ScheduledJob {
                job: *job,
                priority,
                owner,
                round,
            }));
        }
        next.sort_by_key(|next| (-i64::from(next.priority), next.round, next.job.seq));
        next.truncate(max);
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn owner_queue(priority: i32, owner: Owner, jobs: std::ops::Range<i64>) -> OwnerQueue {
        OwnerQueue { priority, owner, jobs: jobs.map(|seq| EligibleJob { seq, alone: false }).collect() }
    }

    /// The owners of claimed jobs; each claim takes this many.
    fn claimed(
        rounds: &mut Rounds,
        taken: &mut HashSet<i64>,
        queues: &[OwnerQueue],
        claims: &[usize],
    ) -> Vec<Owner> {
        let mut owners = Vec::new();
        for max in claims {
            for next in rounds.next_jobs(queues, taken, *max) {
                rounds.record(next.priority, next.owner, next.round);
                taken.insert(next.job.seq);
                owners.push(next.owner);
            }
        }
        owners
    }

    #[test]
    fn owners_alternate_whatever_the_size_of_claims() {
        let queues = [owner_queue(0, 1, 0..100), owner_queue(0, 2, 100..200), owner_queue(0, 3, 200..203)];
        let claim = |claims: &[usize]| claimed(&mut Rounds::default(), &mut HashSet::new(), &queues, claims);
        let one_by_one = claim(&[1; 20]);
        assert_eq!(one_by_one[..9], [1, 2, 3, 1, 2, 3, 1, 2, 3]);
        assert_eq!(one_by_one[9..], [1, 2, 1, 2, 1, 2, 1, 2, 1, 2, 1], "the third owner has no more jobs");
        for claims in [&[20][..], &[7, 1, 12], &[2; 10]] {
            assert_eq!(claim(claims), one_by_one, "{claims:?}");
        }
    }

    #[test]
    fn each_priority_has_its_own_rounds() {
        let queues = [owner_queue(5, 2, 100..103), owner_queue(0, 1, 0..9), owner_queue(0, 2, 10..19)];
        let owners = claimed(&mut Rounds::default(), &mut HashSet::new(), &queues, &[7]);
        assert_eq!(owners, [2, 2, 2, 1, 2, 1, 2]);
    }

    #[test]
    fn a_late_owner_starts_in_the_current_round() {
        let (mut rounds, mut taken) = (Rounds::default(), HashSet::new());
        let queues = [owner_queue(0, 1, 0..100), owner_queue(0, 2, 100..200)];
        assert_eq!(claimed(&mut rounds, &mut taken, &queues[..1], &[64]), [1; 64]);
        assert_eq!(claimed(&mut rounds, &mut taken, &queues, &[1; 6]), [2, 1, 2, 1, 2, 1]);
        // An owner that submits single jobs gets one per round.
        let rare = (300..310).flat_map(|seq| {
            let queues = [queues[0].clone(), owner_queue(0, 3, seq..seq + 1)];
            claimed(&mut rounds, &mut taken, &queues, &[1])
        });
        let rare: Vec<_> = rare.collect();
        assert_eq!(rare.iter().filter(|owner| **owner == 3).count(), 5, "{rare:?}");
    }

    #[test]
    fn an_absent_owner_saves_no_rounds() {
        let (mut rounds, mut taken) = (Rounds::default(), HashSet::new());
        let queues = [owner_queue(0, 1, 0..100), owner_queue(0, 2, 100..200)];
        claimed(&mut rounds, &mut taken, &queues[1..], &[50]);
        claimed(&mut rounds, &mut taken, &queues[..1], &[10]);
        assert_eq!(claimed(&mut rounds, &mut taken, &queues, &[1; 6]), [2, 1, 2, 1, 2, 1]);
    }
}
