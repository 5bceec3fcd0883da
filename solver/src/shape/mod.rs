//! The shapes of products and their lattices of bonded sub-particles.
//!
//! A [`Shape`] is what [`lattice`] fills: the fillet's [`teardrop`], a [`solid`] from a CAD file, a [`block`]. Fillet `i`
//! of a scenario has shape `i mod (2 × sizes)`: each size of Table 1 and its mirror image in turn.

pub mod block;
pub mod lattice;
pub mod solid;
pub mod teardrop;

use std::collections::HashMap;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};

use glam::{DVec3, IVec3};

use crate::mesh::{Mesh, Meshes, Units};
use crate::scenario::{Fill, Product};
use block::Block;
use lattice::MetaParticle;
use solid::Solid;
use teardrop::Teardrop;

/// What a lattice can fill. Its own origin is the centre of its box, and so of the lattice.
pub trait Shape {
    /// Sides of its box, in metres.
    fn size_m(&self) -> DVec3;

    /// Whether a point lies inside.
    fn contains(&self, point: DVec3) -> bool;

    /// Its volume, in m³.
    fn volume_m3(&self) -> f64;

    /// Layers of a lattice that its box takes along x, y and z.
    fn layers(&self, spacing_m: f64) -> IVec3 {
        (self.size_m() / spacing_m).ceil().as_ivec3()
    }

    /// Whether a sphere lies inside wholly. In 26 directions: enough to tell whether it pokes through a smooth surface
    /// much larger than itself.
    fn contains_sphere(&self, centre: DVec3, radius_m: f64) -> bool {
        let steps = lattice::neighbour_steps().map(|step| step.as_dvec3().normalize());
        steps.flat_map(|step| [step, -step]).all(|d| self.contains(centre + d * radius_m))
    }
}

/// Why a mesh or a block is no product.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// Holes, or rims.
    #[error(
        "the mesh is open: {edges} of its edges belong to an odd number of triangles, and a product needs a closed surface"
    )]
    Open {
        /// Such edges.
        edges: usize,
    },
    /// Triangles that face opposite ways.
    #[error(
        "at {edges} edges of the mesh neighbours face opposite ways, which leaves open what is inside: let the CAD program unify the normals"
    )]
    InconsistentNormals {
        /// Such edges.
        edges: usize,
    },
    /// Closed, and nothing in it.
    #[error("the mesh encloses {volume_m3} m³, which is nothing: a sheet is no product")]
    NoVolume {
        /// The volume, in m³.
        volume_m3: f64,
    },
    /// So fine a lattice that even looking at it would take too long.
    #[error(
        "sub-particles of radius {radius_m} m make {cells:.1e} lattice points in the shape's box, at most {MAX_LATTICE_CELLS:.0e} are taken"
    )]
    TooFine {
        /// Radius of the sub-particles, in metres.
        radius_m: f64,
        /// Lattice points in the box.
        cells: f64,
    },
    /// So coarse a lattice that none of its points is inside.
    #[error("no sub-particle of radius {radius_m} m fits inside the shape, which is {} × {} × {} m", .size_m[0], .size_m[1], .size_m[2])]
    NoLatticePoint {
        /// Radius of the sub-particles, in metres.
        radius_m: f64,
        /// Sides of its box, in metres.
        size_m: [f64; 3],
    },
    /// Several bodies in one file, or bridges thinner than the lattice: what does not hang together would be lost.
    #[error(
        "the lattice falls into connected_components: {kept} sub-particles hang together, {discarded} are cut off from them; a product is one body, and a smaller radius keeps thin parts"
    )]
    Disconnected {
        /// Sub-particles of the largest piece.
        kept: usize,
        /// Sub-particles of all others.
        discarded: usize,
    },
}

/// The most lattice points in the box of a mesh or a block: seconds of work.
pub(crate) const MAX_LATTICE_CELLS: f64 = 2e6;

/// What a fill is cached_fill by: the shape, the radius, how it was filled and bonded.
type FillKey = (ShapeKey, u64, Fill, u32);

/// A shape to the bit.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum ShapeKey {
    /// Its sizes, and whether it is mirrored.
    Teardrop([u64; 3], bool),
    /// The digest of its file, and the units.
    Mesh(String, Units),
    Block([u32; 3]),
}

/// Points of cached_fill fills past which all are forgotten.
const MAX_CACHED_POINTS: usize = 2_000_000;

/// Fills seen before: validating a sweep asks for the same few thousands of times.
static FILL_CACHE: Mutex<Option<HashMap<FillKey, Arc<MetaParticle>>>> = Mutex::new(None);

