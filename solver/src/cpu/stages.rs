//! Timing of the stages of a step.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// A stage of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Broad phase over bodies; on the plain path the whole neighbour search.
    Neighbours,
    /// Renewal of the neighbour lists of body pairs.
    Search,
    /// Contacts of pairs without a bond; on the plain path all forces.
    Contacts,
    /// Bonds, and contacts of bonded neighbours. On the fast path also prefetches for the next body.
    Bonds,
    /// Sums of the loads of pairs without a bond.
    Sums,
    /// Facet search, and contacts with facets.
    Walls,
    /// Integration, and on the fast path the transposition into blocks.
    Motion,
}

impl Stage {
    /// All stages, in the order of a step.
    pub const ALL: [Self; 7] =
        [Self::Neighbours, Self::Search, Self::Contacts, Self::Bonds, Self::Sums, Self::Walls, Self::Motion];

    /// Its name, for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Neighbours => "neighbours",
            Self::Search => "search",
            Self::Contacts => "contacts",
            Self::Sums => "sums",
            Self::Bonds => "bonds",
            Self::Walls => "walls",
            Self::Motion => "motion",
        }
    }
}

/// Thread time per stage, summed over threads. Measured only on demand.
#[derive(Debug, Default)]
pub struct StageTimers {
    is_on: AtomicBool,
    nanoseconds: [AtomicU64; Stage::ALL.len()],
}

impl StageTimers {
    /// Starts or stops measuring, which itself takes some time.
    pub fn measure(&self, is_on: bool) {
        self.is_on.store(is_on, Ordering::Relaxed);
    }

    /// Time in a stage so far, in seconds.
    pub fn seconds(&self, stage: Stage) -> f64 {
        self.nanoseconds[stage as usize].load(Ordering::Relaxed) as f64 * 1e-9
    }

    /// Starts a timer for one thread.
    pub(super) fn timer(&self) -> LapTimer<'_> {
        LapTimer { stages: self, since: self.is_on.load(Ordering::Relaxed).then(Instant::now) }
    }
}

/// Attributes the time of one thread to stages.
#[derive(Debug)]
pub(super) struct LapTimer<'a> {
    stages: &'a StageTimers,
    since: Option<Instant>,
}

impl LapTimer<'_> {
    /// Attributes the time since the last lap to `stage`.
    #[inline(always)]
    pub(super) fn lap(&mut self, stage: Stage) {
        if let Some(since) = &mut self.since {
            let now = Instant::now();
            let spent = now.duration_since(*since).as_nanos() as u64;
            self.stages.nanoseconds[stage as usize].fetch_add(spent, Ordering::Relaxed);
            *since = now;
        }
    }
}
