//! Trying again: how often by class of failure, and after what pause.

use std::time::Duration;

use roost_api::time::Timestamp;

use super::{JobChange, JobFacts, lease_end};

/// How often a job is tried that ends in one way, and how long it waits in between.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tries {
    /// Attempts that may end so; 0 is no limit.
    pub attempts: u32,
    /// The pause after the first of them; it doubles with each further one.
    pub first_pause: Duration,
    /// The longest pause.
    pub longest_pause: Duration,
}

/// What is tried again by itself, by class of failure. All other classes are not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RetryPolicy {
    /// After [`FailureClass::Worker`](roost_api::job::FailureClass::Worker).
    pub worker: Tries,
    /// After [`FailureClass::Lost`](roost_api::job::FailureClass::Lost).
    pub lost: Tries,
}

impl Default for RetryPolicy {
    fn default() -> Self {
        let seconds = Duration::from_secs;
        Self {
            worker: Tries { attempts: 3, first_pause: seconds(2), longest_pause: seconds(60) },
            // The lease was a pause already.
            lost: Tries { attempts: 5, first_pause: seconds(1), longest_pause: seconds(60) },
        }
    }
}

impl Tries {
    /// Back to the queue after the `failures`-th failure of this kind, if there is to be another attempt.
    pub(super) fn again(
        &self,
        job: &JobFacts,
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
    fn pause(&self, job: &JobFacts, failures: u32) -> Duration {
        let doublings = failures.saturating_sub(1).min(30);
        let ceiling = self.first_pause.saturating_mul(1 << doublings).min(self.longest_pause);
        ceiling.mul_f64(0.5 + 0.5 * jitter(job))
    }
}

/// A number from 0 to 1 that differs from job to job and from attempt to attempt, so that what failed together does not come
/// back together. Made of both, it is the same in every replay.
fn jitter(job: &JobFacts) -> f64 {
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

    const TRIES: Tries =
        Tries { attempts: 0, first_pause: Duration::from_secs(2), longest_pause: Duration::from_secs(60) };

    fn job(attempt: u32) -> JobFacts {
        let id = JobId::new();
        let state = JobState::Running;
        JobFacts { id, state, cancelling: false, attempt, worker_failures: 0, lost: 0, failure_class: None }
    }

    #[test]
    fn pauses_double_up_to_a_limit_and_differ_from_job_to_job() {
        for (failures, ceiling) in [(1, 2), (2, 4), (3, 8), (5, 32), (6, 60), (u32::MAX, 60)] {
            let pauses: Vec<_> =
                (0..200).map(|_| TRIES.pause(&job(failures), failures).as_secs_f64()).collect();
            let (low, high) = (0.5 * f64::from(ceiling), f64::from(ceiling));
            assert!(pauses.iter().all(|pause| (low..=high).contains(pause)), "{failures}: {pauses:?}");
            let spread = pauses.iter().fold(0.0_f64, |a, b| a.max(*b))
                - pauses.iter().fold(1e9, |a: f64, b| a.min(*b));
            assert!(spread > 0.4 * high, "{failures}: they come back together, within {spread} s");
        }
        let same = job(3);
        assert_eq!(TRIES.pause(&same, 3), TRIES.pause(&same, 3), "the same in every replay");
    }

    #[test]
    fn a_limit_of_none_is_never_reached() {
        assert!(TRIES.again(&job(1), 1_000_000, false, Timestamp(0)).is_some());
        let three = Tries { attempts: 3, ..TRIES };
        assert!(three.again(&job(1), 2, false, Timestamp(0)).is_some());
        assert_eq!(three.again(&job(1), 3, false, Timestamp(0)), None);
        let at_once = Tries { first_pause: Duration::ZERO, ..TRIES };
        let requeue = JobChange::Requeue { not_before: None, alone: true };
        assert_eq!(at_once.again(&job(1), 1, true, Timestamp(5)), Some(requeue));
    }
}
