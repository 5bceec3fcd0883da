//! What claims get of the jobs that suit their workers.
//!
//! Claims that came in together get what they would have got one after the other.
//!
//! Jobs that were lost together run alone from then on, so that one that kills its worker takes no others along: such a job goes
//! to a worker that holds nothing, and that one gets nothing beside it. When it is at the head of the queue, nobody passes it
//! by: else a worker of several places would never be empty.

use std::collections::HashSet;

use super::turns::{Line, Next, Rounds};

/// What the worker holds already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Holding {
    /// Jobs that it runs or has yet to deliver.
    pub jobs: u32,
    /// Whether one of them is to run alone.
    pub alone: bool,
}

/// A claim.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wanted {
    /// Which of the lists has what suits its worker.
    pub list: usize,
    /// What its worker holds.
    pub holding: Holding,
    /// At most so many jobs.
    pub most: usize,
}

/// What a claim gets.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Share {
    /// The jobs, in the order of the queue.
    pub jobs: Vec<Next>,
    /// There is work for it, which it may have once it holds nothing else.
    pub held_back: bool,
}

/// What each claim gets, in their order; the rounds move on with them. Each list has as many jobs of each line as all claims want
/// together, or all there are.
pub(crate) fn share(wanted: &[Wanted], lists: &[Vec<Line>], rounds: &mut Rounds) -> Vec<Share> {
    let mut taken = HashSet::new();
    let mut get = |wanted: &Wanted| {
        let mut jobs = rounds.next_jobs(&lists[wanted.list], &taken, wanted.most);
        let is_any = !jobs.is_empty();
        let alone: Vec<_> = jobs.iter().map(|next| next.job.alone).collect();
        jobs.truncate(batch(wanted.holding, &alone));
        for next in &jobs {
            rounds.note(next.priority, next.owner, next.round);
            taken.insert(next.job.seq);
        }
        Share { held_back: jobs.is_empty() && is_any, jobs }
    };
    wanted.iter().map(&mut get).collect()
}

/// How many it gets of the candidates, which are in the order of the queue; each says whether it is to run alone.
fn batch(holding: Holding, candidates: &[bool]) -> usize {
    match candidates {
        _ if holding.alone => 0,
        [true, ..] => usize::from(holding.jobs == 0),
        others => others.iter().take_while(|alone| !**alone).count(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::turns::Candidate;
    use super::*;

    /// The jobs of one owner.
    fn line(owner: i64, jobs: impl IntoIterator<Item = (i64, bool)>) -> Line {
        let jobs = jobs.into_iter().map(|(seq, alone)| Candidate { seq, alone }).collect();
        Line { priority: 0, owner, jobs }
    }

    fn numbers(share: &Share) -> Vec<i64> {
        share.jobs.iter().map(|next| next.job.seq).collect()
    }

    #[test]
    fn what_is_to_run_alone_does() {
        let idle = Holding::default();
        let busy = Holding { jobs: 1, alone: false };
        let taken = Holding { jobs: 1, alone: true };
        for (holding, candidates, expected) in [
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
            assert_eq!(batch(holding, &candidates), expected, "{holding:?} {candidates:?}");
        }
    }

    #[test]
    fn what_one_has_taken_another_does_not_get() {
        let any = |jobs: [i64; 3]| vec![line(1, jobs.map(|seq| (seq, false)))];
        let wanted = |list, most| Wanted { list, holding: Holding::default(), most };
        let gets = |wanted: &[Wanted], lists: &[Vec<Line>]| -> Vec<Vec<i64>> {
            share(wanted, lists, &mut Rounds::default()).iter().map(numbers).collect()
        };
        // Jobs 1 and 3 suit both kinds of workers.
        let lists = [any([1, 2, 3]), any([1, 3, 4])];
        let claims = [wanted(1, 2), wanted(0, 1), wanted(1, 1), wanted(0, 1)];
        assert_eq!(gets(&claims, &lists), [vec![1, 3], vec![2], vec![4], vec![]]);
        assert!(gets(&[], &[]).is_empty());
    }

    #[test]
    fn claims_of_other_workers_count_as_turns_at_once() {
        let many = |from| (from..from + 10).map(|seq| (seq, false));
        // The second list has what suits another kind of worker: of the second owner nothing.
        let lists = [vec![line(1, many(0)), line(2, many(10))], vec![line(1, many(0))]];
        let wanted = |list, most| Wanted { list, holding: Holding::default(), most };
        let mut rounds = Rounds::default();
        let got = share(&[wanted(1, 3), wanted(0, 4)], &lists, &mut rounds);
        assert_eq!(got.iter().map(numbers).collect::<Vec<_>>(), [vec![0, 1, 2], vec![10, 3, 11, 4]]);
        assert_eq!(rounds.next_jobs(&lists[0], &HashSet::from([0, 1, 2, 3, 4, 10, 11]), 1)[0].job.seq, 12);
    }

    #[test]
    fn what_is_to_run_alone_holds_back_who_is_busy_and_goes_to_the_next() {
        let list = vec![line(1, [(1, true), (2, false)])];
        let wanted = |jobs| Wanted { list: 0, holding: Holding { jobs, alone: false }, most: 2 };
        let claims = [wanted(1), wanted(0), wanted(1), wanted(0)];
        let got = share(&claims, &[list], &mut Rounds::default());
        let got: Vec<_> = got.iter().map(|share| (numbers(share), share.held_back)).collect();
        assert_eq!(got, [(vec![], true), (vec![1], false), (vec![2], false), (vec![], false)]);
    }
}
