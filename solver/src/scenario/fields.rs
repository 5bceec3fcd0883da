//! The field table: every field of a scenario, once. Validation, defaults, JSON Schema and the docs all read it.
//!
//! Sources: tables, figures and sections are those of Vink et al. 2026; "derived" is worked out from numbers
//! of the paper, "assumed" is ours, "numerics" is a choice of computation that shall not change the physics.

use super::SCHEMA;
use super::field::{Field, Kind, Preset, Range, above_to, between, from_to};

/// The sections of a scenario, in their order, each with a sentence.
pub const SECTIONS: &[(&str, &str)] = &[
    ("/product", "The fillets: how many, of what size, made of what sub-particles."),
    ("/material", "Elastic constants of the tissue."),
    ("/bonds", "The bonds between the sub-particles of a fillet."),
    ("/contact", "The contacts between fillets and with the equipment."),
    ("/contact/fillet_fillet", "Between sub-particles."),
    ("/contact/fillet_equipment", "Between sub-particles and walls, gate and back plate."),
    ("/contact/fillet_belt", "Between sub-particles and the belt."),
    ("/equipment", "Hopper, gate and belt. The dimensions of Fig. 5 are derived."),
    ("/numerics", "Time step, duration, sampling and stopping."),
    ("/numerics/stop", "What ends a run before its duration."),
];

/// The field at `pointer`.
pub fn find(pointer: &str) -> Option<&'static Field> {
    FIELDS.iter().find(|field| field.pointer == pointer)
}

const fn field(
    pointer: &'static str,
    kind: Kind,
    unit: &'static str,
    default: Preset,
    source: &'static str,
    doc: &'static str,
) -> Field {
    Field { pointer, kind, unit, default, wet: None, yields_to: None, source, doc }
}

const fn number(
    pointer: &'static str,
    unit: &'static str,
    default: f64,
    range: Range,
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, Kind::Number(range), unit, Preset::Number(default), source, doc)
}

const fn nullable(
    pointer: &'static str,
    unit: &'static str,
    range: Range,
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, Kind::Nullable(range), unit, Preset::Null, source, doc)
}

const fn integer(
    pointer: &'static str,
    default: u64,
    range: Range,
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, Kind::Integer(range), "", Preset::Integer(default), source, doc)
}

/// The first word is the default.
const fn choice(
    pointer: &'static str,
    words: &'static [&'static str],
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, Kind::Choice(words), "", Preset::Word(words[0]), source, doc)
}

const fn flag(pointer: &'static str, default: bool, source: &'static str, doc: &'static str) -> Field {
    field(pointer, Kind::Flag, "", Preset::Flag(default), source, doc)
}

const fn same_as(
    other: &'static str,
    pointer: &'static str,
    unit: &'static str,
    range: Range,
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, Kind::Number(range), unit, Preset::SameAs(other), source, doc)
}

impl Field {
    const fn wet(self, number: f64) -> Self {
        Self { wet: Some(Preset::Number(number)), ..self }
    }

    const fn yields_to(self, other: &'static str) -> Self {
        Self { yields_to: Some(other), ..self }
    }
}

const FRICTION: Range = from_to(0.0, 5.0);
const RESTITUTION: Range = above_to(0.0, 1.0);
const SURFACE_ENERGY: Range = from_to(0.0, 10.0);
const DENSITY: Range = from_to(10.0, 20_000.0);
const STRENGTH: Range = above_to(0.0, 1e300);
const TIME: Range = above_to(0.0, 600.0);

/// Length, width and thickness of the three sizes.
const SIZES_M: &[[f64; 3]] = &[[0.144, 0.072, 0.040], [0.172, 0.072, 0.032], [0.176, 0.072, 0.040]];

