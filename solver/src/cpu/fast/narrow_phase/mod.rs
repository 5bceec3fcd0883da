//! Narrow phase: from neighbour lists to loads.
//!
//! ```text
//! pairs ─► batch ─┐
//! bond sets ──────┼─► kernels ─► contact (hertz | jkr, friction), bond, moment ─► loads
//! wall lists ─────┘
//! ```
//!
//! Each term in lanes has the stem of its twin in `physics/`, which states the equations.

mod batch;
mod bond;
pub(crate) mod bonds;
mod contact;
mod friction;
mod hertz;
mod jkr;
mod kernels;
mod moment;
mod pair;
pub(crate) mod pair_contacts;
mod single_facet;
pub(crate) mod wall_contacts;
