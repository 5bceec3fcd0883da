//! Fair share: the order of the queue.
//!
//! 1. Jobs of a higher priority come first.
//! 2. Within a priority, projects alternate in *rounds*. A project has as many *turns* in a round as its share, and one job per turn.
//! 3. Within a project, owners alternate. An owner is a token that submitted jobs; a server without tokens has one owner.
//! 4. The jobs of one owner at one priority form an *owner queue*. Its sweeps alternate, and a sweep's design points come by index.
//!    Each job has its *position* in this queue: the jobs of a sweep count upwards from the position that the queue has reached
//!    when they are submitted, and a single job gets the position reached. Jobs of equal position come by age.
//!
//! Rounds count upwards in each priority, and the earlier round is next. The turns of a round are spread evenly: of shares 3 and 1,
//! the order is A, B, A, A or B, A, A, A. A project that returns starts in the current round: it does not wait behind the others, and
//! gets no compensation for its absence.
//!
//! Of several projects with equal turns, the one whose last claim is the longest ago is next, then the oldest job. Some workers can run
//! the jobs of few projects only, while the claims of other workers advance the round. All projects that are behind then have equal
//! turns: by the age of jobs alone, one of them could get each claim. Claims count together, whatever the worker: a project that takes
//! many turns on the CPU waits for a GPU behind a project that takes few.
//!
//! The owners of a project alternate in rounds of their own, in which each has one job, by the same rules. A job that is claimed again,
//! after a retry or a lost lease, takes a turn again.

use std::collections::{HashMap, HashSet};

/// The owner of a job: a row of `owners`.
pub(crate) type Owner = i64;

/// A project in the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Project {
    /// Its row of `projects`.
    pub id: i64,
    /// Its turns in a round, at least 1.
    pub share: u32,
}

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
    /// The project of their owner.
    pub project: Project,
    /// Their owner.
    pub owner: Owner,
    /// By position, then age.
    pub jobs: Vec<EligibleJob>,
}

/// A turn of a project.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Turn {
    /// Its round.
    pub round: i64,
    /// Turns of the project before it in this round.
    pub number: u32,
}

impl Turn {
    /// The turn of a project that comes `turns` later. The project may have had a larger share in the round of this one: of a smaller
    /// share, all turns of the round have passed then.
    fn later(self, turns: u64, share: u32) -> Self {
        let share = u64::from(share.max(1));
        let number = u64::from(self.number).min(share - 1) + turns;
        Self { round: self.round.saturating_add_unsigned(number / share), number: (number % share) as u32 }
    }

    /// The order of turns of projects with different shares: the round, and the part of it that has passed.
    fn place(self, share: u32) -> (i64, u64) {
        (self.round, (u64::from(self.number) << 32) / u64::from(share.max(1)))
    }
}

/// A job in the order of claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ScheduledJob {
    /// The job.
    pub job: EligibleJob,
    /// Its priority.
    pub priority: i32,
    /// Its project.
    pub project: Project,
    /// Its owner.
    pub owner: Owner,
    /// The turn of its project that it takes.
    pub turn: Turn,
    /// The round between the owners of its project that it takes.
    pub round: i64,
    /// The number of its claim: later claims of a priority have higher numbers.
    pub served: i64,
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

/// The rounds that projects and their owners have reached.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Rounds {
    /// The last turn of each project, and the newest round of a priority.
    projects: HashMap<(i32, i64), Turn>,
    current: HashMap<i32, i64>,
    /// The last round of each owner, and the newest one of a project.
    owners: HashMap<(i32, Owner), i64>,
    current_of_project: HashMap<(i32, i64), i64>,
    /// The number of the last claim of each project and owner, and the highest one of a priority. Numbers start at 1.
    served_projects: HashMap<(i32, i64), i64>,
    served_owners: HashMap<(i32, Owner), i64>,
    served: HashMap<i32, i64>,
}

impl Rounds {
    /// Records the last turn of a project, and the number of its last claim.
    pub(crate) fn record_project(&mut self, priority: i32, project: i64, turn: Turn, served: i64) {
        let last = self.projects.entry((priority, project)).or_insert(turn);
        if (turn.round, turn.number) > (last.round, last.number) {
            *last = turn;
        }
        let newest = self.current.entry(priority).or_insert(turn.round);
        *newest = turn.round.max(*newest);
        for number in [
            self.served_projects.entry((priority, project)).or_default(),
            self.served.entry(priority).or_default(),
        ] {
            *number = served.max(*number);
        }
    }

    /// Records the last round of an owner within its project, and the number of its last claim.
    pub(crate) fn record_owner(
        &mut self,
        priority: i32,
        (project, owner): (i64, Owner),
        round: i64,
        served: i64,
    ) {
        let number = self.served_owners.entry((priority, owner)).or_default();
        *number = served.max(*number);
        let last = self.owners.entry((priority, owner)).or_insert(round);
        *last = round.max(*last);
        let newest = self.current_of_project.entry((priority, project)).or_insert(round);
        *newest = round.max(*newest);
    }

    /// Records a claimed job.
    pub(crate) fn record(&mut self, claimed: &ScheduledJob) {
        let (priority, project) = (claimed.priority, claimed.project.id);
        self.record_project(priority, project, claimed.turn, claimed.served);
        self.record_owner(priority, (project, claimed.owner), claimed.round, claimed.served);
    }

    /// The next turn of a project at a priority.
    fn next_turn(&self, priority: i32, project: Project) -> Turn {
        let round = self.current.get(&priority).copied().unwrap_or(0);
        match self.projects.get(&(priority, project.id)) {
            Some(last) if last.round >= round => last.later(1, project.share),
            _ => Turn { round, number: 0 },
        }
    }

