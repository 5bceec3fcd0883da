//! Waiting between attempts to reach a server that is away: longer each time, and jittered, so that a
//! thousand workers do not come back in the same instant.

use std::time::Duration;

const FIRST: Duration = Duration::from_millis(100);
const LONGEST: Duration = Duration::from_secs(5);

/// How long to wait next.
#[derive(Clone, Debug)]
pub struct Backoff {
    ceiling: Duration,
}

impl Default for Backoff {
    fn default() -> Self {
        Self { ceiling: FIRST }
    }
}

impl Backoff {
    /// The next wait: between half and all of a ceiling that doubles with each call, up to five seconds.
    pub fn next_wait(&mut self) -> Duration {
        let wait = self.ceiling.mul_f64(0.5 + 0.5 * fastrand::f64());
        self.ceiling = (self.ceiling * 2).min(LONGEST);
        wait
    }

    /// Sleeps for [`Self::next_wait`].
    pub async fn pause(&mut self) {
        tokio::time::sleep(self.next_wait()).await;
    }

    /// Starts over, after a success.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_grow_up_to_a_limit_and_start_over() {
        let mut backoff = Backoff::default();
        let first = backoff.next_wait();
        assert!(first >= FIRST / 2 && first <= FIRST, "{first:?}");
        let later = (0..20).map(|_| backoff.next_wait()).last().unwrap();
        assert!(later >= LONGEST / 2 && later <= LONGEST, "{later:?}");
        backoff.reset();
        assert!(backoff.next_wait() <= FIRST);
    }
}
