//! Retries: their number by class of failure, and the pause before each.

use std::time::Duration;

use roost_api::time::Timestamp;

use super::{JobChange, JobSnapshot, lease_end};

/// Number of attempts that may fail with one class, and the pauses between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RetryLimit {
    /// Attempts that may fail; 0 is no limit.
    pub attempts: u32,
    /// The pause after the first failure; it doubles with every further one.
    pub first_pause: Duration,
    /// The maximum pause.
    pub max_pause: Duration,
}

/// Retries without a request of a user, by class of failure. Other classes are not retried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RetryPolicy {
    /// After [`FailureClass::Worker`](roost_api::job::FailureClass::Worker).
    pub worker: RetryLimit,
    /// After [`FailureClass::Lost`](roost_api::job::FailureClass::Lost).
    pub lost: RetryLimit,
}

impl Default for RetryPolicy {
    fn default() -> Self {
        let seconds = Duration::from_secs;
        Self {
            worker: RetryLimit { attempts: 3, first_pause: seconds(2), max_pause: seconds(60) },
            // Short: the job has waited for the lease to expire.
            lost: RetryLimit { attempts: 5, first_pause: seconds(1), max_pause: seconds(60) },
        }
    }
}

impl RetryLimit {
    /// Requeues a job after failure number `failures` of this class; none when it has no attempt left.
    pub(super) fn requeue(
        &self,
        job: &JobSnapshot,
        failures: u32,
        alone: bool,
        now: Timestamp,
    ) -> Option<JobChange> {
        if self.attempts != 0 && failures >= self.attempts {
            return None;
        }
        let pause = self.pause(job, failures);
        let not_before = (!pause.is_zero()).then(|| lease_end(now, pause));
        Some(JobChange::Requeue { not_before, alone })
    }

    /// Between half and all of a ceiling that doubles with every failure.
    fn pause(&self, job: &JobSnapshot, failures: u32) -> Duration {
        let doublings = failures.saturating_sub(1).min(30);
        let ceiling = self.first_pause.saturating_mul(1 << doublings).min(self.max_pause);
        ceiling.mul_f64(0.5 + 0.5 * jitter(job))
    }
}

/// A number from 0 to 1, from job and attempt: jobs that failed together return at different times, and a replay has the same
/// pauses.
fn jitter(job: &JobSnapshot) -> f64 {
    let mut hasher = blake3::Hasher::new();
    hasher.update(job.id.0.as_bytes()).update(&job.attempt.to_le_bytes());
    let bytes = *hasher.finalize().as_bytes();
    f64::from(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])) / f64::from(u32::MAX)
}

#[cfg(test)]
mod tests {
    use roost_api::ids::JobId;
    use roost_api::job::JobState;

    use super::*;

    const LIMIT: RetryLimit =
        RetryLimit { attempts: 0, first_pause: Duration::from_secs(2), max_pause: Duration::from_secs(60) };

    fn job(attempt: u32) -> JobSnapshot {
        let id = JobId::new();
        let state = JobState::Running;
        JobSnapshot {
            id,
            state,
            cancelling: false,
            paused: false,
            attempt,
            worker_failures: 0,
            lost: 0,
            failure_class: None,
        }
    }

    #[test]
    fn pauses_double_up_to_a_limit_and_differ_between_jobs() {
        for (failures, ceiling) in [(1, 2), (2, 4), (3, 8), (5, 32), (6, 60), (u32::MAX, 60)] {
            let pauses: Vec<_> =
                (0..200).map(|_| LIMIT.pause(&job(failures), failures).as_secs_f64()).collect();
            let (low, high) = (0.5 * f64::from(ceiling), f64::from(ceiling));
            assert!(pauses.iter().all(|pause| (low..=high).contains(pause)), "{failures}: {pauses:?}");
            let spread = pauses.iter().fold(0.0_f64, |a, b| a.max(*b))
                - pauses.iter().fold(1e9, |a: f64, b| a.min(*b));
            assert!(spread > 0.4 * high, "{failures}: pauses are within {spread} s");
        }
        let same = job(3);
        assert_eq!(LIMIT.pause(&same, 3), LIMIT.pause(&same, 3), "the same in every replay");
    }

    #[test]
    fn zero_attempts_are_no_limit() {
        assert!(LIMIT.requeue(&job(1), 1_000_000, false, Timestamp(0)).is_some());
        let three = RetryLimit { attempts: 3, ..LIMIT };
        assert!(three.requeue(&job(1), 2, false, Timestamp(0)).is_some());
        assert_eq!(three.requeue(&job(1), 3, false, Timestamp(0)), None);
        let at_once = RetryLimit { first_pause: Duration::ZERO, ..LIMIT };
        let requeue = JobChange::Requeue { not_before: None, alone: true };
        assert_eq!(at_once.requeue(&job(1), 1, true, Timestamp(5)), Some(requeue));
    }
}
