//! Waits between attempts to reach a server that does not answer. They grow exponentially, and jitter spreads the attempts of many
//! workers.

use std::time::Duration;

use backon::{BackoffBuilder, ExponentialBackoff, ExponentialBuilder};

/// Jitter adds up to the same again: the first wait is 50 to 100 ms, the longest 2.5 to 5 s.
const WAITS: ExponentialBuilder = ExponentialBuilder::new()
    .with_min_delay(Duration::from_millis(50))
    .with_max_delay(Duration::from_millis(2500))
    .with_jitter()
    .without_max_times();

/// The wait before the next attempt.
#[derive(Debug)]
pub struct Backoff(ExponentialBackoff);

impl Default for Backoff {
    fn default() -> Self {
        Self(WAITS.build())
    }
}

impl Backoff {
    /// Sleeps for the next wait. Dropping the future cancels the wait.
    pub async fn pause(&mut self) {
        tokio::time::sleep(self.next_wait()).await;
    }

    /// Starts again with the shortest wait, after a success.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    fn next_wait(&mut self) -> Duration {
        self.0.next().expect("the number of waits is unlimited")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_grow_up_to_a_limit_and_a_reset_starts_over() {
        let mut backoff = Backoff::default();
        let first = backoff.next_wait().as_secs_f64();
        assert!((0.05..=0.1).contains(&first), "{first} s");
        let later = (0..10_000).map(|_| backoff.next_wait().as_secs_f64()).collect::<Vec<_>>();
        assert!(later[10..].iter().all(|wait| (2.5..=5.0).contains(wait)));
        assert_ne!(later[10], later[11], "no jitter");
        backoff.reset();
        assert!(backoff.next_wait().as_secs_f64() <= 0.1);
    }
}
