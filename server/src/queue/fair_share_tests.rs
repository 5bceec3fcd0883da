//! Tests of the order of the queue.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::*;

/// The project of most tests.
const ONLY: Project = Project { id: 0, share: 1 };

fn job(seq: i64) -> EligibleJob {
    EligibleJob { seq, alone: false, fill: None }
}

fn of_project(project: Project, owner: Owner, jobs: Range<i64>) -> OwnerQueue {
    OwnerQueue { priority: 0, project, owner, jobs: jobs.map(job).collect() }
}

fn owner_queue(priority: i32, owner: Owner, jobs: Range<i64>) -> OwnerQueue {
    OwnerQueue { priority, ..of_project(ONLY, owner, jobs) }
}

/// The claimed jobs; each claim takes this many.
fn claimed(
    rounds: &mut Rounds,
    taken: &mut Taken,
    queues: &[OwnerQueue],
    claims: &[usize],
) -> Vec<ScheduledJob> {
    let mut jobs = Vec::new();
    for max in claims {
        for next in rounds.next_jobs(queues, taken, *max) {
            rounds.record(&next);
            taken.add(next.job);
            jobs.push(next);
        }
    }
    jobs
}

/// Their owners.
fn owners(rounds: &mut Rounds, taken: &mut Taken, queues: &[OwnerQueue], claims: &[usize]) -> Vec<Owner> {
    claimed(rounds, taken, queues, claims).iter().map(|next| next.owner).collect()
}

/// Their projects, from new rounds.
fn projects(queues: &[OwnerQueue], claims: &[usize]) -> Vec<i64> {
    let jobs = claimed(&mut Rounds::default(), &mut Taken::default(), queues, claims);
    jobs.iter().map(|next| next.project.id).collect()
}

#[test]
fn owners_alternate_whatever_the_size_of_claims() {
    let queues = [owner_queue(0, 1, 0..100), owner_queue(0, 2, 100..200), owner_queue(0, 3, 200..203)];
    let claim = |claims: &[usize]| owners(&mut Rounds::default(), &mut Taken::default(), &queues, claims);
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
    let owners = owners(&mut Rounds::default(), &mut Taken::default(), &queues, &[7]);
    assert_eq!(owners, [2, 2, 2, 1, 2, 1, 2]);
}

#[test]
fn a_late_owner_starts_in_the_current_round() {
    let (mut rounds, mut taken) = (Rounds::default(), Taken::default());
    let queues = [owner_queue(0, 1, 0..100), owner_queue(0, 2, 100..200)];
    assert_eq!(owners(&mut rounds, &mut taken, &queues[..1], &[64]), [1; 64]);
    assert_eq!(owners(&mut rounds, &mut taken, &queues, &[1; 6]), [2, 1, 2, 1, 2, 1]);
    // An owner that submits single jobs gets one per round.
    let rare = (300..310).flat_map(|seq| {
        let queues = [queues[0].clone(), owner_queue(0, 3, seq..seq + 1)];
        owners(&mut rounds, &mut taken, &queues, &[1])
    });
    let rare: Vec<_> = rare.collect();
    assert_eq!(rare.iter().filter(|owner| **owner == 3).count(), 5, "{rare:?}");
}

#[test]
fn absent_owner_accumulates_no_rounds() {
    let (mut rounds, mut taken) = (Rounds::default(), Taken::default());
    let queues = [owner_queue(0, 1, 0..100), owner_queue(0, 2, 100..200)];
    owners(&mut rounds, &mut taken, &queues[1..], &[50]);
    owners(&mut rounds, &mut taken, &queues[..1], &[10]);
    assert_eq!(owners(&mut rounds, &mut taken, &queues, &[1; 6]), [2, 1, 2, 1, 2, 1]);
}

#[test]
fn projects_alternate_whatever_the_number_of_their_owners() {
    let (many, few) = (Project { id: 1, share: 1 }, Project { id: 2, share: 1 });
    let mut queues: Vec<_> =
        (0..5).map(|owner| of_project(many, owner, owner * 100..owner * 100 + 100)).collect();
    queues.push(of_project(few, 9, 900..903));
    let (mut rounds, mut taken) = (Rounds::default(), Taken::default());
    let order = owners(&mut rounds, &mut taken, &queues, &[9]);
    assert_eq!(order, [0, 9, 1, 9, 2, 9, 3, 4, 0], "owners of the large project alternate in its turns");
}