/// Every field of a scenario. A field stands after those that its default reads.
#[rustfmt::skip]
pub const FIELDS: &[Field] = &[
    choice("/schema", &[SCHEMA], "format",
        "Name and version of this document's format."),
    field("/experiment", Kind::Choice(&["hopper"]), "", Preset::Required, "section 2.4",
        "The family of scenarios: `hopper` is the bulk discharge of a hopper by a belt under a gate."),

    integer("/product/count", 191, from_to(1.0, 100_000.0), "section 2.4",
        "Number of fillets; fillet i has shape i mod (2 · sizes), each size and its mirror image in turn."),
    field("/product/sizes_m", Kind::Sizes(from_to(0.005, 2.0)), "m", Preset::Sizes(SIZES_M), "Table 1",
        "Length, width and thickness of each size."),
    number("/product/subparticle_radius_m", "m", 0.004, from_to(5e-4, 0.05), "section 2.2",
        "Radius of a sub-particle; the lattice is twice that wide, and sub-particles grow as its inverse cube."),
    choice("/product/fill", &["centres", "whole_spheres"], "assumed",
        "Which lattice points become sub-particles: those whose centre, or whose whole sphere, lies in the shape."),
    nullable("/product/subparticle_density_kg_m3", "kg/m³", DENSITY, "Table 2 has 2200",
        "Density of a sub-particle, instead of `density_kg_m3`; the paper's two densities cannot both hold."),
    field("/product/density_kg_m3", Kind::Nullable(DENSITY), "kg/m³", Preset::Number(940.0), "Table 2",
        "Density of a fillet, which sets its mass from its volume; null when `subparticle_density_kg_m3` is given.")
        .yields_to("/product/subparticle_density_kg_m3"),

    number("/material/youngs_modulus_pa", "Pa", 48_600.0, from_to(100.0, 1e10), "Table 2",
        "Young's modulus of the tissue."),
    number("/material/poisson_ratio", "", 0.37, between(-1.0, 0.5), "Table 2",
        "Poisson's ratio of the tissue."),

    choice("/bonds/formulation", &["corotated", "as_published", "finite_extension"], "eq. 6",
        "How the bond force is formed: turning with the bond; one raw vector that never turns; or corotated and \
         stiffening towards the breaking length."),
    integer("/bonds/types", 2, from_to(1.0, 2.0), "section 2.2",
        "Sub-particle types: 2 bonds only differing types, in a checkerboard; 1 bonds all within reach (Fig. 2)."),
    number("/bonds/normal_stiffness_n_m3", "N/m³", 1e6, above_to(0.0, 1e12), "Table 2",
        "Normal stiffness per unit area, S_n."),
    number("/bonds/shear_stiffness_n_m3", "N/m³", 6e5, from_to(0.0, 1e12), "Table 2",
        "Shear stiffness per unit area, S_t."),
    number("/bonds/contact_radius_ratio", "", 1.732, above_to(1.0, 1.732), "Table 2",
        "Contact radius over sub-particle radius; a bond breaks beyond twice the contact radius, and at √3 the \
         body diagonals would bond as well."),
    number("/bonds/disk_scale", "", 1.0, above_to(0.0, 2.0), "assumed",
        "Radius of the bond disk over that of a sub-particle, R_b / R."),
    flag("/bonds/contact_between_bonded", true, "assumed",
        "Whether bonded neighbours also act on each other by contact, as in the commercial model."),
    nullable("/bonds/normal_strength_pa", "Pa", STRENGTH, "Table 2 has 1e300",
        "Normal strength of a bond; null is unbreakable by stress."),
    nullable("/bonds/shear_strength_pa", "Pa", STRENGTH, "Table 2 has 1e300",
        "Shear strength of a bond; null is unbreakable by stress."),

    choice("/contact/condition", &["dry", "wet"], "section 2.4",
        "Surface of the fillets: `wet` only sets other defaults, and what is written out wins."),
    number("/contact/fillet_fillet/static_friction", "", 0.1, FRICTION, "Table 2",
        "Coulomb coefficient of friction between fillets."),
    number("/contact/fillet_fillet/restitution", "", 1e-4, RESTITUTION, "Table 2",
        "Coefficient of restitution between fillets."),
    number("/contact/fillet_fillet/surface_energy_j_m2", "J/m²", 0.055, SURFACE_ENERGY, "Table 2",
        "Interfacial surface energy γ between fillets; wet, as an assumption, the surface tension of water at 20 °C.")
        .wet(0.0728),
    number("/contact/fillet_equipment/static_friction", "", 0.5, FRICTION, "Table 2",
        "Coulomb coefficient of friction on walls, gate and back plate; the same when wet, as Fig. 8b shows."),
    same_as("/contact/fillet_fillet/restitution",
        "/contact/fillet_equipment/restitution", "", RESTITUTION, "Table 2",
        "Coefficient of restitution on walls, gate and back plate."),
    same_as("/contact/fillet_fillet/surface_energy_j_m2",
        "/contact/fillet_equipment/surface_energy_j_m2", "J/m²", SURFACE_ENERGY, "Table 2",
        "Interfacial surface energy γ on walls, gate and back plate."),
    number("/contact/fillet_belt/static_friction", "", 0.5, FRICTION, "assumed",
        "Coulomb coefficient of friction on the belt, which the paper did not measure: dry as on steel plate; wet, \
         as an assumption, low enough to lose the traction that section 3.4 blames.")
        .wet(0.2),
    same_as("/contact/fillet_fillet/restitution",
        "/contact/fillet_belt/restitution", "", RESTITUTION, "assumed",
        "Coefficient of restitution on the belt."),
    same_as("/contact/fillet_fillet/surface_energy_j_m2",
        "/contact/fillet_belt/surface_energy_j_m2", "J/m²", SURFACE_ENERGY, "assumed",
        "Interfacial surface energy γ on the belt."),

    number("/equipment/gate_opening_m", "m", 0.06, from_to(0.001, 5.0), "Fig. 5",
        "Height of the gate's lower edge above the belt."),
    number("/equipment/hopper_width_m", "m", 0.59, from_to(0.01, 10.0), "derived",
        "Inner width of the hopper across the belt (y); from 33.2 kg in 4 s."),
    number("/equipment/hopper_length_m", "m", 0.30, from_to(0.01, 10.0), "derived",
        "Inner length of the hopper along the belt (x), at the belt."),
    number("/equipment/hopper_height_m", "m", 0.5, from_to(0.01, 10.0), "assumed",
        "Height of the hopper walls above the belt."),
    number("/equipment/wall_slope_deg", "°", 0.0, from_to(0.0, 80.0), "assumed",
        "Slope of the back wall from the vertical, opening upwards."),
    choice("/equipment/side_walls", &["rough", "frictionless", "periodic"], "section 2.4",
        "The walls along the belt: with the equipment's friction; without friction, a slice of a wide hopper; or \
         none, what leaves on one side entering on the other."),
    number("/equipment/belt_speed_m_s", "m/s", 0.25, from_to(0.0, 10.0), "section 2.4",
        "Speed of the belt from t = 0 on; the paper's 15 m/min."),
    flag("/equipment/shutter_while_filling", true, "assumed",
        "Whether a shutter closes the opening until the belt starts."),

    field("/numerics/timestep_s", Kind::NumberOrAuto(from_to(1e-9, 0.1)), "s", Preset::Number(5.75e-5), "Table 2",
        "Time step; `auto` picks the largest safe one from stiffness, mass and damping."),
    number("/numerics/duration_s", "s", 6.0, TIME, "numerics",
        "Simulated time from belt start."),
    number("/numerics/output_interval_s", "s", 0.02, above_to(0.0, 0.1), "numerics",
        "Interval between samples."),
    flag("/numerics/stop/when_empty", true, "numerics",
        "Whether a run ends once every fillet has left."),
    nullable("/numerics/stop/when_jammed_s", "s", TIME, "numerics",
        "A run ends once nothing has passed the gate for this long; null never."),
    number("/numerics/gravity_m_s2", "m/s²", 9.81, from_to(0.0, 100.0), "assumed",
        "Acceleration of gravity, downwards."),
    number("/numerics/rest_speed_m_s", "m/s", 0.05, above_to(0.0, 1.0), "numerics",
        "The bed is at rest, and the belt starts, once all but one in a thousand of its sub-particles are slower than this."),
    number("/numerics/max_fill_s", "s", 10.0, TIME, "numerics",
        "A fill that has not come to rest after this long ends the run."),
    number("/numerics/speed_limit_m_s", "m/s", 30.0, from_to(1.0, 10_000.0), "numerics",
        "A sub-particle faster than this makes the run `unstable`."),
    flag("/numerics/allow_unstable", false, "numerics",
        "Whether time steps past the stability limit run, as a stability study needs."),

    integer("/seed", 1, from_to(0.0, 9_007_199_254_740_991.0), "numerics",
        "Seed of everything drawn at random; at most 2⁵³ − 1, which every JSON reader keeps exact."),
];
