//! The field table: every field of a scenario, once. Validation, defaults, JSON Schema and the docs all read it.
//!
//! Sources: tables, figures and sections are those of Vink et al. 2026; "derived" is worked out from numbers
//! of the paper, "assumed" is ours, "numerics" is a choice of computation that shall not change the physics.

use super::SCHEMA;
use super::field::{Field, Kind, Preset, Range, Section, above_to, between, from_to};

/// The sections of a scenario, in their order.
#[rustfmt::skip]
pub const SECTIONS: &[Section] = &[
    section("/product", None, "The fillets: how many, of what size, made of what sub-particles."),
    section("/material", None, "Elastic constants of the tissue."),
    section("/bonds", None, "The bonds between the sub-particles of a fillet."),
    section("/contact", None, "The contacts between fillets and with the equipment."),
    section("/contact/fillet_fillet", None, "Between sub-particles."),
    section("/contact/fillet_equipment", None, "Between sub-particles and walls, gate, plates."),
    section("/contact/fillet_belt", None, "Between sub-particles and the belt."),
    section("/equipment", Some("hopper"), "Hopper, gate and belt. The dimensions of Fig. 5 are derived."),
    list("/equipment/surfaces", "/scene/surfaces/*", Some("hopper"), "Further surfaces, as in `/scene/surfaces`."),
    section("/drop", Some("drop"), "Fillets that hit a plate, each by itself."),
    section("/bend", Some("bend"), "A fillet that bends under its own weight."),
    section("/slide", Some("slide"), "A fillet on a plate that is tilted until it slides."),
    section("/compress", Some("compress"), "A block of tissue between two plates."),
    section("/scene", Some("scene"), "Bodies and surfaces, freely placed."),
    list("/scene/bodies", "/scene/bodies/*", Some("scene"), "Fillets; a product's shape at a place."),
    list("/scene/surfaces", "/scene/surfaces/*", Some("scene"), "Surfaces of triangles that move together."),
    section("/numerics", None, "Time step, duration, sampling and stopping."),
    section("/numerics/stop", None, "What ends a run before its duration."),
];

const fn section(pointer: &'static str, only_in: Option<&'static str>, doc: &'static str) -> Section {
    Section { pointer, items: None, only_in, doc }
}

const fn list(
    pointer: &'static str,
    items: &'static str,
    only_in: Option<&'static str>,
    doc: &'static str,
) -> Section {
    Section { pointer, items: Some(items), only_in, doc }
}

/// The pointer under which the table holds what stands at `pointer`: `/scene/bodies/*` for `/scene/bodies/3`.
pub fn in_table(pointer: &str) -> String {
    for section in SECTIONS {
        let Some(items) = section.items else { continue };
        let Some(rest) = pointer.strip_prefix(section.pointer).and_then(|rest| rest.strip_prefix('/')) else {
            continue;
        };
        let (index, rest) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
        if index == "*" || index.parse::<usize>().is_ok() {
            return format!("{items}{rest}");
        }
    }
    pointer.to_owned()
}

/// The field at `pointer`, which may lie in an item of a list.
pub fn find(pointer: &str) -> Option<&'static Field> {
    let pointer = in_table(pointer);
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
    Field {
        pointer,
        kind,
        unit,
        default,
        wet: None,
        elsewhere: &[],
        unused_in: &[],
        yields_to: None,
        source,
        doc,
    }
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

    const fn elsewhere(self, elsewhere: &'static [(&'static str, Preset)]) -> Self {
        Self { elsewhere, ..self }
    }

    const fn unused_in(self, unused_in: &'static [&'static str]) -> Self {
        Self { unused_in, ..self }
    }

    const fn yields_to(self, other: &'static str) -> Self {
        Self { yields_to: Some(other), ..self }
    }
}

/// The words of `/experiment`.
pub const EXPERIMENTS: &[&str] = &["hopper", "drop", "bend", "slide", "compress", "scene"];

const fn vector(
    pointer: &'static str,
    unit: &'static str,
    default: Preset,
    range: Range,
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, Kind::Vector(range), unit, default, source, doc)
}

