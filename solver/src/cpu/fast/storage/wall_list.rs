//! The facets near the sub-particles of a body, with their contact histories.

use super::context::StepContext;
use super::motion::{BodyMotion, SAFETY_FACTOR};
use crate::engine::wall_pair::WallPair;

/// Facets near the sub-particles of a body.
#[derive(Debug, Default)]
pub(crate) struct WallList {
    pub(crate) rows: Vec<WallListRow>,
    pub(crate) pairs: Vec<WallPair>,
    /// Motion of the body at the last search.
    pub(crate) searched_at: BodyMotion,
    /// Travel of the surfaces at the last search, in metres.
    pub(crate) searched_travel_m: f64,
    pub(crate) known: bool,
}

/// A sub-particle with facets near it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallListRow {
    /// Its index in the body.
    pub(crate) of: u32,
    /// End of its facets in the list.
    pub(crate) end: u32,
    /// Travel of body and surfaces before it can touch a facet, in metres.
    pub(crate) due_at_m: f64,
}

impl WallListRow {
    /// Postpones the next evaluation until the gap to the nearest facet may have closed.
    #[inline(always)]
    pub(crate) fn postpone(&mut self, travelled: f64, nearest: f32, context: &StepContext<'_>) {
        self.due_at_m = travelled + SAFETY_FACTOR * f64::from((nearest - context.wall_cutoff).max(0.0));
    }
}

impl WallList {
    /// Renumbers sub-particles; `u32::MAX` marks removed ones.
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
