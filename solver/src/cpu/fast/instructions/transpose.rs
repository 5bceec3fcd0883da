//! Transposition from [`Quads`] to lanes.

use pulp::cast;

use super::arrays::{Ints, Lanes3, Quads};
use super::set::LaneOps;

/// The first three numbers of each quad, in lanes.
#[inline(always)]
pub(crate) fn three<S: LaneOps>(simd: S, quads: &Quads) -> Lanes3 {
    let [x, y, z, _] = simd.to_lanes(quads);
    [x, y, z]
}

/// Quads of integers, passed as the bits of floats, in lanes.
#[inline(always)]
pub(crate) fn ints<S: LaneOps>(simd: S, quads: &Quads) -> [Ints; 4] {
    let [x, y, z, r] = simd.to_lanes(quads);
    [Ints(cast(x.0)), Ints(cast(y.0)), Ints(cast(z.0)), Ints(cast(r.0))]
}
