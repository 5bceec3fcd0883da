//! The server's clocks: one to show, one to count leases by.

use std::time::Instant;

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
}

impl Clock {
    /// A clock that starts now.
    pub(crate) fn start() -> Self {
        Self { started_at: Timestamp::now(), started: Instant::now() }
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

    /// How far the wall clock has jumped since the start of the server, in milliseconds; none where it has not. A machine that slept
    /// looks the same: the time it slept is missing from the monotonic clock.
    pub(crate) fn jump_ms(&self) -> Option<i64> {
        Some(self.now().0 - self.lease_now().0).filter(|ahead| ahead.abs() > JUMP_MS)
    }

    /// Now as leases count it: the start of the server plus the time that has really passed.
    pub(crate) fn lease_now(&self) -> Timestamp {
        let passed = i64::try_from(self.started.elapsed().as_millis()).unwrap_or(i64::MAX);
        self.started_at.plus_ms(passed)
    }
}