const ORIGIN: Preset = Preset::Vector([0.0; 3]);
const PLACE: Range = from_to(-100.0, 100.0);
const SPEED: Range = from_to(-100.0, 100.0);
const ANGLE: Range = from_to(-180.0, 180.0);
const SCATTER: Range = from_to(0.0, 180.0);
const FRICTION: Range = from_to(0.0, 5.0);
const RESTITUTION: Range = above_to(0.0, 1.0);
const SURFACE_ENERGY: Range = from_to(0.0, 10.0);
const ONE: Preset = Preset::Integer(1);
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
    field("/experiment", Kind::Choice(EXPERIMENTS), "", Preset::Required, "section 2",
        "The family of scenarios: `hopper` is the bulk discharge of a hopper by a belt under a gate (section 2.4); `drop`, \
         `bend`, `slide` and `compress` are the paper's tests of single fillets (section 2.3); `scene` is whatever one places."),

    integer("/product/count", 191, from_to(1.0, 100_000.0), "section 2.4",
        "Number of fillets; fillet i has shape i mod (2 · sizes), each size and its mirror image in turn, unless \
         `shape` is given. A drop takes 15 of each of the six shapes (section 2.3.3).")
        .elsewhere(&[("drop", Preset::Integer(90)), ("bend", ONE), ("slide", ONE), ("compress", ONE), ("scene", ONE)])
        .unused_in(&["bend", "slide", "compress", "scene"]),
    field("/product/sizes_m", Kind::Sizes(from_to(0.005, 2.0)), "m", Preset::Sizes(SIZES_M), "Table 1",
        "Length, width and thickness of each size.")
        .unused_in(&["compress"]),
    field("/product/shape", Kind::NullableInteger(from_to(0.0, 63.0)), "", Preset::Null, "Fig. 1",
        "The one shape that all fillets have: 2 · (number of the size, from 0), plus 1 for its mirror image; null takes each in turn.")
        .elsewhere(&[("bend", Preset::Integer(2)), ("slide", Preset::Integer(2))])
        .unused_in(&["compress", "scene"]),
    field("/product/mesh", Kind::Mesh, "", Preset::Null, "section 2.2",
        "A closed mesh that all fillets have as their shape, in place of the teardrops of `sizes_m`.")
        .unused_in(&["compress"]),
    number("/product/scale", "", 1.0, from_to(0.05, 20.0), "Fig. 12",
        "Scale of fillets and sub-particles alike."),
    number("/product/subparticle_radius_m", "m", 0.004, from_to(5e-4, 0.05), "section 2.2",
        "Radius of a sub-particle; the lattice is twice that wide, and sub-particles grow as its inverse cube."),
    choice("/product/fill", &["centres", "whole_spheres"], "assumed",
        "Which lattice points become sub-particles: those whose centre, or whose whole sphere, lies in the shape.")
        .unused_in(&["compress"]),
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
    flag("/equipment/parametric", true, "assumed",
        "Whether belt, walls, gate and shutter are made from the fields here; false leaves all of it to `surfaces`."),

    number("/drop/speed_m_s", "m/s", 2.0, from_to(0.0, 30.0), "Fig. 11",
        "Speed at which fillets reach the plate, downwards; a free fall of 0.2 m reaches 2 m/s."),
    number("/drop/yaw_deg", "°", 0.0, ANGLE, "Fig. 10",
        "Orientation: first about the vertical; 0, 0, 0 lies flat, its length along x."),
    number("/drop/pitch_deg", "°", 0.0, ANGLE, "Fig. 10",
        "Orientation: then about the fillet's width; 90 falls end on, tail first."),
    number("/drop/roll_deg", "°", 0.0, ANGLE, "Fig. 10",
        "Orientation: last about the fillet's length; 90 falls on its side."),
    number("/drop/scatter_deg", "°", 0.0, SCATTER, "assumed",
        "Yaw, pitch and roll of each fillet are off by up to this much, drawn by `/seed`."),

    choice("/bend/support", &["over_bar", "off_ledge", "clamped"], "section 2.3.2",
        "Across a bar with both ends hanging; carried off the end of a conveyor; or held at its blunt end."),
    number("/bend/bar_radius_m", "m", 0.02, from_to(0.002, 1.0), "assumed",
        "Radius of the bar, or of the roller at the conveyor's end."),
    number("/bend/belt_speed_m_s", "m/s", 0.25, from_to(0.0, 10.0), "section 2.4",
        "Speed of the conveyor, for `off_ledge`."),
    number("/bend/clamped_share", "", 0.25, between(0.0, 1.0), "assumed",
        "Share of the fillet's length that is held, for `clamped`."),
    number("/bend/scatter_deg", "°", 0.0, from_to(0.0, 45.0), "assumed",
        "Yaw of the fillet is off by up to this much, drawn by `/seed`."),

    number("/slide/tilt_rate_deg_s", "°/s", 3.0, from_to(0.1, 30.0), "section 2.3.2",
        "Rate at which the plate is tilted; past 6 °/s the angle at which sliding is noticed lags behind."),
    number("/slide/max_tilt_deg", "°", 60.0, from_to(1.0, 89.0), "assumed",
        "The plate is tilted up to this angle."),
    number("/slide/yaw_deg", "°", 0.0, ANGLE, "assumed",
        "Heading of the fillet on the plate; 0 points its length up the slope."),
    number("/slide/scatter_deg", "°", 0.0, SCATTER, "assumed",
        "Yaw of the fillet is off by up to this much, drawn by `/seed`."),

    field("/compress/lattice", Kind::Counts(from_to(1.0, 200.0)), "", Preset::Counts([10, 10, 3]), "section 2.3.2",
        "Sub-particles of the block along x, y and z; 10 × 10 × 3 of 1.75 mm radius are 35 × 35 × 10.5 mm."),
    number("/compress/strain_rate_1_s", "1/s", 0.05, above_to(0.0, 10.0), "assumed",
        "Rate of strain; the paper's 1 mm/min on 10 mm is 0.0017 1/s."),
    number("/compress/max_strain", "", 0.06, above_to(0.0, 0.5), "Fig. 6",
        "Strain, from first contact on, at which the test ends."),
    number("/compress/modulus_from_strain", "", 0.0, from_to(0.0, 0.5), "section 3.1",
        "Start of the window of strain that the modulus is fitted over."),
    number("/compress/modulus_to_strain", "", 0.03, above_to(0.0, 0.5), "section 3.1",
        "End of the window of strain that the modulus is fitted over."),
    choice("/compress/plates", &["rough", "frictionless"], "assumed",
        "Plates with the friction of the equipment, or without."),

    vector("/scene/gravity_direction", "", Preset::Vector([0.0, 0.0, -1.0]), from_to(-1.0, 1.0), "assumed",
        "Direction of gravity; its length does not matter, its strength is `/numerics/gravity_m_s2`."),
    number("/scene/margin_m", "m", 0.5, above_to(0.0, 10.0), "numerics",
        "What goes this far beyond all that is there at the start leaves the simulation."),
    integer("/scene/bodies/*/shape", 0, from_to(0.0, 63.0), "Fig. 1",
        "The body's shape: 2 · (number of the size in `/product/sizes_m`, from 0), plus 1 for its mirror image."),
    vector("/scene/bodies/*/position_m", "m", Preset::Required, PLACE, "assumed",
        "Where its centre of mass starts."),
    vector("/scene/bodies/*/orientation_deg", "°", ORIGIN, ANGLE, "assumed",
        "Yaw, pitch and roll: about z, then its width, then its length."),
    vector("/scene/bodies/*/velocity_m_s", "m/s", ORIGIN, SPEED, "assumed",
        "Velocity at the start."),
    field("/scene/surfaces/*/name", Kind::Text, "", Preset::Required, "assumed",
        "Name of the surface, in messages and series; each surface has its own."),
    field("/scene/surfaces/*/mesh", Kind::Mesh, "", Preset::Null, "assumed",
        "Its triangles, from CAD; of `mesh` and `plate_m` exactly one is given."),
    field("/scene/surfaces/*/plate_m", Kind::Plate(PLACE), "m", Preset::Null, "assumed",
        "A flat parallelogram: a corner and its two edges."),
    choice("/scene/surfaces/*/kind", &["equipment", "belt", "frictionless"], "Table 2",
        "Whose contact parameters it takes: `/contact/fillet_equipment`, `/contact/fillet_belt`, or the former without friction."),
    nullable("/scene/surfaces/*/static_friction", "", FRICTION, "assumed",
        "A Coulomb coefficient of friction of its own; null takes that of its kind."),
    vector("/scene/surfaces/*/position_m", "m", ORIGIN, PLACE, "assumed",
        "Where the origin of its triangles lies."),
    vector("/scene/surfaces/*/orientation_deg", "°", ORIGIN, ANGLE, "assumed",
        "Yaw, pitch and roll of its triangles about that origin."),
    choice("/scene/surfaces/*/motion", &["fixed", "belt", "moving"], "assumed",
        "From t = 0 on: not at all; its material runs along it as a belt; or it moves and turns as a whole."),
    vector("/scene/surfaces/*/velocity_m_s", "m/s", ORIGIN, SPEED, "assumed",
        "Velocity of the belt's material, or of the pivot."),
    vector("/scene/surfaces/*/spin_deg_s", "°/s", ORIGIN, from_to(-36_000.0, 36_000.0), "assumed",
        "Angular velocity about the pivot, for `moving`."),
    vector("/scene/surfaces/*/pivot_m", "m", ORIGIN, PLACE, "assumed",
        "Point that it turns about, where it is at t = 0, for `moving`."),
    choice("/scene/surfaces/*/presence", &["always", "until_start"], "assumed",
        "All the time, or only until t = 0, as a shutter."),

    field("/numerics/timestep_s", Kind::NumberOrAuto(from_to(1e-9, 0.1)), "s", Preset::Number(5.75e-5), "Table 2",
        "Time step; `auto` picks the largest safe one from stiffness, mass and damping."),
    number("/numerics/duration_s", "s", 6.0, TIME, "numerics",
        "Simulated time from t = 0: the start of the belt, or of the test.")
        .elsewhere(&[("drop", Preset::Number(2.0)), ("bend", Preset::Number(5.0)), ("scene", Preset::Number(2.0))])
        .unused_in(&["slide", "compress"]),
    number("/numerics/output_interval_s", "s", 0.02, above_to(0.0, 0.1), "numerics",
        "Interval between samples.")
        .elsewhere(&[("drop", Preset::Number(0.002))]),
    flag("/numerics/stop/when_empty", true, "numerics",
        "Whether a run ends once every fillet has left.")
        .unused_in(&["drop", "bend", "slide", "compress"]),
    nullable("/numerics/stop/when_jammed_s", "s", TIME, "numerics",
        "A run ends once nothing has passed the gate for this long; null never.")
        .unused_in(&["drop", "bend", "slide", "compress", "scene"]),
    flag("/numerics/stop/when_done", true, "numerics",
        "Whether a run ends once what it measures is known: fillets at rest, or sliding, or the block compressed.")
        .elsewhere(&[("scene", Preset::Flag(false))])
        .unused_in(&["hopper"]),
    number("/numerics/gravity_m_s2", "m/s²", 9.81, from_to(0.0, 100.0), "assumed",
        "Acceleration of gravity, downwards; none in a compression test, where the block's weight would stand in the curve.")
        .elsewhere(&[("compress", Preset::Number(0.0))]),
    number("/numerics/rest_speed_m_s", "m/s", 0.05, above_to(0.0, 1.0), "numerics",
        "The bed is at rest, and the belt starts, once all but one in a thousand of its sub-particles are slower than this.")
        .elsewhere(&[("bend", Preset::Number(0.02)), ("slide", Preset::Number(0.01))]),
    number("/numerics/max_fill_s", "s", 10.0, TIME, "numerics",
        "What has not come to rest before t = 0 after this long ends the run.")
        .unused_in(&["drop", "compress", "scene"]),
    number("/numerics/speed_limit_m_s", "m/s", 30.0, from_to(1.0, 10_000.0), "numerics",
        "A sub-particle faster than this makes the run `unstable`."),
    flag("/numerics/allow_unstable", false, "numerics",
        "Whether time steps past the stability limit run, as a stability study needs."),

    integer("/seed", 1, from_to(0.0, 9_007_199_254_740_991.0), "numerics",
        "Seed of everything drawn at random; at most 2⁵³ − 1, which every JSON reader keeps exact."),
];
