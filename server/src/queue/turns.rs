//! The order of the queue: whose job is next.
//!
//! 1. The job of the higher priority.
//! 2. Among those, owners in turn. An owner is a token that asked for jobs; on a server without tokens there is one owner.
//! 3. Among the jobs of one owner, sweeps in turn, and within a sweep the design points by index. Each job carries this order as a
//!    number, its *turn*: the jobs of a sweep count upwards from the turn that the owner's line has come to. A single job takes the
//!    turn that the line has come to. Jobs of equal turn go by age.
//!
//! The jobs of one owner at one priority make a *line*. Owners take turns in *rounds*, which count upwards in each priority: a line has
//! one job a round, and the job of the earlier round is next. An owner that was away begins with the round under way. It neither waits
//! behind those that are there, nor is it paid back for the time that it was away. A job that is claimed again, after a retry or a
//! lost lease, takes a round again: it takes a worker's time again.

use std::collections::{HashMap, HashSet};

/// Who asked for a job: a row of `owners`.
pub(crate) type Owner = i64;

/// A job that suits a worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Candidate {
    /// Its number: older jobs have lower ones.
    pub seq: i64,
    /// Whether it is to run alone.
    pub alone: bool,
}

/// The first jobs of one owner at one priority that suit a worker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Line {
    /// Higher is claimed first.
    pub priority: i32,
    /// Whose they are.
    pub owner: Owner,
    /// By turn, then age.
    pub jobs: Vec<Candidate>,
}

/// A job that is next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Next {
    /// Which.
    pub job: Candidate,
    /// Its priority.
    pub priority: i32,
    /// Its owner.
    pub owner: Owner,
    /// The round that it takes.
    pub round: i64,
}

/// The rounds that owners have come to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Rounds {
    last: HashMap<(i32, Owner), i64>,
    under_way: HashMap<i32, i64>,
}

impl Rounds {
    /// An owner had a job of that priority in that round.
    pub(crate) fn note(&mut self, priority: i32, owner: Owner, round: i64) {
        let last = self.last.entry((priority, owner)).or_insert(round);
        *last = round.max(*last);
        let newest = self.under_way.entry(priority).or_insert(round);
        *newest = round.max(*newest);
    }

    /// The round of an owner's next job of that priority.
    fn next(&self, priority: i32, owner: Owner) -> i64 {
        let under_way = self.under_way.get(&priority).copied().unwrap_or(0);
        self.last.get(&(priority, owner)).map_or(under_way, |last| under_way.max(last + 1))
    }

    /// The next jobs of some lines, at most so many, without those that are taken.
    pub(crate) fn next_jobs(&self, lines: &[Line], taken: &HashSet<i64>, most: usize) -> Vec<Next> {
        let mut next = Vec::new();
        for Line { priority, owner, jobs } in lines {
            let (priority, owner) = (*priority, *owner);
            let rounds = self.next(priority, owner)..;
            let free = jobs.iter().filter(|job| !taken.contains(&job.seq)).take(most);
            next.extend(free.zip(rounds).map(|(job, round)| Next { job: *job, priority, owner, round }));
        }
        next.sort_by_key(|next| (-i64::from(next.priority), next.round, next.job.seq));
        next.truncate(most);
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(priority: i32, owner: Owner, jobs: std::ops::Range<i64>) -> Line {
        Line { priority, owner, jobs: jobs.map(|seq| Candidate { seq, alone: false }).collect() }
    }

    /// Claims one by one, or several at once; says whose jobs they were.
    fn claimed(
        rounds: &mut Rounds,
        taken: &mut HashSet<i64>,
        lines: &[Line],
        claims: &[usize],
    ) -> Vec<Owner> {
        let mut owners = Vec::new();
        for most in claims {
            for next in rounds.next_jobs(lines, taken, *most) {
                rounds.note(next.priority, next.owner, next.round);
                taken.insert(next.job.seq);
                owners.push(next.owner);
            }
        }
        owners
    }

    #[test]
    fn owners_take_turns_however_many_jobs_are_claimed_at_once() {
        let lines = [line(0, 1, 0..100), line(0, 2, 100..200), line(0, 3, 200..203)];
        let anew = |claims: &[usize]| claimed(&mut Rounds::default(), &mut HashSet::new(), &lines, claims);
        let one_by_one = anew(&[1; 20]);
        assert_eq!(one_by_one[..9], [1, 2, 3, 1, 2, 3, 1, 2, 3]);
        assert_eq!(one_by_one[9..], [1, 2, 1, 2, 1, 2, 1, 2, 1, 2, 1], "the third has no more");
        for claims in [&[20][..], &[7, 1, 12], &[2; 10]] {
            assert_eq!(anew(claims), one_by_one, "{claims:?}");
        }
    }

    #[test]
    fn priority_comes_first_and_has_rounds_of_its_own() {
        let lines = [line(5, 2, 100..103), line(0, 1, 0..9), line(0, 2, 10..19)];
        let owners = claimed(&mut Rounds::default(), &mut HashSet::new(), &lines, &[7]);
        assert_eq!(owners, [2, 2, 2, 1, 2, 1, 2]);
    }

    #[test]
    fn who_comes_late_has_a_turn_at_once_and_then_no_more_than_others() {
        let (mut rounds, mut taken) = (Rounds::default(), HashSet::new());
        let lines = [line(0, 1, 0..100), line(0, 2, 100..200)];
        assert_eq!(claimed(&mut rounds, &mut taken, &lines[..1], &[64]), [1; 64]);
        assert_eq!(claimed(&mut rounds, &mut taken, &lines, &[1; 6]), [2, 1, 2, 1, 2, 1]);
        // Who has a single job again and again has one a round.
        let rare = (300..310).flat_map(|seq| {
            let lines = [lines[0].clone(), line(0, 3, seq..seq + 1)];
            claimed(&mut rounds, &mut taken, &lines, &[1])
        });
        let rare: Vec<_> = rare.collect();
        assert_eq!(rare.iter().filter(|owner| **owner == 3).count(), 5, "{rare:?}");
    }

    #[test]
    fn whose_jobs_suit_other_workers_keeps_no_turns_for_later() {
        let (mut rounds, mut taken) = (Rounds::default(), HashSet::new());
        let lines = [line(0, 1, 0..100), line(0, 2, 100..200)];
        claimed(&mut rounds, &mut taken, &lines[1..], &[50]);
        claimed(&mut rounds, &mut taken, &lines[..1], &[10]);
        assert_eq!(claimed(&mut rounds, &mut taken, &lines, &[1; 6]), [2, 1, 2, 1, 2, 1]);
    }
}
