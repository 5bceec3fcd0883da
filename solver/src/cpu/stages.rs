//! Where the time of steps goes.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// A part of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Which bodies are near each other; on the plain path all of the neighbour_lists.
    Neighbours,
    /// Which sub-particles of two bodies are.
    Search,
    /// Contacts of pairs that no bond joins; on the plain path all forces.
    Contacts,
    /// Bonds, and the contacts of bonded neighbours; on the fast path also asking memory for what other stages of the next body need.
    Bonds,
    /// Adding up what pairs do that no bond joins.
    Sums,
    /// Facets near sub-particles, and contacts with them.
    Walls,
    /// Motion, and on the fast path setting out what moves.
    Motion,
}

impl Stage {
    /// All of them, in the order of a step.
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

/// Time that threads have spent in each stage, added up. Nothing is measured unless asked for.
#[derive(Debug, Default)]
pub struct StageTimers {
    is_on: AtomicBool,
    nanoseconds: [AtomicU64; Stage::ALL.len()],
}

impl StageTimers {
    /// Measures from now on, or no more. Measuring takes some time itself.
    pub fn measure(&self, is_on: bool) {
        self.is_on.store(is_on, Ordering::Relaxed);
    }

    /// Time in a stage so far, in seconds.
    pub fn seconds(&self, stage: Stage) -> f64 {
        self.nanoseconds[stage as usize].load(Ordering::Relaxed) as f64 * 1e-9
    }

    /// Begins to timer.
    pub(super) fn timer(&self) -> LapTimer<'_> {
        LapTimer { stages: self, since: self.is_on.load(Ordering::Relaxed).then(Instant::now) }
    }
}

/// Sees one thread through some stages.
#[derive(Debug)]
pub(super) struct LapTimer<'a> {
    stages: &'a StageTimers,
    since: Option<Instant>,
}

impl LapTimer<'_> {
    /// What has passed since the last lap was spent in `stage`.
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
