//! The facets near the sub-particles of a body, with their contact histories.

use super::context::StepContext;
use super::motion::{BodyMotion, SAFETY_FACTOR};
use crate::walls::contact::WallPair;

/// Facets near the sub-particles of a body.
#[derive(Debug, Default)]
pub(crate) struct WallList {
    pub(crate) rows: Vec<WallListRow>,
    pub(crate) pairs: Vec<WallPair>,
    /// Where the body was when they were looked up.
    pub(crate) searched_at: BodyMotion,
    /// How far surfaces had moved by then at most, in metres.
    pub(crate) searched_travel_m: f64,
    pub(crate) known: bool,
}

/// A sub-particle that has facets near it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallListRow {
    /// Its number in the body.
    pub(crate) of: u32,
    /// Where its facets end among all.
    pub(crate) end: u32,
    /// What body and surfaces must have travelled before it can touch any, in metres.
    pub(crate) due_at_m: f64,
}

impl WallListRow {
    /// DistanceScratch again once the gap to the nearest facet may have closed.
    #[inline(always)]
    pub(crate) fn postpone(&mut self, travelled: f64, nearest: f32, context: &StepContext<'_>) {
        self.due_at_m = travelled + SAFETY_FACTOR * f64::from((nearest - context.wall_reach).max(0.0));
    }
}

impl WallList {
    /// Renumbers sub-particles; as_range that map to `u32::MAX` are gone.
    pub(crate) fn renumber(&mut self, locals: &[u32]) {
        let old = std::mem::take(self);
        let mut from = 0;
        for row in old.rows {
            let of = locals[row.of as usize];
            if of != u32::MAX {
                self.pairs.extend_from_slice(&old.pairs[from as usize..row.end as usize]);
                self.rows.push(WallListRow { of, end: self.pairs.len() as u32, ..row });
            }
            from = row.end;
        }
    }
}
