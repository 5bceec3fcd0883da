//! The contacts between fillets and with the equipment.

use serde::{Deserialize, Serialize};

use crate::scenario::field::{Field, Range, above_to, from_to};
use crate::scenario::row::{FRICTION, choice, nullable, number, same_as};

/// The contacts between fillets and with the equipment (Table 2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Dry or wet fillets: chooses other defaults below, nothing else.
    pub condition: Condition,
    /// Radius of the sub-particles for which the surface energies are given, in metres; null for any radius.
    pub surface_energy_radius_m: Option<f64>,
    /// Between sub-particles.
    pub fillet_fillet: PairContact,
    /// Radius of a sub-particle towards other fillets, over R.
    pub fillet_fillet_radius_ratio: f64,
    /// Between sub-particles and walls, gates and plates.
    pub fillet_equipment: PairContact,
    /// Between sub-particles and the belt.
    pub fillet_belt: PairContact,
}

/// Surface condition of the fillets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Condition {
    /// Normal fillets.
    Dry,
    /// Fillets with water added.
    Wet,
}

/// The parameters of one kind of contact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairContact {
    /// Coulomb coefficient of friction.
    pub static_friction: f64,
    /// Coefficient of restitution.
    pub restitution: f64,
    /// Interfacial surface energy γ, in J/m².
    pub surface_energy_j_m2: f64,
}

const RESTITUTION: Range = above_to(0.0, 1.0);
const RADIUS_RATIO: Range = from_to(1.0, 1.5);
const SURFACE_ENERGY: Range = from_to(0.0, 10.0);

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    choice("/contact/condition", &["dry", "wet"], "section 2.4",
        "Surface of the fillets: dry or wet. The value `wet` changes two defaults: the surface energy between fillets, and the friction \
         on the belt. By default, the surface energies on equipment and on the belt are the surface energy between fillets. If you set \
         one of these fields yourself, Roost uses your value."),
    nullable("/contact/surface_energy_radius_m", "m", above_to(0.0, 0.05), "assumed",
        "Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, Roost uses the energy γ R/R₀. On \
         equipment, the maximum adhesion force per area is then 3πγ/(4 R₀). This force per area does not depend on R. For a liquid film, \
         the force per area is a property of the film, and also does not depend on R. Null: Roost uses γ unchanged at every radius."),
    number("/contact/fillet_fillet/static_friction", "", 0.1, FRICTION, "Table 2",
        "Coulomb coefficient of friction between fillets."),
    number("/contact/fillet_fillet/restitution", "", 1e-4, RESTITUTION, "Table 2",
        "Coefficient of restitution between fillets: rebound speed divided by impact speed."),
    number("/contact/fillet_fillet/surface_energy_j_m2", "J/m²", 0.055, SURFACE_ENERGY, "Table 2",
        "Surface energy γ between fillets: half of the energy per area that is necessary to separate two fillets. The default for wet \
         fillets is the surface tension of water at 20 °C (assumed).")
        .wet(0.0728),
    number("/contact/fillet_fillet_radius_ratio", "", 1.0, RADIUS_RATIO, "assumed",
        "Radius of a sub-particle in contacts with other fillets, divided by R. With the value 1, a sub-particle of one fillet can enter a \
         gap between the sub-particles of another fillet. With the value 1.225, a sub-particle is too large to enter these gaps.")
        .by_name(),
    number("/contact/fillet_equipment/static_friction", "", 0.5, FRICTION, "Table 2",
        "Coulomb coefficient of friction on walls, gates and plates. Dry and wet fillets have the same coefficient (Fig. 8b)."),
    same_as("/contact/fillet_fillet/restitution",
        "/contact/fillet_equipment/restitution", "", RESTITUTION, "Table 2",
        "Coefficient of restitution on walls, gates and plates."),
    same_as("/contact/fillet_fillet/surface_energy_j_m2",
        "/contact/fillet_equipment/surface_energy_j_m2", "J/m²", SURFACE_ENERGY, "Table 2",
        "Surface energy γ between fillets and walls, gates or plates."),
    number("/contact/fillet_belt/static_friction", "", 0.5, FRICTION, "assumed",
        "Coulomb coefficient of friction on the belt. The paper did not measure this coefficient. The default for dry fillets is the \
         value for a steel plate. The default for wet fillets is so low that the belt slips under the fillets, as section 3.4 reports.")
        .wet(0.2),
    same_as("/contact/fillet_fillet/restitution",
        "/contact/fillet_belt/restitution", "", RESTITUTION, "assumed",
        "Coefficient of restitution on the belt."),
    same_as("/contact/fillet_fillet/surface_energy_j_m2",
        "/contact/fillet_belt/surface_energy_j_m2", "J/m²", SURFACE_ENERGY, "assumed",
        "Surface energy γ between fillets and the belt."),
];
