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
    /// Number of the fill that it would compute, if any.
    pub fill: Option<u32>,
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

/// The jobs that claims of one batch have got, and the fills that their attempts compute.
#[derive(Clone, Debug, Default)]
pub(crate) struct Taken {
    pub(crate) jobs: HashSet<i64>,
    pub(crate) fills: HashSet<u32>,
}

impl Taken {
    /// Adds a job.
    pub(crate) fn add(&mut self, job: EligibleJob) {
        self.jobs.insert(job.seq);
        self.fills.extend(job.fill);
    }
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

    /// Number of jobs of one priority that come before a job: `own` jobs of its owner, and those jobs of other owners, each with their
    /// number, that take an earlier round. Jobs of the same round are not counted.
    pub(crate) fn jobs_before(
        &self,
        priority: i32,
        (owner, own): (Owner, u64),
        others: impl IntoIterator<Item = (Owner, u64)>,
    ) -> u64 {
        let round = self.next(priority, owner).saturating_add_unsigned(own);
        let earlier = |(other, jobs): (Owner, u64)| {
            let rounds = round.saturating_sub(self.next(priority, other)).max(0);
            jobs.min(rounds.unsigned_abs())
        };
        own + others.into_iter().map(earlier).sum::<u64>()
    }

    /// The next jobs of these queues, at most `max`, without `taken` ones. Of jobs that would compute the same fill, the first.
    pub(crate) fn next_jobs(&self, queues: &[OwnerQueue], taken: &Taken, max: usize) -> Vec<ScheduledJob> {
        let mut fills = taken.fills.clone();
        let head = |queue| Head { queue, next: 0, round: self.next(queue.priority, queue.owner) };
        let mut heads: Vec<_> = queues.iter().map(head).collect();
        let mut scheduled = Vec::new();
        while scheduled.len() < max {
            for head in &mut heads {
                head.pass(|job| {
                    taken.jobs.contains(&job.seq) || job.fill.is_some_and(|it| fills.contains(&it))
                });
            }
            let rank =
                |head: &Head<'_>, job: EligibleJob| (-i64::from(head.queue.priority), head.round, job.seq);
            let ranked =
                heads.iter_mut().filter_map(|head| head.job().map(|job| (rank(head, job), head, job)));
            let Some((_, head, job)) = ranked.min_by_key(|(rank, ..)| *rank) else { break };
            let OwnerQueue { priority, owner, .. } = *head.queue;
            scheduled.push(ScheduledJob { job, priority, owner, round: head.round });
            (head.next, head.round) = (head.next + 1, head.round + 1);
            fills.extend(job.fill);
        }
        scheduled
    }
}

/// The rest of an owner queue, and the round of its next job.
struct Head<'q> {
    queue: &'q OwnerQueue,
    next: usize,
    round: i64,
}

