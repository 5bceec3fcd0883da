//! Files for ParaView: [`particles`] writes sub-particles and intact bonds, [`surfaces`] the equipment, and [`collection`] the list of all
//! frames. `docs/frames.md` describes their arrays.

mod collection;
mod file;
mod particles;
#[cfg(test)]
#[path = "../../../tests/support/vtk.rs"]
mod reading;
mod surfaces;
#[cfg(test)]
mod tests;

pub use collection::{CollectionEntry, collection};
pub use particles::particles;
pub use surfaces::{legend, surfaces};
