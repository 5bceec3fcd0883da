//! Histories of pairs and facets between main memory and the layout of the kernels.

use super::layout::{IN_CONTACT, Moment, Pair, WallPair};
use crate::engine::saved::SavedPair;
use crate::engine::wall_pair::{self, SideMemory};
use crate::physics::contact::ContactHistory;
use crate::physics::moment::MomentHistory;

fn contact_bit(contact: &ContactHistory) -> u32 {
    if contact.in_contact { IN_CONTACT } else { 0 }
}

impl Pair {
    pub(super) fn restore(saved: &SavedPair) -> Self {
        Self {
            bond: saved.bond.to_array(),
            other: saved.pair[1],
            xi: saved.contact.xi.to_array(),
            state: saved.class | contact_bit(&saved.contact),
        }
    }

    /// The pair of sub-particle `i`.
    pub(super) fn save(&self, i: u32, moments: Option<&Moment>) -> SavedPair {
        let class = self.state & !IN_CONTACT;
        SavedPair {
            pair: [i, self.other],
            class,
            is_intact: class != 0,
            bond: self.bond.into(),
            contact: ContactHistory { in_contact: self.state & IN_CONTACT != 0, xi: self.xi.into() },
            // Others are left over.
            moments: moments
                .filter(|_| class != 0)
                .map(|moment| MomentHistory { bending: moment.bending.into(), twist: moment.twist })
                .unwrap_or_default(),
        }
    }
}

impl Moment {
    pub(super) fn restore(saved: &SavedPair) -> Self {
        Self { bending: saved.moments.bending.to_array(), twist: saved.moments.twist }
    }
}

impl WallPair {
    pub(super) fn restore(wall: &wall_pair::WallPair) -> Self {
        Self {
            xi: wall.contact.xi.to_array(),
            facet: wall.facet,
            force: wall.force.to_array(),
            state: wall.side.to_bits() | contact_bit(&wall.contact),
        }
    }

    pub(super) fn save(&self) -> wall_pair::WallPair {
        wall_pair::WallPair {
            facet: self.facet,
            contact: ContactHistory { in_contact: self.state & IN_CONTACT != 0, xi: self.xi.into() },
            side: SideMemory::from_bits(self.state),
            force: self.force.into(),
        }
    }
}
