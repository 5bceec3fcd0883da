//! Integration: from loads to motion.
//!
//! [`step`] sums the loads of a body (pairs, bonds, facets), [`advance`] moves its blocks by one leapfrog step.

mod advance;
pub(crate) mod step;