    /// The round of an owner's next job of that priority.
    fn next_round(&self, priority: i32, project: i64, owner: Owner) -> i64 {
        let current = self.current_of_project.get(&(priority, project)).copied().unwrap_or(0);
        self.owners.get(&(priority, owner)).map_or(current, |last| current.max(last + 1))
    }

    /// Number of jobs of one priority that come before a job: `own` jobs of its owner, and those jobs of other owners, each with their
    /// number, that take an earlier turn. Jobs of the same turn are not counted.
    pub(crate) fn jobs_before(
        &self,
        priority: i32,
        (project, owner, own): (Project, Owner, u64),
        others: impl IntoIterator<Item = (Project, Owner, u64)>,
    ) -> u64 {
        let round = self.next_round(priority, project.id, owner).saturating_add_unsigned(own);
        let (mut in_project, mut other_projects) = (own, HashMap::new());
        for (other, owner, jobs) in others {
            if other.id == project.id {
                let rounds = round.saturating_sub(self.next_round(priority, other.id, owner)).max(0);
                in_project += jobs.min(rounds.unsigned_abs());
            } else {
                other_projects.entry(other.id).or_insert((other, 0)).1 += jobs;
            }
        }
        let turn = self.next_turn(priority, project).later(in_project, project.share);
        let earlier = |(other, jobs): &(Project, u64)| {
            let next = self.next_turn(priority, *other);
            let share = i64::from(other.share);
            // Those of the same round that come earlier in it.
            let part =
                (i64::from(turn.number) * share + i64::from(project.share) - 1) / i64::from(project.share);
            let turns = turn.round.saturating_sub(next.round).saturating_mul(share).saturating_add(part);
            (*jobs).min(turns.saturating_sub(next.number.into()).max(0).unsigned_abs())
        };
        in_project + other_projects.values().map(earlier).sum::<u64>()
    }

    /// The next jobs of these queues, at most `max`, without `taken` ones. Of jobs that would compute the same fill, the first.
    pub(crate) fn next_jobs(&self, queues: &[OwnerQueue], taken: &Taken, max: usize) -> Vec<ScheduledJob> {
        let mut fills = taken.fills.clone();
        let mut lanes = self.lanes(queues);
        let mut scheduled = Vec::new();
        while scheduled.len() < max {
            let is_taken = |job: EligibleJob| {
                taken.jobs.contains(&job.seq) || job.fill.is_some_and(|it| fills.contains(&it))
            };
            let ranked = lanes.iter_mut().filter_map(|lane| {
                let (place, seq) = lane.first(is_taken)?;
                let rank = (-i64::from(lane.priority), lane.turn.place(lane.project.share), lane.served, seq);
                Some((rank, lane, place))
            });
            let Some((_, lane, place)) = ranked.min_by_key(|(rank, ..)| *rank) else { break };
            let before = self.served.get(&lane.priority).copied().unwrap_or(0);
            let served = before.saturating_add_unsigned(scheduled.len() as u64 + 1);
            let Some(next) = lane.take(place, served) else { break };
            scheduled.push(next);
            fills.extend(next.job.fill);
        }
        scheduled
    }

    /// The queues by priority and project.
    fn lanes<'q>(&self, queues: &'q [OwnerQueue]) -> Vec<Lane<'q>> {
        let (mut lanes, mut places) = (Vec::<Lane<'q>>::new(), HashMap::new());
        for queue in queues {
            let OwnerQueue { priority, project, owner, .. } = *queue;
            let place = *places.entry((priority, project.id)).or_insert_with(|| {
                let turn = self.next_turn(priority, project);
                let served = self.served_projects.get(&(priority, project.id)).copied().unwrap_or(0);
                lanes.push(Lane { priority, project, turn, served, heads: Vec::new() });
                lanes.len() - 1
            });
            lanes[place].heads.push(Head {
                queue,
                next: 0,
                round: self.next_round(priority, project.id, owner),
                served: self.served_owners.get(&(priority, owner)).copied().unwrap_or(0),
            });
        }
        lanes
    }
}

/// The queues of one project at one priority, and its next turn.
struct Lane<'q> {
    priority: i32,
    project: Project,
    turn: Turn,
    /// The number of its last claim; 0 without one.
    served: i64,
    heads: Vec<Head<'q>>,
}

impl Lane<'_> {
    /// The place of the head with the next free job, and the number of this job.
    fn first(&mut self, is_taken: impl Fn(EligibleJob) -> bool) -> Option<(usize, i64)> {
        let free = self.heads.iter_mut().enumerate().filter_map(|(place, head)| {
            head.pass(&is_taken);
            Some((head.round, head.served, head.job()?.seq, place))
        });
        free.min().map(|(.., seq, place)| (place, seq))
    }

    /// Takes the next job of a head for the claim of this number.
    fn take(&mut self, place: usize, served: i64) -> Option<ScheduledJob> {
        let head = self.heads.get_mut(place)?;
        let (job, owner, round) = (head.job()?, head.queue.owner, head.round);
        (head.next, head.round, head.served) = (head.next + 1, head.round + 1, served);
        let Self { priority, project, turn, .. } = *self;
        (self.turn, self.served) = (turn.later(1, project.share), served);
        Some(ScheduledJob { job, priority, project, owner, turn, round, served })
    }
}

/// The rest of an owner queue, and the round of its next job.
struct Head<'q> {
    queue: &'q OwnerQueue,
    next: usize,
    round: i64,
    /// The number of the last claim of the owner; 0 without one.
    served: i64,
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
#[path = "fair_share_tests.rs"]
mod tests;
