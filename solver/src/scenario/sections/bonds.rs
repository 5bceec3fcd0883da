//! The bonds between the sub-particles of a fillet.

use serde::{Deserialize, Serialize};

use crate::scenario::field::{Field, FieldKind, Preset, Range, above_to, from_to};
use crate::scenario::row::{choice, field, flag, integer, nullable, number};

/// The bonds between the sub-particles of a fillet (eq. 6, Table 2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bonds {
    /// How the bond force is formed.
    pub formulation: Formulation,
    /// Sub-particle types: 2 bonds only differing types (a checkerboard), 1 all within reach (Fig. 2).
    pub types: u32,
    /// Normal stiffness per unit area S_n, in N/m³.
    pub normal_stiffness_n_m3: f64,
    /// Shear stiffness per unit area S_t, in N/m³.
    pub shear_stiffness_n_m3: f64,
    /// Sub-particle radius at which both stiffnesses hold, in metres; null is any radius.
    pub reference_radius_m: Option<f64>,
    /// Contact radius over sub-particle radius; a bond breaks beyond twice the contact radius.
    pub contact_radius_ratio: f64,
    /// Bond disk radius over sub-particle radius (R_b / R).
    pub disk_scale: f64,
    /// Bending and twisting stiffness over that of Potyondy and Cundall 2004; 0 is a bond without moments.
    pub moment_stiffness_factor: f64,
    /// Whether bonded neighbours also have a contact force, as in the commercial model.
    pub contact_between_bonded: bool,
    /// Normal strength, in pascal; null is unbreakable by stress (the paper's 1e300 Pa).
    pub normal_strength_pa: Option<f64>,
    /// Shear strength, in pascal; null is unbreakable by stress.
    pub shear_strength_pa: Option<f64>,
}

/// How the bond force is formed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Formulation {
    /// Total normal force, incremental shear force that turns with the bond.
    Corotated,
    /// One raw force vector accumulated in the global frame and never turned.
    AsPublished,
    /// Corotated, with a normal force that grows without bound towards the breaking length.
    FiniteExtension,
}

const STRENGTH: Range = above_to(0.0, 1e300);

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    choice("/bonds/formulation", &["corotated", "as_published", "finite_extension"], "eq. 6",
        "Rule for the force of a bond. `corotated`: when the bond turns, the force turns with the bond. `as_published`: when the bond \
         turns, the force keeps its direction. `finite_extension`: as `corotated`, but the bond also becomes stiffer before it breaks."),
    integer("/bonds/types", 2, from_to(1.0, 2.0), "section 2.2",
        "Number of types of sub-particles (Fig. 2). With 2 types, the types alternate on the lattice, and bonds join only sub-particles \
         of different types. All bonds then lie along the edges of the lattice. With 1 type, bonds also lie along diagonals of the \
         lattice. A diagonal has a bond if it is shorter than 2 R times `/bonds/contact_radius_ratio`."),
    number("/bonds/normal_stiffness_n_m3", "N/m³", 1e6, above_to(0.0, 1e12), "Table 2",
        "Stiffness S_n of a bond along its length: force per change of length and per cross-section area of the bond."),
    number("/bonds/shear_stiffness_n_m3", "N/m³", 6e5, from_to(0.0, 1e12), "Table 2",
        "Stiffness S_t of a bond across its length (shear): force per sideways displacement and per cross-section area of the bond."),
    field("/bonds/reference_radius_m", FieldKind::Nullable(from_to(5e-4, 0.05)), "m", Preset::Number(0.004), "section 2.2",
        "Radius R_ref of the sub-particles for which S_n and S_t are given. At another radius R, Roost multiplies S_n and S_t by R_ref / \
         R. The elastic modulus of the lattice then stays the same. Null: Roost uses S_n and S_t unchanged at every radius."),
    number("/bonds/contact_radius_ratio", "", 1.732, above_to(1.0, 1.732), "Table 2",
        "Contact radius divided by the radius R of a sub-particle. The contact radius limits the length of a bond: a bond breaks when \
         its length exceeds twice the contact radius."),
    number("/bonds/disk_scale", "", 1.0, above_to(0.0, 2.0), "assumed",
        "Radius R_b of the circular cross-section of a bond, divided by the radius R of a sub-particle."),
    number("/bonds/moment_stiffness_factor", "", 0.0, from_to(0.0, 10.0), "assumed",
        "Factor for the stiffness of a bond against bending and twisting. With the value 0, bonds resist neither bending nor twisting, as \
         in the paper. With the value 1, the bending stiffness is S_n I, and the twisting stiffness is S_t J. Here, I and J are the \
         second moments of area of the bond's cross-section: I for bending, J for twisting. The parallel bond of Potyondy and Cundall \
         (2004) has the same stiffnesses."),
    flag("/bonds/contact_between_bonded", true, "assumed",
        "True: two sub-particles that a bond joins also have a contact force between them, in addition to the force of the bond. The \
         commercial software of the paper's authors computes this contact force as well. False: only the bond acts between these two \
         sub-particles."),
    nullable("/bonds/normal_strength_pa", "Pa", STRENGTH, "Table 2 has 1e300",
        "Stress along a bond at which the bond breaks. Null: no stress along the bond breaks the bond."),
    nullable("/bonds/shear_strength_pa", "Pa", STRENGTH, "Table 2 has 1e300",
        "Shear stress at which a bond breaks. Null: no shear stress breaks the bond."),
];
