//! The shapes of fillets and their lattices of bonded sub-particles.
//!
//! [`teardrop`] is the surface, [`lattice`] fills it. Fillet `i` of a scenario has shape `i mod (2 × sizes)`: each
//! size of Table 1 and its mirror image in turn.

pub mod lattice;
pub mod teardrop;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::mesh::Meshes;
use crate::scenario::{Fill, Product};
use lattice::MetaParticle;
use teardrop::Teardrop;

type Key = ([u64; 4], bool, Fill, u32);

/// Points of remembered fills past which all are forgotten.
const MOST_POINTS_KEPT: usize = 2_000_000;

/// Fills seen before: validating a sweep asks for the same few thousands of times.
static FILLS: Mutex<Option<HashMap<Key, Arc<MetaParticle>>>> = Mutex::new(None);

/// The meta-particles of a product, one a shape.
pub fn meta_particles(
    product: &Product,
    _meshes: &Meshes,
    bond_types: u32,
    contact_radius_ratio: f64,
) -> Vec<Arc<MetaParticle>> {
    let shapes = product.scaled_sizes_m().flat_map(|size| [(size, false), (size, true)]);
    let reach = lattice::bond_reach(bond_types, contact_radius_ratio);
    shapes.map(|(size, mirrored)| fill(Teardrop { size_m: size, mirrored }, product, reach)).collect()
}

fn fill(shape: Teardrop, product: &Product, reach: u32) -> Arc<MetaParticle> {
    let [length, width, thickness] = shape.size_m;
    let bits = [length, width, thickness, product.radius_m()].map(f64::to_bits);
    let key = (bits, shape.mirrored, product.fill, reach);
    let lock = || FILLS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = lock().as_ref().and_then(|fills| fills.get(&key).cloned()) {
        return known;
    }
    let filled = Arc::new(MetaParticle::fill(&shape, product.radius_m(), product.fill, reach));
    let mut fills = lock();
    let fills = fills.get_or_insert_default();
    // A sweep over the radius could grow this for ever; starting over costs milliseconds.
    if fills.values().map(|meta| meta.points.len()).sum::<usize>() > MOST_POINTS_KEPT {
        fills.clear();
    }
    fills.insert(key, filled.clone());
    filled
}

/// Mass of one sub-particle of a meta-particle, in kilograms.
pub fn subparticle_mass_kg(product: &Product, meta: &MetaParticle) -> f64 {
    match (product.density_kg_m3, product.subparticle_density_kg_m3) {
        (_, Some(density)) => density * 4.0 / 3.0 * std::f64::consts::PI * product.radius_m().powi(3),
        (density, None) => density.unwrap_or(0.0) * meta.volume_m3 / meta.points.len() as f64,
    }
}
