//! The fillets: number, size, shape and sub-particles.

use serde::{Deserialize, Serialize};

use super::surface::MeshRef;
use crate::scenario::field::{Field, FieldKind, Preset, Range, from_to};
use crate::scenario::row::{choice, field, flag, integer, nullable, number};

/// The fillets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Product {
    /// Number of fillets. Fillet `i` has shape `i mod (2 * sizes)`: each size and its mirror image in turn.
    pub count: u32,
    /// Length, width and thickness of each size, in metres (Table 1).
    pub sizes_m: Vec<[f64; 3]>,
    /// The one shape that all fillets have; null takes each in turn.
    pub shape: Option<u32>,
    /// A closed mesh in place of the teardrops.
    pub mesh: Option<MeshRef>,
    /// Whether each body is one sphere, in place of the teardrops.
    pub spheres: bool,
    /// Scale factor of fillets and sub-particles.
    pub scale: f64,
    /// Radius of a sub-particle, in metres.
    pub subparticle_radius_m: f64,
    /// The lattice points that become sub-particles.
    pub fill: Fill,
    /// Density of a fillet, in kg/m³; null when `subparticle_density_kg_m3` is given.
    pub density_kg_m3: Option<f64>,
    /// Density of a sub-particle, in kg/m³ (Table 2 has 2200); null when `density_kg_m3` is used.
    pub subparticle_density_kg_m3: Option<f64>,
}

impl Product {
    /// Radius of a sub-particle after scaling, in metres.
    pub fn radius_m(&self) -> f64 {
        self.subparticle_radius_m * self.scale
    }

    /// Length, width and thickness of each size after scaling, in metres.
    pub fn scaled_sizes_m(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.sizes_m.iter().map(|size| size.map(|edge| edge * self.scale))
    }

    /// Number of shapes that `shape` and a body's shape may name: each size and its mirror image, or the only one.
    pub fn shapes(&self) -> u32 {
        if self.mesh.is_some() || self.spheres { 1 } else { 2 * self.sizes_m.len() as u32 }
    }
}

/// The lattice points of a shape that become sub-particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fill {
    /// Those whose cubic cell lies most inside the surface, as many as have its volume.
    Volume,
    /// Those whose centre lies inside the surface.
    Centres,
    /// Those whose whole sphere lies inside the surface.
    WholeSpheres,
}

const DENSITY: Range = from_to(10.0, 20_000.0);
/// Length, width and thickness of the three sizes.
const SIZES_M: &[[f64; 3]] = &[[0.144, 0.072, 0.040], [0.172, 0.072, 0.032], [0.176, 0.072, 0.040]];

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    integer("/product/count", 191, from_to(1.0, 100_000.0), "section 2.4",
        "Number of fillets. If `shape` is null, the fillets take all shapes in turn. By default, there are six shapes: three sizes, each \
         with its mirror image. The fillets with the numbers 0, 6 and 12 then have shape 0. The paper's drop test has 15 fillets of each of \
         six shapes (section 2.3.3).")
        .by_name_or(Preset::Integer(1)),
    field("/product/sizes_m", FieldKind::Sizes(from_to(0.005, 2.0)), "m", Preset::Sizes(SIZES_M), "Table 1",
        "Length, width and thickness of each size of fillet.")
        .by_name(),
    field("/product/shape", FieldKind::NullableInteger(from_to(0.0, 63.0)), "", Preset::Null, "Fig. 1",
        "Number of the shape of all fillets. Shapes 0 and 1 belong to the first size in `sizes_m`, shapes 2 and 3 to the second size, and so \
         on. A shape with an odd number is a mirror image. Null: the fillets take all shapes in turn.")
        .by_name(),
    field("/product/mesh", FieldKind::Mesh, "", Preset::Null, "section 2.2",
        "Closed mesh (triangles from an STL file) that gives all fillets their shape. Null: the fillets are teardrops with the sizes in \
         `sizes_m`.")
        .by_name(),
    flag("/product/spheres", false, "assumed",
        "True: each body is a single sphere without bonds. The sphere has the radius `subparticle_radius_m` and the density \
         `density_kg_m3`. Use the value true for grains, and for comparisons with other programs. False: bodies have the shapes of \
         `sizes_m` or `mesh`.")
        .by_name(),
    number("/product/scale", "", 1.0, from_to(0.05, 20.0), "Fig. 12",
        "Factor for the size of the bodies. Roost multiplies the lengths of the bodies and the radius of the sub-particles by this \
         factor."),
    number("/product/subparticle_radius_m", "m", 0.004, from_to(5e-4, 0.05), "section 2.2",
        "Radius of a sub-particle before scaling. R is this radius times `scale`. The centres of neighbouring sub-particles are 2R apart. \
         If you halve the radius, a body has eight times as many sub-particles."),
    choice("/product/fill", &["volume", "centres", "whole_spheres"], "assumed; the paper has the points inside",
        "Rule that selects the points of the lattice (cubic grid) at which a body has sub-particles. `volume`: each point has a cell, a cube \
         with the edge 2R. Roost selects the cells with the largest share inside the shape, until the cells together have the volume of \
         the shape. `centres`: all points inside the shape, as in the paper. `whole_spheres`: only the points whose whole sphere of \
         radius R is inside the shape. With `centres` and `whole_spheres`, the volume of the cells depends on R. With \
         `volume`, the lattice has fewer points at most: 5e4 for a mesh, and 1e6 for all shapes without a mesh.")
        .by_name(),
    nullable("/product/subparticle_density_kg_m3", "kg/m³", DENSITY, "Table 2 has 2200",
        "Density of a sub-particle. Set this field or `density_kg_m3`, but not both. The paper states a value for each of the two \
         densities, but these two values contradict each other."),
    field("/product/density_kg_m3", FieldKind::Nullable(DENSITY), "kg/m³", Preset::Number(940.0), "Table 2",
        "Density of a body: the mass of the body divided by its volume. If you set `subparticle_density_kg_m3`, this field is null.")
        .yields_to("/product/subparticle_density_kg_m3"),
];
