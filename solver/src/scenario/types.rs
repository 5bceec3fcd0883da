//! The typed scenario: complete, every default written out.

use serde::{Deserialize, Serialize};

use super::sections::{Bonds, Contact, Equipment, Experiment, Material, MeshRef, Numerics, Product};

/// The complete input of one simulation, every default written out. SI units; t = 0 is belt start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scenario {
    /// Always [`super::SCHEMA`].
    pub schema: String,
    /// The experiment, with its own section.
    #[serde(flatten)]
    pub experiment: Experiment,
    /// The fillets: number, size, shape and sub-particles.
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

impl Scenario {
    /// Hopper, gate and belt, if the experiment is the hopper.
    pub fn equipment(&self) -> Option<&Equipment> {
        match &self.experiment {
            Experiment::Hopper { equipment } => Some(equipment),
            _ => None,
        }
    }

    /// The meshes that it names, each with the pointer of where.
    pub fn named_meshes(&self) -> Vec<(String, &MeshRef)> {
        let (list, surfaces) = self.experiment.section().surfaces();
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
