//! Files that ParaView opens: fillets and equipment of every frame as polygonal data, and a collection of them all.
//!
//! [`particles`] gives the sub-particles and the bonds that hold, [`surfaces`] the equipment where it is, and
//! [`collection`] the one file to open. What ParaView shows of them is told in `docs/frames.md`.

mod collection;
mod file;
mod particles;
#[cfg(test)]
#[path = "../../../tests/support/vtk.rs"]
mod reading;
mod surfaces;
#[cfg(test)]
mod tests;

pub use collection::{Scene, collection};
pub use particles::particles;
pub use surfaces::{legend, surfaces};
