//! The sections of a scenario: of each the types that it is read into, every default written out, and its fields in the
//! table, which say what may stand there, with unit, default and source.

pub(super) mod bend;
pub(super) mod bonds;
pub(super) mod compress;
pub(super) mod contact;
pub(super) mod drop;
pub(super) mod equipment;
pub(super) mod material;
pub(super) mod numerics;
pub(super) mod product;
pub(super) mod scene;
pub(super) mod slide;
pub(super) mod surface;

pub use bend::{Bend, Support};
pub use bonds::{Bonds, Formulation};
pub use compress::{Compress, Plates};
pub use contact::{Condition, Contact, PairContact};
pub use drop::Drop;
pub use equipment::{Equipment, SideWalls};
pub use material::Material;
pub use numerics::{Auto, Numerics, Stop, Timestep};
pub use product::{Fill, Product};
pub use scene::{BodySpec, FreeScene};
pub use slide::Slide;
pub use surface::{MeshRef, MotionKind, PresenceKind, SurfaceMaterial, SurfaceSpec, Units};
