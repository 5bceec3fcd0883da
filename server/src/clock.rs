//! The server's clocks: one to show, one to count leases by.

use std::time::{Duration, Instant};

use roost_api::time::Timestamp;

/// The wall clock has jumped when it is this far from the time that has really passed, in milliseconds: five minutes. Less is a clock that
/// is corrected.
const JUMP_MS: i64 = 300_000;

/// One moment by both clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Now {
    /// As people read it, for fields that end in `_at`.
    pub(crate) wall: Timestamp,
    /// As leases, deadlines and pauses count it.
    pub(crate) lease: Timestamp,
}

/// Within one run of the server leases count monotonic time, so that a clock set back or forth neither ends
/// them all nor makes them last.
pub(crate) struct Clock {
    started_at: Timestamp,
    started: Instant,
    /// By the clock that counts while the machine sleeps too.
    booted_at_start: Duration,
}

impl Clock {
    /// A clock that starts now.
    pub(crate) fn start() -> Self {
        Self { started_at: Timestamp::now(), started: Instant::now(), booted_at_start: since_boot() }
    }

    /// Now as people read it, for fields that end in `_at`.
    pub(crate) fn now(&self) -> Timestamp {
        Timestamp::now()
    }

    /// When it started.
    pub(crate) fn started(&self) -> Timestamp {
        self.started_at
    }

    /// Now by both.
    pub(crate) fn both(&self) -> Now {
        Now { wall: self.now(), lease: self.lease_now() }
    }

    /// The time since the server started, while the machine slept included.
    pub(crate) fn uptime(&self) -> Duration {
        since_boot().saturating_sub(self.booted_at_start)
    }

    /// How far the wall clock has jumped since the start of the server, in milliseconds; none where it has not.
    pub(crate) fn jump_ms(&self) -> Option<i64> {
        let passed_ms = i64::try_from(self.uptime().as_millis()).unwrap_or(i64::MAX);
        Some(self.now().0 - self.started_at.plus_ms(passed_ms).0).filter(|ahead| ahead.abs() > JUMP_MS)
    }

    /// Now as leases count it: the start of the server plus the time that has really passed.
    pub(crate) fn lease_now(&self) -> Timestamp {
        let passed = i64::try_from(self.started.elapsed().as_millis()).unwrap_or(i64::MAX);
        self.started_at.plus_ms(passed)
    }
}

/// Time since the machine started. [`Instant`] stops while a machine sleeps, so that its wall clock seems to jump.
#[cfg(target_os = "linux")]
fn since_boot() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    Duration::new(now.tv_sec.unsigned_abs(), u32::try_from(now.tv_nsec).unwrap_or(0))
}

/// Elsewhere sleep cannot be told from a jump.
#[cfg(not(target_os = "linux"))]
fn since_boot() -> Duration {
    static FIRST: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    FIRST.elapsed()
}
