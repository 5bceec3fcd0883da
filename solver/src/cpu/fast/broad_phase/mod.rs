//! Broad phase: from bodies to neighbour lists.
//!
//! ```text
//! bounding boxes ─► body_pair ─► pair_search ─► candidates ─► distances ─► pair_lists
//!                   facets ───────────────────► wall_search ─► wall lists
//! ```
//!
//! A list is renewed only when its Verlet skin may be used up. The moment of renewal changes no bit of a result.

pub(crate) mod body_pair;
pub(crate) mod distances;
pub(crate) mod facets;
pub(crate) mod pair_lists;
pub(crate) mod pair_search;
pub(crate) mod wall_search;
