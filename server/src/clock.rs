//! The server's clocks: wall time for users, monotonic time for leases.

use std::time::{Duration, Instant};

use roost_api::time::Timestamp;

/// Difference between wall clock and elapsed time above which the clock has jumped, in milliseconds. Smaller
/// differences are regular corrections.
const JUMP_MS: i64 = 300_000;

/// One moment on both clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Now {
    /// Wall time, for fields that end in `_at`.
    pub(crate) wall: Timestamp,
    /// Monotonic time, for leases, deadlines and pauses.
    pub(crate) lease: Timestamp,
}

/// The clocks of one run of a server. Leases use monotonic time, so a change of the wall clock neither ends
/// nor extends them.
pub(crate) struct Clock {
    started_at: Timestamp,
    started: Instant,
    /// Time since boot, which includes the time that the machine slept.
    booted_at_start: Duration,
}

impl Clock {
    /// Clocks that start now.
    pub(crate) fn start() -> Self {
        Self { started_at: Timestamp::now(), started: Instant::now(), booted_at_start: since_boot() }
    }

    /// Wall time, for fields that end in `_at`.
    pub(crate) fn now(&self) -> Timestamp {
        Timestamp::now()
    }

    /// Wall time of the start.
    pub(crate) fn started(&self) -> Timestamp {
        self.started_at
    }

    /// Now on both clocks.
    pub(crate) fn both(&self) -> Now {
        Now { wall: self.now(), lease: self.lease_now() }
    }

    /// Time since the server started, including the time that the machine slept.
    pub(crate) fn uptime(&self) -> Duration {
        since_boot().saturating_sub(self.booted_at_start)
    }

    /// The jump of the wall clock since the start of the server, in milliseconds; none without a jump.
    pub(crate) fn jump_ms(&self) -> Option<i64> {
        let passed_ms = i64::try_from(self.uptime().as_millis()).unwrap_or(i64::MAX);
        Some(self.now().0 - self.started_at.plus_ms(passed_ms).0).filter(|ahead| ahead.abs() > JUMP_MS)
    }

    /// Lease time: the start of the server plus the elapsed time.
    pub(crate) fn lease_now(&self) -> Timestamp {
        let passed = i64::try_from(self.started.elapsed().as_millis()).unwrap_or(i64::MAX);
        self.started_at.plus_ms(passed)
    }
}

/// Time since boot. [`Instant`] stops while the machine sleeps, so the wall clock would seem to jump.
#[cfg(target_os = "linux")]
fn since_boot() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    Duration::new(now.tv_sec.unsigned_abs(), u32::try_from(now.tv_nsec).unwrap_or(0))
}

/// On other systems, sleep looks like a jump.
#[cfg(not(target_os = "linux"))]
fn since_boot() -> Duration {
    static FIRST: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    FIRST.elapsed()
}