impl Head<'_> {
    fn job(&self) -> Option<EligibleJob> {
        self.queue.jobs.get(self.next).copied()
    }

    /// Passes over jobs that are not free.
    fn pass(&mut self, is_taken: impl Fn(EligibleJob) -> bool) {
        while self.job().is_some_and(&is_taken) {
            self.next += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(seq: i64) -> EligibleJob {
        EligibleJob { seq, alone: false, fill: None }
    }

    fn owner_queue(priority: i32, owner: Owner, jobs: std::ops::Range<i64>) -> OwnerQueue {
        OwnerQueue { priority, owner, jobs: jobs.map(job).collect() }
    }

    /// The owners of claimed jobs; each claim takes this many.
    fn claimed(
        rounds: &mut Rounds,
        taken: &mut Taken,
        queues: &[OwnerQueue],
        claims: &[usize],
    ) -> Vec<Owner> {
        let mut owners = Vec::new();
        for max in claims {
            for next in rounds.next_jobs(queues, taken, *max) {
                rounds.record(next.priority, next.owner, next.round);
                taken.add(next.job);
                owners.push(next.owner);
            }
        }
        owners
    }

    #[test]
    fn owners_alternate_whatever_the_size_of_claims() {
        let queues = [owner_queue(0, 1, 0..100), owner_queue(0, 2, 100..200), owner_queue(0, 3, 200..203)];
        let claim =
            |claims: &[usize]| claimed(&mut Rounds::default(), &mut Taken::default(), &queues, claims);
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
        let owners = claimed(&mut Rounds::default(), &mut Taken::default(), &queues, &[7]);
        assert_eq!(owners, [2, 2, 2, 1, 2, 1, 2]);
    }

    #[test]
    fn a_late_owner_starts_in_the_current_round() {
        let (mut rounds, mut taken) = (Rounds::default(), Taken::default());
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
    fn jobs_before_a_job_are_those_that_claims_take_first() {
        let mut rounds = Rounds::default();
        // The third owner is two rounds behind the others.
        for (owner, round) in [(1, 7), (2, 7), (3, 5)] {
            rounds.record(0, owner, round);
        }
        let queues = [owner_queue(0, 1, 0..40), owner_queue(0, 2, 100..110), owner_queue(0, 3, 200..203)];
        let order: Vec<_> =
            rounds.next_jobs(&queues, &Taken::default(), 53).iter().map(|next| next.job.seq).collect();
        for (queue, own) in [(0, 0), (0, 5), (0, 39), (1, 9), (2, 2)] {
            let owner = queues[queue].owner;
            let others = queues.iter().filter(|other| other.owner != owner);
            let others = others.map(|other| (other.owner, other.jobs.len() as u64));
            let found = rounds.jobs_before(0, (owner, own), others) as usize;
            let place = order.iter().position(|seq| *seq == queues[queue].jobs[own as usize].seq).unwrap();
            // Of the jobs of one round, up to two of other owners are older.
            assert!((found..=found + 2).contains(&place), "owner {owner}, job {own}: {found}, {place}");
        }
        let none = std::iter::empty();
        assert_eq!(Rounds::default().jobs_before(0, (1, 3), none), 3);
    }

    #[test]
    fn absent_owner_accumulates_no_rounds() {
        let (mut rounds, mut taken) = (Rounds::default(), Taken::default());
        let queues = [owner_queue(0, 1, 0..100), owner_queue(0, 2, 100..200)];
        claimed(&mut rounds, &mut taken, &queues[1..], &[50]);
        claimed(&mut rounds, &mut taken, &queues[..1], &[10]);
        assert_eq!(claimed(&mut rounds, &mut taken, &queues, &[1; 6]), [2, 1, 2, 1, 2, 1]);
    }

    #[test]
    fn jobs_that_share_a_fill_are_claimed_one_at_a_time() {
        let with_fill = |seq, fill: u32| EligibleJob { fill: (fill > 0).then_some(fill), ..job(seq) };
        let queue = |owner, jobs: &[EligibleJob]| OwnerQueue { priority: 0, owner, jobs: jobs.to_vec() };
        let queues = [
            queue(1, &[(1, 7), (2, 7), (3, 0), (4, 8), (5, 9)].map(|(seq, fill)| with_fill(seq, fill))),
            queue(2, &[(6, 8), (7, 0)].map(|(seq, fill)| with_fill(seq, fill))),
        ];
        let numbers = |taken: &Taken, max| -> Vec<i64> {
            Rounds::default().next_jobs(&queues, taken, max).iter().map(|next| next.job.seq).collect()
        };
        assert_eq!(numbers(&Taken::default(), 2), [1, 6]);
        assert_eq!(numbers(&Taken::default(), 9), [1, 6, 3, 7, 5], "job 4 would compute the fill of job 6");
        let mut taken = Taken::default();
        taken.add(with_fill(1, 7));
        assert_eq!(numbers(&taken, 3), [3, 6, 5], "an earlier claim of the batch computes fill 7");
    }
}
