//! The sections of a scenario: the types that they are read into, and their rows of the field table.
//!
//! An experiment has a section of its own, with a [`Declaration`]. It joins [`Experiment`] and [`DECLARATIONS`] here.

pub(super) mod bend;
pub(super) mod bonds;
pub(super) mod compress;
pub(super) mod contact;
mod declaration;
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
pub use declaration::{AtMost, Declaration, ExperimentSection};
pub use drop::Drop;
pub use equipment::{Equipment, SideWalls};
pub use material::Material;
pub use numerics::{Auto, Numerics, Stop, Timestep};
pub use product::{Fill, Product};
pub use scene::{BodySpec, FreeScene};
pub use slide::Slide;
pub use surface::{MeshRef, MotionKind, PresenceKind, SurfaceMaterial, SurfaceSpec, Units};

use serde::{Deserialize, Serialize};

/// The experiments, in the order of `/experiment`.
pub const DECLARATIONS: &[&Declaration] = &[
    &equipment::DECLARATION,
    &drop::DECLARATION,
    &bend::DECLARATION,
    &slide::DECLARATION,
    &compress::DECLARATION,
    &scene::DECLARATION,
];

/// An experiment; in JSON, the word under `experiment` and a section of its name (the hopper's is `equipment`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "experiment", rename_all = "snake_case")]
#[expect(missing_docs, reason = "the declaration and the section document each experiment")]
pub enum Experiment {
    Hopper { equipment: Equipment },
    Drop { drop: Drop },
    Bend { bend: Bend },
    Slide { slide: Slide },
    Compress { compress: Compress },
    Scene { scene: FreeScene },
}

impl Experiment {
    /// The section of the experiment.
    pub fn section(&self) -> &dyn ExperimentSection {
        match self {
            Self::Hopper { equipment } => equipment,
            Self::Drop { drop } => drop,
            Self::Bend { bend } => bend,
            Self::Slide { slide } => slide,
            Self::Compress { compress } => compress,
            Self::Scene { scene } => scene,
        }
    }
}
