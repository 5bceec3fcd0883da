//! A block: an integer number of sub-particles along each side.

use glam::{DVec3, IVec3};

use super::Shape;

/// A box that a lattice of sub-particles fills exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Sub-particles along x, y, z.
    pub counts: [u32; 3],
    /// Radius of the sub-particles, in metres.
    pub radius_m: f64,
}

impl Shape for Block {
    fn size_m(&self) -> DVec3 {
        DVec3::from(self.counts.map(f64::from)) * 2.0 * self.radius_m
    }

    fn layers(&self, _spacing_m: f64) -> IVec3 {
        IVec3::from(self.counts.map(|count| i32::try_from(count).unwrap_or(i32::MAX)))
    }

    fn contains(&self, point: DVec3) -> bool {
        point.abs().cmplt(self.size_m() / 2.0).all()
    }

    /// Spheres of the block's own radius are flush with its sides. An exact test would depend on rounding.
    fn contains_sphere(&self, centre: DVec3, _radius_m: f64) -> bool {
        self.contains(centre)
    }

    fn volume_m3(&self) -> f64 {
        self.size_m().element_product()
    }
}
