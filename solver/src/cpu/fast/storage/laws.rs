//! The interaction laws with their derived constants.

use crate::physics::bond::BondLaw;
use crate::physics::contact::ContactLaw;
use crate::physics::moment::MomentLaw;

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

/// Contacts between sub-particles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairContactLaw {
    pub(crate) law: LaneContactLaw,
    /// Distance of centres at first contact, in metres.
    pub(crate) distance: f32,
}

impl PairContactLaw {
    /// Distance of centres up to which a contact can hold, in metres.
    pub(crate) fn hold_distance(&self) -> f32 {
        self.distance + self.law.snap_overlap.abs()
    }
}

/// The laws of the pairs of a run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairLaws {
    /// Within a body, where the distance is 2R.
    pub(crate) contact: PairContactLaw,
    /// Between bodies, where the distance is at least 2R.
    pub(crate) body_contact: PairContactLaw,
    pub(crate) bond: BondLaw,
    pub(crate) moment: Option<MomentLaw>,
    pub(crate) contact_between_bonded: bool,
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

impl PairLaws {
    /// Rest length of the bonds of a class, in metres (see [`crate::shape::lattice::LatticeBond`]).
    pub(crate) fn rest(&self, class: u32) -> f32 {
        self.contact.distance * (class as f32).sqrt()
    }

    /// Whether the contact within a body differs from the one between bodies.
    pub(crate) fn differ(&self) -> bool {
        self.body_contact.distance > self.contact.distance
    }
}
