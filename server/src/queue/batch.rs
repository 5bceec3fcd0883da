//! What claims get of the jobs that suit their workers.
//!
//! Claims that came in together get what they would have got one after the other.
//!
//! Jobs that were lost together run alone from then on, so that one that kills its worker takes no others along: such a job goes
//! to a worker that holds nothing, and that one gets nothing beside it. When it is at the head of the queue, nobody passes it
//! by: else a worker of several places would never be empty.

use std::collections::HashSet;

/// What the worker holds already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Holding {
    /// Jobs that it runs or has yet to deliver.
    pub jobs: u32,
    /// Whether one of them is to run alone.
    pub alone: bool,
}

/// A job that suits a worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Candidate {
    /// Its number.
    pub seq: i64,
    /// Whether it is to run alone.
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
    /// Numbers of the jobs, in the order of the queue.
    pub jobs: Vec<i64>,
    /// There is work for it, which it may have once it holds nothing else.
    pub held_back: bool,
}

/// What each claim gets, in their order. Each list is in the order of the queue and has at least as many jobs as all claims
/// want together, or all there are.
pub(crate) fn share(wanted: &[Wanted], lists: &[Vec<Candidate>]) -> Vec<Share> {
    let mut taken = HashSet::<i64>::new();
    let mut get = |wanted: &Wanted| {
        let left = lists[wanted.list].iter().filter(|candidate| !taken.contains(&candidate.seq));
        let left: Vec<_> = left.take(wanted.most).copied().collect();
        let alone: Vec<_> = left.iter().map(|candidate| candidate.alone).collect();
        let count = batch(wanted.holding, &alone);
        let jobs: Vec<_> = left[..count].iter().map(|candidate| candidate.seq).collect();
        taken.extend(jobs.iter().copied());
        Share { jobs, held_back: count == 0 && !left.is_empty() }
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
    use super::*;

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
        let job = |seq| Candidate { seq, alone: false };
        let wanted = |list, most| Wanted { list, holding: Holding::default(), most };
        let gets = |wanted: &[Wanted], lists: &[Vec<Candidate>]| -> Vec<Vec<i64>> {
            share(wanted, lists).into_iter().map(|share| share.jobs).collect()
        };
        // Jobs 1 and 3 suit both kinds of workers.
        let lists = [vec![job(1), job(2), job(3)], vec![job(1), job(3), job(4)]];
        let claims = [wanted(1, 2), wanted(0, 1), wanted(1, 1), wanted(0, 1)];
        assert_eq!(gets(&claims, &lists), [vec![1, 3], vec![2], vec![4], vec![]]);
        assert!(gets(&[], &[]).is_empty());
    }

    #[test]
    fn what_is_to_run_alone_holds_back_who_is_busy_and_goes_to_the_next() {
        let list = vec![Candidate { seq: 1, alone: true }, Candidate { seq: 2, alone: false }];
        let wanted = |jobs| Wanted { list: 0, holding: Holding { jobs, alone: false }, most: 2 };
        let got = share(&[wanted(1), wanted(0), wanted(1), wanted(0)], &[list]);
        let got: Vec<_> = got.into_iter().map(|share| (share.jobs, share.held_back)).collect();
        assert_eq!(got, [(vec![], true), (vec![1], false), (vec![2], false), (vec![], false)]);
    }
}
