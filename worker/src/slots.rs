//! Slots: how many jobs run at once, and on how many threads each.
//!
//! Runs on one thread each make the most of the processors: they never wait for each other, as the threads of one run do in every step. A run
//! gets more threads only when the queue has too few jobs for all of them. Results do not depend on threads.

use std::sync::Arc;

use serde_json::Value;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::device::{Device, MAX_GPU_SLOTS};

/// Jobs at the same time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Slots {
    /// On the CPU as many as threads, memory and queue allow; on a GPU as many as its memory holds, up to 16.
    #[default]
    Auto,
    /// This many.
    Fixed(usize),
}

/// The slots of a worker. A permit is a slot of a fixed number, or a thread.
#[derive(Debug)]
pub(crate) struct SlotPool {
    free: Arc<Semaphore>,
    /// Threads of each run; none where they depend on the claim.
    threads_per_run: Option<usize>,
}

/// The slot of a run, which is free again on drop.
#[derive(Debug)]
pub(crate) struct Slot {
    /// Threads of the run.
    pub(crate) threads: usize,
    /// None for a job beyond the slots, which a repeated claim can bring.
    _permit: Option<OwnedSemaphorePermit>,
}

impl SlotPool {
    /// Slots on a device with this many threads.
    pub(crate) fn new(slots: Slots, device: &Device, threads: usize) -> Self {
        let fixed = match slots {
            Slots::Fixed(slots) => Some(slots.max(1)),
            Slots::Auto if device.backend() == "cpu" => None,
            Slots::Auto => Some(MAX_GPU_SLOTS),
        };
        Self {
            free: Arc::new(Semaphore::new(fixed.unwrap_or(threads))),
            threads_per_run: fixed.map(|slots| (threads / slots).max(1)),
        }
    }

    /// The number of jobs that may be claimed; waits until it is 1 or more.
    pub(crate) async fn wait(&self) -> usize {
        let _one = self.free.acquire().await.expect("the semaphore is never closed");
        1 + self.free.available_permits()
    }

    /// The slots of claimed runs with these numbers of bodies. A claim asked for `asked` jobs when this many fitted: one that brings fewer
    /// has emptied the queue.
    pub(crate) fn assign(&self, bodies: &[u64], asked: usize, fitting: usize) -> Vec<Slot> {
        let free = self.free.available_permits();
        let threads = match self.threads_per_run {
            Some(threads) => vec![threads; bodies.len()],
            // More jobs may be queued and fit: the next claim asks for them.
            None if bodies.len() == asked && asked < free.min(fitting) => vec![1; bodies.len()],
            None => threads_of_runs(free, bodies),
        };
        let slot = |threads: usize| {
            let permits = if self.threads_per_run.is_some() { 1 } else { threads as u32 };
            Slot { threads, _permit: self.free.clone().try_acquire_many_owned(permits).ok() }
        };
        threads.into_iter().map(slot).collect()
    }
}

/// Shares free threads between runs: each gets one, and the rest go to the run with the most bodies per thread. A body is the work of one
/// thread, so that a run gets no more threads than bodies.
fn threads_of_runs(free: usize, bodies: &[u64]) -> Vec<usize> {
    let mut threads = vec![1; bodies.len()];
    for _ in bodies.len()..free {
        // Of equal ones the first.
        let most = (0..bodies.len()).rev().max_by(|&one, &other| {
            let share = |run: usize| bodies[run] as f64 / threads[run] as f64;
            share(one).total_cmp(&share(other))
        });
        match most {
            Some(run) if bodies[run] > threads[run] as u64 => threads[run] += 1,
            _ => break,
        }
    }
    threads
}

/// Single spheres that the solver stores as one body.
const SPHERES_PER_BODY: u64 = 512;

/// The number of bodies of a complete scenario; many where the scenario does not say.
pub(crate) fn bodies(scenario: &Value) -> u64 {
    let count = scenario.pointer("/product/count").and_then(Value::as_u64).unwrap_or(u64::MAX);
    let has_spheres = scenario.pointer("/product/spheres").and_then(Value::as_bool).unwrap_or(false);
    if has_spheres { count.div_ceil(SPHERES_PER_BODY) } else { count }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn as_many_runs_as_threads_get_one_each() {
        assert_eq!(threads_of_runs(4, &[191; 4]), [1; 4]);
        assert_eq!(threads_of_runs(2, &[191; 3]), [1; 3], "never none");
        assert_eq!(threads_of_runs(3, &[]), [0; 0]);
    }

    #[test]
    fn threads_without_a_run_go_to_the_largest_runs() {
        assert_eq!(threads_of_runs(16, &[191]), [16]);
        assert_eq!(threads_of_runs(16, &[191, 191, 191]), [6, 5, 5]);
        assert_eq!(threads_of_runs(8, &[12, 191]), [1, 7]);
        assert_eq!(threads_of_runs(16, &[1]), [1], "one body is the work of one thread");
        assert_eq!(threads_of_runs(16, &[2, 3, 1]), [2, 3, 1], "the rest stays free for the next jobs");
    }

    #[tokio::test]
    async fn slots_are_free_again_when_runs_end() {
        let pool = SlotPool::new(Slots::Auto, &Device::cpu(), 4);
        assert_eq!(pool.wait().await, 4);
        let threads = |slots: &[Slot]| slots.iter().map(|slot| slot.threads).collect::<Vec<_>>();
        let mut deep = pool.assign(&[191; 4], 4, usize::MAX);
        assert_eq!(threads(&deep), [1; 4]);
        deep.truncate(1);
        assert_eq!(pool.wait().await, 3);
        let last = pool.assign(&[191], 3, usize::MAX);
        assert_eq!(threads(&last), [3], "the queue is empty");
        drop((deep, last));
        // A claim that brings all it asked for may have left jobs behind.
        assert_eq!(threads(&pool.assign(&[191, 191], 2, usize::MAX)), [1, 1]);
        assert_eq!(pool.wait().await, 4);
        assert_eq!(threads(&pool.assign(&[191, 191], 2, 2)), [2, 2], "no more fit into memory");
    }

    #[tokio::test]
    async fn fixed_slots_share_the_threads() {
        for (slots, processors, threads) in [(1, 4, 4), (2, 4, 2), (3, 4, 1), (8, 4, 1)] {
            let pool = SlotPool::new(Slots::Fixed(slots), &Device::cpu(), processors);
            assert_eq!(pool.wait().await, slots);
            let slot = pool.assign(&[1], 1, usize::MAX);
            assert_eq!(slot[0].threads, threads);
            assert_eq!(pool.free.available_permits(), slots - 1);
        }
    }

    #[test]
    fn bodies_are_read_from_the_scenario() {
        assert_eq!(bodies(&json!({"product": {"count": 12}})), 12);
        assert_eq!(bodies(&json!({"product": {"count": 1025, "spheres": true}})), 3);
        assert_eq!(bodies(&json!({})), u64::MAX);
    }
}
