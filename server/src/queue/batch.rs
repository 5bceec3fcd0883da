//! What one claim gets of the jobs that suit the worker.
//!
//! Jobs that were lost together run alone from then on, so that one that kills its worker takes no others along: such a job goes
//! to a worker that holds nothing, and that one gets nothing beside it. When it is at the head of the queue, nobody passes it
//! by: else a worker of several places would never be empty.

/// What the worker holds already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Holding {
    /// Jobs that it runs or has yet to deliver.
    pub jobs: u32,
    /// Whether one of them is to run alone.
    pub alone: bool,
}

/// How many it gets of the candidates, which are in the order of the queue; each says whether it is to run alone.
pub(crate) fn batch(holding: Holding, candidates: &[bool]) -> usize {
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
}
