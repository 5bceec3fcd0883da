//! Proposals: runs that a decision adds.

use serde::{Deserialize, Serialize};

use crate::evidence::Point;

/// A run that comes next.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Proposal {
    /// Its point.
    pub point: Point,
    /// Its replicate, from 0 on.
    pub replicate: u32,
}