#[test]
fn a_project_has_as_many_turns_in_a_round_as_its_share() {
    let (double, single) = (Project { id: 1, share: 2 }, Project { id: 2, share: 1 });
    let queues = [of_project(double, 1, 0..100), of_project(single, 2, 100..200)];
    let expected = [1, 2, 1, 2, 1, 1, 2, 1, 1, 2, 1, 1];
    for claims in [&[12][..], &[1; 12], &[5, 4, 3]] {
        assert_eq!(projects(&queues, claims), expected, "{claims:?}");
    }
}

#[test]
fn the_turns_of_a_large_share_leave_none_waiting_for_a_whole_round() {
    let [large, small] = [(1, 6), (2, 3)].map(|(id, share)| Project { id, share });
    let queues = [of_project(large, 1, 0..100), of_project(small, 2, 100..200)];
    assert_eq!(projects(&queues, &[9]), [1, 2, 1, 2, 1, 1, 2, 1, 1]);
}

#[test]
fn a_late_project_gets_its_turns_and_no_more() {
    let (early, late) = (Project { id: 1, share: 1 }, Project { id: 2, share: 3 });
    let queues = [of_project(early, 1, 0..100), of_project(late, 2, 100..200)];
    let (mut rounds, mut taken) = (Rounds::default(), Taken::default());
    assert_eq!(owners(&mut rounds, &mut taken, &queues[..1], &[40]), [1; 40]);
    assert_eq!(owners(&mut rounds, &mut taken, &queues, &[1; 8]), [2, 2, 2, 1, 2, 2, 2, 1]);
    // A changed share counts from the next turn on.
    let halved = Project { share: 1, ..late };
    let queues = [queues[0].clone(), of_project(halved, 2, 100..200)];
    assert_eq!(owners(&mut rounds, &mut taken, &queues, &[6]), [2, 1, 2, 1, 2, 1]);
}

#[test]
fn a_lowered_share_ends_the_round_of_a_project() {
    let turn = |round, number| Turn { round, number };
    assert_eq!(turn(5, 999).later(1, 1000), turn(6, 0));
    assert_eq!(turn(5, 999).later(1, 1), turn(6, 0), "not a thousand rounds later");
    assert_eq!(turn(5, 7).later(1, 3), turn(6, 0));
    assert_eq!(turn(5, 1).later(1, 3), turn(5, 2));
}

#[test]
fn jobs_before_a_job_are_those_that_claims_take_first() {
    let mut rounds = Rounds::default();
    // The third owner is two rounds behind the others.
    for (owner, round) in [(1, 7), (2, 7), (3, 5)] {
        rounds.record_owner(0, (0, owner), round, 0);
    }
    let queues = [owner_queue(0, 1, 0..40), owner_queue(0, 2, 100..110), owner_queue(0, 3, 200..203)];
    for (queue, own) in [(0, 0), (0, 5), (0, 39), (1, 9), (2, 2)] {
        // Of the jobs of one round, up to two of other owners are older.
        check_jobs_before(&rounds, &queues, (queue, own), 2);
    }
    let none = std::iter::empty();
    assert_eq!(Rounds::default().jobs_before(0, (ONLY, 1, 3), none), 3);
}

/// Compares the number of jobs before a job with its place in the order of claims. `ties` jobs may have the same turn.
fn check_jobs_before(rounds: &Rounds, queues: &[OwnerQueue], (queue, own): (usize, u64), ties: usize) {
    let OwnerQueue { project, owner, .. } = queues[queue];
    let others = queues.iter().filter(|other| other.owner != owner);
    let others = others.map(|other| (other.project, other.owner, other.jobs.len() as u64));
    let found = rounds.jobs_before(0, (project, owner, own), others) as usize;
    let seq = queues[queue].jobs[own as usize].seq;
    let order = rounds.next_jobs(queues, &Taken::default(), found + ties + 1);
    let place = order.iter().position(|next| next.job.seq == seq);
    assert!(place.is_some_and(|place| place >= found), "owner {owner}, job {own}: {found}, {place:?}");
}

