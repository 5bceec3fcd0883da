//! The log of tasks that repeat: an outage is one line at its start, one a minute, and one at its end.

use std::time::{Duration, Instant};

use crate::store::StoreError;

/// Time between two lines of one failure.
const EVERY: Duration = Duration::from_secs(60);

/// A task that repeats, and its failure if the last attempt failed.
pub(crate) struct RepeatedFailure {
    /// The task, as the start of a line: `checking leases`.
    task: &'static str,
    present: Option<Failure>,
}

struct Failure {
    began: Instant,
    logged: Instant,
    attempts: u64,
}

impl RepeatedFailure {
    /// A task that has not failed.
    pub(crate) fn of(task: &'static str) -> Self {
        Self { task, present: None }
    }

    /// Logs the failure of an attempt, or the end of failures, and returns what the attempt brought.
    pub(crate) fn note<T>(&mut self, outcome: Result<T, StoreError>) -> Option<T> {
        self.note_at(outcome, Instant::now()).0
    }

    /// The same at a time. Also returns whether a line was logged.
    fn note_at<T>(&mut self, outcome: Result<T, StoreError>, now: Instant) -> (Option<T>, bool) {
        let error = match outcome {
            Ok(value) => return (Some(value), self.end(now)),
            Err(error) => error,
        };
        let failure = self.present.get_or_insert(Failure { began: now, logged: now, attempts: 0 });
        failure.attempts += 1;
        let is_due = failure.attempts == 1 || now >= failure.logged + EVERY;
        if is_due {
            failure.logged = now;
            tracing::error!(error = error.as_dyn(), attempts = failure.attempts, "{} failed", self.task);
        }
        (None, is_due)
    }

    /// Logs the end of a failure that was repeated.
    fn end(&mut self, now: Instant) -> bool {
        let Some(failure) = self.present.take() else { return false };
        let failed_s = (now - failure.began).as_secs_f64();
        tracing::info!(attempts = failure.attempts, failed_s, "{} succeeds again", self.task);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outage_is_logged_at_its_start_each_minute_and_at_its_end() {
        let (mut leases, start) = (RepeatedFailure::of("checking leases"), Instant::now());
        let mut is_logged = |second: u64, succeeds: bool| {
            let outcome = if succeeds { Ok(second) } else { Err(StoreError::Differs("jobs")) };
            let (value, is_logged) = leases.note_at(outcome, start + Duration::from_secs(second));
            assert_eq!(value, succeeds.then_some(second));
            is_logged
        };
        assert!(!is_logged(0, true), "no failure has ended");
        let lines: Vec<u64> = (1..200).filter(|second| is_logged(*second, false)).collect();
        assert_eq!(lines, [1, 61, 121, 181]);
        assert!(is_logged(200, true), "the failure has ended");
        assert!(!is_logged(201, true));
        assert!(is_logged(202, false), "a new failure");
    }
}
