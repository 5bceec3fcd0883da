//! The interaction laws with their derived constants.

use crate::physics::bond::BondLaw;
use crate::physics::contact::ContactLaw;

/// A contact law with derived constants.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneContactLaw {
    pub(crate) law: ContactLaw,
    /// η / √(m* a), normal and tangential.
    pub(crate) damping_n: f32,
    pub(crate) damping_t: f32,
    /// Overlap down to which a contact holds once it has formed, in metres.
    pub(crate) snap_overlap: f32,
}

/// The laws of the pairs of a run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairLaws {
    pub(crate) contact: LaneContactLaw,
    pub(crate) bond: BondLaw,
    pub(crate) contact_between_bonded: bool,
    /// Distance of centres at first contact, 2R, in metres.
    pub(crate) contact_distance: f32,
    pub(crate) dt: f32,
}

impl LaneContactLaw {
    pub(crate) fn new(law: ContactLaw) -> Self {
        Self {
            law,
            damping_n: law.damping * (2.0 * law.e_star).sqrt(),
            damping_t: law.damping * (8.0 * law.g_star).sqrt(),
            snap_overlap: law.jkr.map_or(0.0, |scale| scale.snap_overlap),
        }
    }
}