#[test]
fn jobs_that_share_a_fill_are_claimed_one_at_a_time() {
    let with_fill = |seq, fill: u32| EligibleJob { fill: (fill > 0).then_some(fill), ..job(seq) };
    let queue =
        |owner, jobs: &[EligibleJob]| OwnerQueue { jobs: jobs.to_vec(), ..owner_queue(0, owner, 0..0) };
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

/// Projects with random shares, whose owners come and go at random.
struct Farm {
    random: fastrand::Rng,
    projects: Vec<Project>,
    /// Jobs by owner; the owners of a project follow each other.
    queues: Vec<OwnerQueue>,
    rounds: Rounds,
    next: i64,
}

impl Farm {
    fn new(seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let count = random.i64(2..6);
        let projects: Vec<_> = (0..count).map(|id| Project { id, share: random.u32(1..8) }).collect();
        let mut queues = Vec::new();
        for project in &projects {
            for _ in 0..random.usize(1..4) {
                queues.push(of_project(*project, queues.len() as i64, 0..0));
            }
        }
        Self { random, projects, queues, rounds: Rounds::default(), next: 0 }
    }

    fn submit(&mut self, queue: usize, jobs: i64) {
        self.queues[queue].jobs.extend((self.next..self.next + jobs).map(job));
        self.next += jobs;
    }

    /// Claims jobs, and returns the projects that got them.
    fn claim(&mut self, max: usize) -> Vec<i64> {
        let next = self.rounds.next_jobs(&self.queues, &Taken::default(), max);
        let taken: BTreeSet<i64> = next.iter().map(|next| next.job.seq).collect();
        self.queues.iter_mut().for_each(|queue| queue.jobs.retain(|job| !taken.contains(&job.seq)));
        next.iter().for_each(|next| self.rounds.record(next));
        next.iter().map(|next| next.project.id).collect()
    }

    fn waiting(&self) -> BTreeSet<i64> {
        let waiting = self.queues.iter().filter(|queue| !queue.jobs.is_empty());
        waiting.map(|queue| queue.project.id).collect()
    }
}

/// Whatever came before: while the same projects wait, each gets its share of any number of rounds, and none waits longer than a round.
#[test]
fn projects_that_wait_get_their_shares() {
    for seed in 0..200 {
        let mut farm = Farm::new(seed);
        for _ in 0..30 {
            let queue = farm.random.usize(0..farm.queues.len());
            let jobs = farm.random.i64(0..20);
            farm.submit(queue, jobs);
            let max = farm.random.usize(0..12);
            farm.claim(max);
        }
        // From now on all of some projects wait.
        let always: Vec<_> = farm.projects.iter().copied().filter(|_| farm.random.bool()).collect();
        let shares: u32 = always.iter().map(|project| project.share).sum();
        farm.queues.iter_mut().for_each(|queue| queue.jobs.clear());
        for queue in 0..farm.queues.len() {
            if always.contains(&farm.queues[queue].project) {
                farm.submit(queue, 500);
            }
        }
        let mut order = Vec::new();
        while order.len() < 60 * shares as usize {
            let max = farm.random.usize(1..12);
            order.extend(farm.claim(max));
        }
        let at = farm.random.usize(0..20 * shares.max(1) as usize);
        for project in &always {
            let rounds = 30;
            let got = order[at..at + rounds * shares as usize].iter().filter(|id| **id == project.id).count();
            let expected = rounds * project.share as usize;
            // At most one round is cut at each end.
            assert!(
                got.abs_diff(expected) <= project.share as usize,
                "seed {seed}, {project:?} of {always:?}: {got}, not {expected}"
            );
            let mut others = 0;
            for id in &order {
                others = if *id == project.id { 0 } else { others + 1 };
                // The rest of one round and the start of the next.
                assert!(others <= 2 * (shares - project.share), "seed {seed}, {project:?}: {others} others");
            }
        }
    }
}

/// A project that comes and goes gets no more than its share while others wait, and the count before a job is the order of claims.
#[test]
fn projects_that_come_and_go_get_at_most_their_shares() {
    for seed in 0..200 {
        let mut farm = Farm::new(seed);
        let (first, rare) = (farm.projects[0], farm.projects[1]);
        let own = farm.queues.iter().position(|queue| queue.project == first).unwrap();
        let other = farm.queues.iter().position(|queue| queue.project == rare).unwrap();
        farm.submit(own, 400);
        let mut got = BTreeMap::<i64, u32>::new();
        for _ in 0..100 {
            if farm.random.u32(0..3) == 0 {
                let jobs = farm.random.i64(1..4);
                farm.submit(other, jobs);
            }
            if farm.waiting().len() == 2 {
                for queue in [own, other] {
                    let job = farm.random.u64(0..farm.queues[queue].jobs.len().min(30) as u64);
                    let queues = [own, other].map(|queue| farm.queues[queue].clone());
                    check_jobs_before(&farm.rounds, &queues, (usize::from(queue == other), job), 1);
                }
            }
            for id in farm.claim(1) {
                *got.entry(id).or_default() += 1;
            }
        }
        let [first_got, rare_got] = [first, rare].map(|project| got.get(&project.id).copied().unwrap_or(0));
        // A round more at most.
        let allowed = (first_got / first.share + 2) * rare.share;
        assert!(rare_got <= allowed, "seed {seed}: {rare_got} of {rare:?}, {first_got} of {first:?}");
    }
}

/// Claims of two classes of workers: one sees the first two queues, the other one the third queue, and claims in bursts. Returns the
/// claims of the first class: the places of their queues.
fn with_two_classes(seed: u64, queues: &[OwnerQueue; 3], warm_up: usize) -> Vec<usize> {
    let mut random = fastrand::Rng::with_seed(seed);
    let (mut rounds, mut taken, mut order) = (Rounds::default(), Taken::default(), Vec::new());
    claimed(&mut rounds, &mut taken, &queues[..1], &vec![1; warm_up]);
    for _ in 0..100 {
        let bursts = vec![1; random.usize(0..6)];
        claimed(&mut rounds, &mut taken, &queues[2..], &bursts);
        for next in claimed(&mut rounds, &mut taken, &queues[..2], &[random.usize(1..4)]) {
            order.push(usize::from(next.job.seq >= 1000));
        }
    }
    order
}

/// Queues of many jobs, of which those of the first are the oldest.
fn long_queues(queue: impl Fn(i64, Range<i64>) -> OwnerQueue) -> [OwnerQueue; 3] {
    [queue(0, 0..1000), queue(1, 1000..2000), queue(2, 2000..3000)]
}

/// The largest difference of claims at any time between two queues.
fn lead(order: &[usize]) -> u64 {
    let mut counts = [0_u64; 2];
    let leads = order.iter().map(|place| {
        counts[*place] += 1;
        counts[0].abs_diff(counts[1])
    });
    leads.max().unwrap()
}

/// While other workers advance the round, two projects with equal shares that wait for the same workers get equal parts.
#[test]
fn projects_that_wait_for_the_same_workers_alternate_beside_a_third_project() {
    for seed in 0..200 {
        let mut random = fastrand::Rng::with_seed(seed);
        let (share, other) = (random.u32(1..6), random.u32(1..6));
        let queues = long_queues(|id, jobs| {
            of_project(Project { id, share: if id < 2 { share } else { other } }, id, jobs)
        });
        let of_seed = lead(&with_two_classes(seed, &queues, 0));
        assert!(of_seed <= 1, "seed {seed}, shares {share} and {other}: one is {of_seed} ahead");
        // The rest of a round at most for the project that was absent.
        let of_seed = lead(&with_two_classes(seed, &queues, 50));
        let allowed = u64::from(share) + 1;
        assert!(of_seed <= allowed, "seed {seed}, shares {share} and {other}: one is {of_seed} ahead");
    }
}

/// The same for owners of one project.
#[test]
fn owners_that_wait_for_the_same_workers_alternate_beside_a_third_owner() {
    for seed in 0..200 {
        let of_seed =
            lead(&with_two_classes(seed, &long_queues(|owner, jobs| owner_queue(0, owner, jobs)), 0));
        assert!(of_seed <= 1, "seed {seed}: one is {of_seed} ahead");
    }
}

/// With unequal shares, the part of the larger one may be smaller than its share, but none waits longer than its share allows.
#[test]
fn projects_with_unequal_shares_do_not_starve_beside_other_workers() {
    for seed in 0..200 {
        let mut random = fastrand::Rng::with_seed(seed);
        let shares = [(); 3].map(|()| random.u32(1..9));
        let queues = long_queues(|id, jobs| of_project(Project { id, share: shares[id as usize] }, id, jobs));
        let order = with_two_classes(seed, &queues, 0);
        for place in 0..2 {
            let allowed = shares[1 - place].div_ceil(shares[place]) + 2;
            let mut others = 0;
            for next in &order {
                others = if *next == place { 0 } else { others + 1 };
                assert!(others <= allowed, "seed {seed}, {shares:?}: {others} claims without one of {place}");
            }
        }
    }
}
