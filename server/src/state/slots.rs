//! Slots of workers: the number of jobs that each can run at the same time, as its claims say.
//!
//! A claim asks for as many jobs as the worker has free slots. These and the jobs that it holds are its slots. A run with several threads
//! takes several slots of a short queue, so that the maximum counts. After a restart of the server the next claim tells again.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use roost_api::ids::WorkerId;

/// Maximum number of workers; then all are forgotten.
const MAX_WORKERS: usize = 100_000;

/// The slots of every worker that has claimed since the server started.
#[derive(Default)]
pub(crate) struct WorkerSlots(Mutex<HashMap<WorkerId, u32>>);

impl WorkerSlots {
    fn lock(&self) -> MutexGuard<'_, HashMap<WorkerId, u32>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records held and free slots at a claim.
    pub(crate) fn record(&self, worker: WorkerId, slots: u32) {
        let mut known = self.lock();
        if known.len() >= MAX_WORKERS {
            known.clear();
        }
        let most = known.entry(worker).or_default();
        *most = slots.max(*most);
    }

    /// The slots of a worker on `threads` threads that runs `jobs` jobs.
    pub(crate) fn of(&self, worker: &str, backend: &str, threads: u32, jobs: u32) -> u32 {
        let known = worker.parse().ok().and_then(|worker: WorkerId| self.lock().get(&worker).copied());
        // A worker of the CPU runs a job on each thread, unless its claims say otherwise.
        let unknown = if backend == "cpu" { threads } else { 1 };
        known.unwrap_or(unknown).max(jobs).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_of_a_worker_follow_its_claims() {
        let (slots, worker) = (WorkerSlots::default(), WorkerId::new());
        let of = |backend, jobs| slots.of(&worker.to_string(), backend, 8, jobs);
        assert_eq!((of("cpu", 0), of("gpu", 0), of("gpu", 3)), (8, 1, 3), "before a claim");
        slots.record(worker, 4);
        slots.record(worker, 2);
        assert_eq!((of("cpu", 0), of("cpu", 5)), (4, 5));
    }
}
