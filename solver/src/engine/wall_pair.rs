//! The history of a contact of a sub-particle with a facet, from one step to the next. Checkpoints keep it.

use glam::Vec3;

use crate::physics::contact::ContactHistory;

/// A facet near a sub-particle, with the history of their contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WallPair {
    /// Number of the facet, over all surfaces in their order.
    pub facet: u32,
    /// History of the contact.
    pub contact: ContactHistory,
    /// Side of the facet from which it acts.
    pub side: SideMemory,
    /// Force on the sub-particle in the last step, in newton.
    pub force: Vec3,
}

impl WallPair {
    /// Clears what the contact has borne and crossed, if its surface has changed its form.
    pub(crate) fn surface_changed(&mut self, changed: &[[u32; 2]]) {
        if changed.iter().any(|[first, last]| (*first..=*last).contains(&self.facet)) {
            self.force = Vec3::ZERO;
            self.side = SideMemory::default();
        }
    }
}

/// Memory of a side of a facet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SideMemory {
    /// Side on which the contact began, as the sign of the height over the facet; 0 while undecided.
    pub(crate) origin: i8,
    /// Whether the centre is beyond the facet.
    pub(crate) beyond: bool,
}

/// Bit of a packed memory: the contact began above the facet.
pub const FROM_ABOVE: u32 = 1;

/// Bit of a packed memory: the contact began below the facet.
pub const FROM_BELOW: u32 = 2;

/// Bit of a packed memory: the centre is beyond the facet.
pub const BEYOND: u32 = 4;

impl SideMemory {
    /// The memory as [`FROM_ABOVE`], [`FROM_BELOW`] and [`BEYOND`].
    pub(crate) fn to_bits(self) -> u32 {
        let origin = match self.origin {
            0 => 0,
            1.. => FROM_ABOVE,
            ..0 => FROM_BELOW,
        };
        origin | if self.beyond { BEYOND } else { 0 }
    }

    /// The memory from such bits; others do not matter.
    pub(crate) fn from_bits(bits: u32) -> Self {
        let origin = i8::from(bits & FROM_ABOVE != 0) - i8::from(bits & FROM_BELOW != 0);
        Self { origin, beyond: bits & BEYOND != 0 }
    }
}
