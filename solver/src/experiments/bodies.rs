//! The bodies of a scenario: their kinds, and the time step that they allow.

use std::sync::Arc;

use super::{definition, laws};
use crate::engine::scene::BodyKind;
use crate::mesh::Meshes;
use crate::physics::timestep::{Stability, stability};
use crate::scenario::{Auto, Fault, Product, Scenario, Timestep};
use crate::shape::lattice::MetaParticle;
use crate::shape::{meta_particles, subparticle_mass_kg};

/// The kind of body with a lattice, and the mass of its sub-particles.
pub(super) fn body_kind(product: &Product, meta: Arc<MetaParticle>) -> BodyKind {
    BodyKind { subparticle_mass_kg: subparticle_mass_kg(product, &meta), meta }
}

/// All shapes of the product, or the one that `/product/shape` names.
pub(super) fn product_kinds(scenario: &Scenario, meshes: &Meshes) -> Result<Vec<BodyKind>, Vec<Fault>> {
    let (product, bonds) = (&scenario.product, &scenario.bonds);
    let all = meta_particles(product, meshes, bonds.types, bonds.contact_radius_ratio).map_err(|error| {
        let digest = product.mesh.as_ref().map(|mesh| mesh.digest.clone());
        let allowed = "a closed mesh that the lattice of sub-particles fills in one piece";
        vec![Fault::at("/product/mesh", digest, error.to_string(), allowed)]
    })?;
    let kind = |meta| body_kind(product, meta);
    Ok(match product.shape {
        Some(shape) => all.into_iter().skip(shape as usize).take(1).map(kind).collect(),
        None => all.into_iter().map(kind).collect(),
    })
}

/// The bounds on the time step: those of the lightest sub-particle.
pub fn bounds_on_timestep(scenario: &Scenario, kinds: &[BodyKind]) -> Stability {
    let laws = laws::laws(scenario);
    let mass = kinds.iter().map(|kind| kind.subparticle_mass_kg).fold(f64::INFINITY, f64::min);
    let diagonals = kinds.iter().any(|kind| kind.meta.bonds.iter().any(|bond| bond.class > 1));
    stability(mass, scenario.product.radius_m(), &laws, diagonals)
}

/// Maximum distance that a body may move in the first step of `"auto"`, as a share of R. A faster body penetrates too
/// deep before the first contact force, and fewer bonds break than at short steps.
const STEP_RATIO: f64 = 1.0 / 30.0;

/// The time step that a scenario will run with, in seconds.
pub fn timestep_s(scenario: &Scenario, stability: &Stability) -> f64 {
    let numerics = &scenario.numerics;
    match numerics.timestep_s {
        Timestep::Fixed(dt) => dt,
        Timestep::Auto(Auto::Auto) => {
            let distance_m = STEP_RATIO * scenario.product.radius_m();
            let speed_m_s = definition(&scenario.experiment).start_speed_m_s();
            stability.auto_s.min(distance_m / speed_m_s).min(numerics.output_interval_s)
        }
    }
}
