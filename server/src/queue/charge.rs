//! The charge of an ended attempt against the budget of its project.

use roost_api::time::Timestamp;

/// Maximum number of threads that count: the sum of a project must not overflow if a worker registers nonsense.
const MAX_THREADS: u32 = 65_536;

/// An attempt, and what its worker has registered.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attempt {
    /// When it was claimed.
    pub claimed_at: Timestamp,
    /// When its worker was last seen.
    pub last_seen_at: Timestamp,
    /// Whether its worker computes on the CPU.
    pub on_cpu: bool,
    /// Threads of its worker.
    pub threads: u32,
    /// Jobs that its worker can run at the same time, if a claim has said so.
    pub slots: Option<u32>,
}

/// The cost that a result states about its run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stated {
    /// Threads of the run.
    pub threads: u32,
    /// Wall time in milliseconds. It includes earlier attempts that the run continued.
    pub wall_ms: i64,
}

/// Milliseconds times threads of an attempt that ended at `at`.
///
/// A result may arrive long after its run, when the server or the network was down: no more counts than it states. Of an attempt
/// without a result, the time until its worker was last seen counts. No run counts more threads than its worker has.
pub(crate) fn core_ms(attempt: Attempt, stated: Option<Stated>, at: Timestamp) -> i64 {
    let (until, limit_ms, threads) = match stated {
        Some(stated) => (at, stated.wall_ms, stated.threads.clamp(1, attempt.threads.clamp(1, MAX_THREADS))),
        None => (at.min(attempt.last_seen_at), i64::MAX, part(attempt)),
    };
    let elapsed_ms = until.0.saturating_sub(attempt.claimed_at.0);
    elapsed_ms.min(limit_ms).max(0).saturating_mul(threads.into())
}

/// The threads of one slot.
fn part(attempt: Attempt) -> u32 {
    match attempt.slots {
        Some(slots) if attempt.on_cpu => (attempt.threads.min(MAX_THREADS) / slots.max(1)).max(1),
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ATTEMPT: Attempt = Attempt {
        claimed_at: Timestamp(1000),
        last_seen_at: Timestamp(3000),
        on_cpu: true,
        threads: 8,
        slots: Some(2),
    };

    #[test]
    fn a_result_counts_no_more_than_it_states_and_than_has_passed() {
        let count = |threads, wall_ms, at| core_ms(ATTEMPT, Some(Stated { threads, wall_ms }), Timestamp(at));
        assert_eq!(count(3, 500, 1_000_000), 1500, "it arrived late");
        assert_eq!(count(3, 9000, 2000), 3000, "earlier attempts took the rest");
        assert_eq!(count(65_536, 500, 2000), 4000, "more threads than its worker has");
        assert_eq!(count(0, 500, 2000), 500);
        assert_eq!(count(3, 500, 0), 0, "the clock was set back");
        assert_eq!(count(3, -5, 2000), 0);
    }

    #[test]
    fn without_a_result_a_slot_counts() {
        let count = |attempt, at| core_ms(attempt, None, Timestamp(at));
        assert_eq!(count(ATTEMPT, 1_000_000), 4 * 2000, "until the worker was last seen");
        assert_eq!(count(ATTEMPT, 2000), 4 * 1000);
        assert_eq!(count(Attempt { last_seen_at: Timestamp(0), ..ATTEMPT }, 2000), 0);
        for (attempt, threads) in [
            (Attempt { slots: Some(16), ..ATTEMPT }, 1),
            (Attempt { slots: None, ..ATTEMPT }, 1),
            (Attempt { on_cpu: false, slots: Some(1), ..ATTEMPT }, 1),
            (Attempt { slots: Some(1), ..ATTEMPT }, 8),
            (Attempt { slots: Some(1), threads: u32::MAX, ..ATTEMPT }, 65_536),
        ] {
            assert_eq!(count(attempt, 2000), threads * 1000, "{attempt:?}");
        }
    }
}
