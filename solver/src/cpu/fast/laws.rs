//! The laws that kernels follow, with what can be worked out beforehand.

use crate::physics::bond::BondLaw;
use crate::physics::contact::ContactLaw;

/// A law of contact, with what can be worked out beforehand.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneContactLaw {
    pub(super) law: ContactLaw,
    /// η / √(m* a), normal and tangential.
    pub(super) damping_n: f32,
    pub(super) damping_t: f32,
    /// Overlap down to which a contact that has formed holds, in metres.
    pub(super) snap: f32,
}

/// All laws of pairs of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairLaws {
    pub(super) contact: LaneContactLaw,
    pub(super) bond: BondLaw,
    pub(super) contact_between_bonded: bool,
    /// 2R, in metres.
    pub(super) touch: f32,
    pub(super) dt: f32,
}

impl LaneContactLaw {
    pub(super) fn new(law: ContactLaw) -> Self {
        Self {
            law,
            damping_n: law.damping * (2.0 * law.e_star).sqrt(),
            damping_t: law.damping * (8.0 * law.g_star).sqrt(),
            snap: law.jkr.map_or(0.0, |scale| scale.snap_overlap),
        }
    }
}
