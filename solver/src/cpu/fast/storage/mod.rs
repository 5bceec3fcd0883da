//! Storage: the data of a run, one type per file. The phases read and write it; this layer computes no force.
//!
//! ```text
//! body ── particles ── bounds            loads ◄── pair_lanes
//!      ├─ bond_set                       pairs (neighbour lists, histories, loads)
//!      ├─ wall_list
//!      └─ motion                         context (shared by all bodies in a step)
//! ```

pub(crate) mod body;
pub(crate) mod body_groups;
pub(crate) mod bond_set;
pub(crate) mod bounds;
pub(crate) mod context;
pub(crate) mod laws;
pub(crate) mod loads;
pub(crate) mod motion;
pub(crate) mod pair_lanes;
pub(crate) mod pairs;
pub(crate) mod particles;
pub(crate) mod wall_list;
