//! The end of a worker that has had no job for some time.

use std::time::{Duration, Instant};

use super::session::Session;

/// Ends the claims of a worker that has held no attempt for `timeout`.
pub(super) async fn run(session: &Session, timeout: Duration) {
    let step = (timeout / 4).clamp(Duration::from_millis(10), Duration::from_secs(1));
    let mut clock = IdleClock { since: Instant::now(), begun: 0, timeout };
    let wait = async {
        while !clock.is_over(Instant::now(), session.attempts.begun(), session.attempts.is_empty()) {
            tokio::time::sleep(step).await;
        }
    };
    if session.stop_claiming.run_until_cancelled(wait).await.is_some() {
        tracing::info!(idle_s = timeout.as_secs_f64(), "no job for the idle timeout; ending");
        session.stop_claiming.cancel();
    }
}

/// The time without an attempt.
struct IdleClock {
    since: Instant,
    /// Number of attempts at the last look.
    begun: u64,
    timeout: Duration,
}

impl IdleClock {
    /// Whether no attempt was held for the timeout. A short attempt may have begun and ended since the last look.
    fn is_over(&mut self, now: Instant, begun: u64, is_idle: bool) -> bool {
        if begun != self.begun || !is_idle {
            (self.since, self.begun) = (now, begun);
        }
        now.saturating_duration_since(self.since) >= self.timeout
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn idle_time_counts_from_the_end_of_the_last_attempt() {
        let start = Instant::now();
        let mut clock = IdleClock { since: start, begun: 0, timeout: Duration::from_secs(60) };
        let mut look =
            |at_s: u64, begun, is_idle| clock.is_over(start + Duration::from_secs(at_s), begun, is_idle);
        assert!(!look(59, 0, true));
        assert!(!look(100, 1, false), "it holds an attempt");
        assert!(!look(500, 1, false), "a long one");
        assert!(!look(550, 1, true));
        assert!(!look(559, 2, true), "an attempt between two looks");
        assert!(!look(618, 2, true));
        assert!(look(619, 2, true));
    }
}