/// The meta-particles of a product, one a shape: that of its mesh, or each size and its mirror image. They are filled
/// as they are and scaled afterwards.
///
/// # Errors
/// A mesh that is no product; see [`from_mesh`].
///
/// # Panics
/// When the product's mesh is not among `meshes`, or cannot be meant in its units.
pub fn meta_particles(
    product: &Product,
    meshes: &Meshes,
    bond_types: u32,
    contact_radius_ratio: f64,
) -> Result<Vec<Arc<MetaParticle>>, ShapeError> {
    let reach = lattice::max_bond_class(bond_types, contact_radius_ratio);
    let (radius, fill) = (product.subparticle_radius_m, product.fill);
    let scaled = |meta: Arc<MetaParticle>| match product.scale {
        1.0 => meta,
        scale => Arc::new(meta.scaled(scale)),
    };
    if let Some(named) = &product.mesh {
        let stl = meshes.get(&named.digest).expect("the scenario's meshes are at hand");
        let mesh = stl.in_units(named.units).expect("the size of the mesh was checked");
        return Ok(vec![scaled(from_mesh(&mesh, radius, fill, reach)?)]);
    }
    let shapes = product.sizes_m.iter().flat_map(|&size_m| [(size_m, false), (size_m, true)]);
    let filled = shapes.map(|(size_m, mirrored)| {
        let shape_key = ShapeKey::Teardrop(size_m.map(f64::to_bits), mirrored);
        let shape = Teardrop { size_m, mirrored };
        let filled = || Ok::<_, Infallible>(MetaParticle::fill(&shape, radius, fill, reach));
        let Ok(meta) = cached_fill((shape_key, radius.to_bits(), fill, reach), filled);
        scaled(meta)
    });
    Ok(filled.collect())
}

/// The meta-particle of a closed mesh, by sub-particles of a radius in metres; `reach` is [`lattice::max_bond_class`].
///
/// # Errors
/// A mesh that encloses nothing; a lattice too fine to look at, too coarse to leave a sub-particle or to hang together.
pub fn from_mesh(
    mesh: &Mesh,
    radius_m: f64,
    fill: Fill,
    reach: u32,
) -> Result<Arc<MetaParticle>, ShapeError> {
    let key = (ShapeKey::Mesh(mesh.digest.clone(), mesh.units), radius_m.to_bits(), fill, reach);
    cached_fill(key, || filled(&Solid::new(mesh)?, radius_m, fill, reach))
}

/// A block of sub-particles of a radius in metres; `reach` is [`lattice::max_bond_class`].
///
/// # Errors
/// More sub-particles than anyone would wait for, or none.
pub fn from_block(counts: [u32; 3], radius_m: f64, reach: u32) -> Result<Arc<MetaParticle>, ShapeError> {
    let key = (ShapeKey::Block(counts), radius_m.to_bits(), Fill::Centres, reach);
    cached_fill(key, || filled(&Block { counts, radius_m }, radius_m, Fill::Centres, reach))
}

fn filled(shape: &impl Shape, radius_m: f64, fill: Fill, reach: u32) -> Result<MetaParticle, ShapeError> {
    // The fill looks a layer beyond either side.
    let cells = (shape.layers(2.0 * radius_m).as_dvec3() + 2.0).element_product();
    if cells > MAX_LATTICE_CELLS {
        return Err(ShapeError::TooFine { radius_m, cells });
    }
    let (meta, discarded) = MetaParticle::fill_counting_discarded(shape, radius_m, fill, reach);
    match meta.points.len() {
        0 => Err(ShapeError::NoLatticePoint { radius_m, size_m: shape.size_m().to_array() }),
        kept if discarded * 10 > kept => Err(ShapeError::Disconnected { kept, discarded }),
        _ => Ok(meta),
    }
}

fn cached_fill<E>(
    key: FillKey,
    fill: impl FnOnce() -> Result<MetaParticle, E>,
) -> Result<Arc<MetaParticle>, E> {
    let lock = || FILL_CACHE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = lock().as_ref().and_then(|fills| fills.get(&key).cloned()) {
        return Ok(known);
    }
    let filled = Arc::new(fill()?);
    let mut fills = lock();
    let fills = fills.get_or_insert_default();
    // A sweep over the radius could grow this for ever; starting over costs milliseconds.
    if fills.values().map(|meta| meta.points.len()).sum::<usize>() > MAX_CACHED_POINTS {
        fills.clear();
    }
    fills.insert(key, filled.clone());
    Ok(filled)
}

/// Mass of one sub-particle of a meta-particle, in kilograms.
pub fn subparticle_mass_kg(product: &Product, meta: &MetaParticle) -> f64 {
    match (product.density_kg_m3, product.subparticle_density_kg_m3) {
        (_, Some(density)) => density * 4.0 / 3.0 * std::f64::consts::PI * product.radius_m().powi(3),
        (density, None) => density.unwrap_or(0.0) * meta.volume_m3 / meta.points.len() as f64,
    }
}
