//! The shapes of products and their lattices of bonded sub-particles.
//!
//! A [`Shape`] is the input of [`lattice`]: the [`teardrop`] of a fillet, a [`solid`] from a CAD file, or a
//! [`block`]. Fillet `i` of a scenario has shape `i mod (2 × sizes)`: each size of Table 1 and its mirror
//! image in turn.

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

/// A shape that a lattice can fill. Its origin is the centre of its box and of the lattice.
pub trait Shape {
    /// Sides of its box, in metres.
    fn size_m(&self) -> DVec3;

    /// Whether a point lies inside.
    fn contains(&self, point: DVec3) -> bool;

    /// Its volume, in m³.
    fn volume_m3(&self) -> f64;

    /// Lattice layers in its box along x, y and z.
    fn layers(&self, spacing_m: f64) -> IVec3 {
        (self.size_m() / spacing_m).ceil().as_ivec3()
    }

    /// Whether a sphere lies wholly inside, tested in 26 directions. This resolves smooth surfaces much
    /// larger than the sphere.
    fn contains_sphere(&self, centre: DVec3, radius_m: f64) -> bool {
        let steps = lattice::neighbour_steps().map(|step| step.as_dvec3().normalize());
        steps.flat_map(|step| [step, -step]).all(|d| self.contains(centre + d * radius_m))
    }
}

/// Why a mesh or a block cannot be a product.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// The mesh has holes or rims.
    #[error(
        "the mesh is open: {edges} of its edges belong to an odd number of triangles, and a product needs a closed surface"
    )]
    Open {
        /// Number of open edges.
        edges: usize,
    },
    /// Triangles face opposite ways.
    #[error(
        "at {edges} edges of the mesh neighbours face opposite ways, which leaves open what is inside: let the CAD program unify the normals"
    )]
    InconsistentNormals {
        /// Number of misoriented edges.
        edges: usize,
    },
    /// A closed mesh without volume.
    #[error("the mesh encloses {volume_m3} m³, which is nothing: a sheet is no product")]
    NoVolume {
        /// The volume, in m³.
        volume_m3: f64,
    },
    /// The lattice has too many points to fill in reasonable time.
    #[error(
        "sub-particles of radius {radius_m} m make {cells:.1e} lattice points in the shape's box, at most {MAX_LATTICE_CELLS:.0e} are taken"
    )]
    TooFine {
        /// Radius of the sub-particles, in metres.
        radius_m: f64,
        /// Lattice points in the box.
        cells: f64,
    },
    /// The lattice has too many cells to find their volumes in reasonable time.
    #[error(
        "sub-particles of radius {radius_m} m make {cells:.1e} lattice points in the shape's box, at most {MAX_SAMPLED_CELLS:.0e} are taken \
         by volume: a larger radius, or /product/fill \"centres\""
    )]
    TooFineForVolume {
        /// Radius of the sub-particles, in metres.
        radius_m: f64,
        /// Lattice points in the box.
        cells: f64,
    },
    /// The lattice is so coarse that no point lies inside.
    #[error("no sub-particle of radius {radius_m} m fits inside the shape, which is {} × {} × {} m", .size_m[0], .size_m[1], .size_m[2])]
    NoLatticePoint {
        /// Radius of the sub-particles, in metres.
        radius_m: f64,
        /// Sides of its box, in metres.
        size_m: [f64; 3],
    },
    /// The lattice is not connected: several bodies in one file, or bridges thinner than the lattice.
    #[error(
        "the lattice falls into pieces: {kept} sub-particles hang together, {discarded} are cut off from them; a product is one body, and a smaller radius keeps thin parts"
    )]
    Disconnected {
        /// Sub-particles of the largest component.
        kept: usize,
        /// Sub-particles of all other components.
        discarded: usize,
    },
}

/// Maximum number of lattice points in the box of a mesh or a block: seconds of work.
pub(crate) const MAX_LATTICE_CELLS: f64 = 2e6;
/// The same for a fill by volume, which tests many points of each cell at the surface.
const MAX_SAMPLED_CELLS: f64 = 5e4;

/// Key of the fill cache: shape, radius, fill rule and highest bond class.
type FillKey = (ShapeKey, u64, Fill, u32);

/// Exact identity of a shape.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum ShapeKey {
    /// Its sizes, and whether it is mirrored.
    Teardrop([u64; 3], bool),
    /// The digest of its file, and the units.
    Mesh(String, Units),
    Block([u32; 3]),
}

/// Cached points beyond which the cache is emptied.
const MAX_CACHED_POINTS: usize = 2_000_000;

/// Cache of fills: validating a sweep asks for the same few fills thousands of times.
static FILL_CACHE: Mutex<Option<HashMap<FillKey, Arc<MetaParticle>>>> = Mutex::new(None);

/// The meta-particles of a product, one per shape: its mesh, one sphere, or each size and its mirror image.
/// Shapes are filled at their own size and scaled afterwards.
///
/// # Errors
/// A mesh that cannot be a product; see [`from_mesh`].
///
/// # Panics
/// When the product's mesh is not among `meshes`, or its size does not fit its units.
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
    if product.spheres {
        return Ok(vec![Arc::new(MetaParticle::sphere(product.radius_m()))]);
    }
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

/// The meta-particle of a closed mesh, with sub-particles of a radius in metres; `reach` is
/// [`lattice::max_bond_class`].
///
/// # Errors
/// A mesh without volume; a lattice with too many points, no point, or several components.
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
/// Too many sub-particles, or none.
pub fn from_block(counts: [u32; 3], radius_m: f64, reach: u32) -> Result<Arc<MetaParticle>, ShapeError> {
    let key = (ShapeKey::Block(counts), radius_m.to_bits(), Fill::Centres, reach);
    cached_fill(key, || filled(&Block { counts, radius_m }, radius_m, Fill::Centres, reach))
}

fn filled(shape: &impl Shape, radius_m: f64, fill: Fill, reach: u32) -> Result<MetaParticle, ShapeError> {
    // The fill covers one layer more on either side.
    let cells = (shape.layers(2.0 * radius_m).as_dvec3() + 2.0).element_product();
    if cells > MAX_LATTICE_CELLS {
        return Err(ShapeError::TooFine { radius_m, cells });
    }
    if fill == Fill::Volume && cells > MAX_SAMPLED_CELLS {
        return Err(ShapeError::TooFineForVolume { radius_m, cells });
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
    // A sweep over the radius could grow the cache without bound. A refill costs tens of milliseconds.
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
