//! The typed scenario: complete, every default written out.

use serde::{Deserialize, Serialize};

use super::sections::{
    Bend, Bonds, Compress, Contact, Drop, Equipment, FreeScene, Material, MeshRef, Numerics, Product, Slide,
    SurfaceSpec,
};

/// The complete input of one simulation, every default written out. SI units; t = 0 is belt start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scenario {
    /// Always [`super::SCHEMA`].
    pub schema: String,
    /// The family of scenarios this one belongs to, with the section of its own.
    #[serde(flatten)]
    pub experiment: Experiment,
    /// The fillets: how many, of what size, made of what sub-particles.
    pub product: Product,
    /// Elastic constants of the tissue (Table 2).
    pub material: Material,
    /// The bonds between the sub-particles of a fillet.
    pub bonds: Bonds,
    /// The contacts between fillets and with the equipment.
    pub contact: Contact,
    /// Time step, duration, sampling and stopping.
    pub numerics: Numerics,
    /// Seed of everything drawn at random; at most 2^53 - 1.
    pub seed: u64,
}

/// A family of scenarios; in JSON, the word under `experiment` and a section of its name (the hopper's is `equipment`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "experiment", rename_all = "snake_case")]
pub enum Experiment {
    /// Bulk discharge of a hopper by a belt under a gate (sections 2.4 and 3.4).
    Hopper {
        /// Hopper, gate and belt.
        equipment: Equipment,
    },
    /// Fillets that hit a plate (section 2.3.3).
    Drop {
        /// Speed and orientation.
        drop: Drop,
    },
    /// A fillet that bends under its own weight (section 2.3.2).
    Bend {
        /// What it is held by.
        bend: Bend,
    },
    /// A fillet on a plate that is tilted (section 2.3.2).
    Slide {
        /// How the plate is tilted.
        slide: Slide,
    },
    /// A block of tissue between plates (section 2.3.2).
    Compress {
        /// The block and how it is compressed.
        compress: Compress,
    },
    /// Bodies and surfaces, freely placed.
    Scene {
        /// All of them.
        scene: FreeScene,
    },
}

impl Scenario {
    /// Hopper, gate and belt, if this is the hopper.
    pub fn equipment(&self) -> Option<&Equipment> {
        match &self.experiment {
            Experiment::Hopper { equipment } => Some(equipment),
            _ => None,
        }
    }

    /// The meshes that it names, each with the pointer of where.
    pub fn named_meshes(&self) -> Vec<(String, &MeshRef)> {
        let (list, surfaces): (_, &[SurfaceSpec]) = match &self.experiment {
            Experiment::Hopper { equipment } => ("/equipment/surfaces", &equipment.surfaces),
            Experiment::Scene { scene } => ("/scene/surfaces", &scene.surfaces),
            _ => ("", &[]),
        };
        let of_surfaces = surfaces.iter().enumerate().filter_map(|(index, surface)| {
            surface.mesh.as_ref().map(|mesh| (format!("{list}/{index}/mesh"), mesh))
        });
        let of_product = self.product.mesh.iter().map(|mesh| ("/product/mesh".to_owned(), mesh));
        of_product.chain(of_surfaces).collect()
    }

    /// Digests of the mesh files that it names, each once, sorted.
    pub fn meshes(&self) -> Vec<&str> {
        let mut digests: Vec<&str> =
            self.named_meshes().into_iter().map(|(_, mesh)| mesh.digest.as_str()).collect();
        digests.sort_unstable();
        digests.dedup();
        digests
    }
}
