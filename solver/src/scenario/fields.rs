//! The field table: every field of a scenario, once. Validation, defaults, JSON Schema and the docs all read it.
//!
//! Sources: tables, figures and sections are those of Vink et al. 2026; "derived" is worked out from numbers
//! of the paper, "assumed" is ours, "numerics" is a choice of computation that shall not change the physics.

use super::SCHEMA;
use super::field::{Field, Kind, Preset, Section, from_to};
use super::row::{choice, field, integer};
use super::sections::{
    bend, bonds, compress, contact, drop, equipment, material, numerics, product, scene, slide, surface,
};

/// The sections of a scenario, in their order.
#[rustfmt::skip]
pub const SECTIONS: &[Section] = &[
    section("/product", None, "The fillets: number, size, shape and sub-particles."),
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
    section("/numerics/stop", None, "Conditions that end a simulation before its duration."),
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

/// The words of `/experiment`.
pub const EXPERIMENTS: &[&str] = &["hopper", "drop", "bend", "slide", "compress", "scene"];

/// What the document says of itself.
#[rustfmt::skip]
const HEAD: &[Field] = &[
    choice("/schema", &[SCHEMA], "format",
        "Name and version of this document's format."),
    field("/experiment", Kind::Choice(EXPERIMENTS), "", Preset::Required, "section 2",
        "The family of scenarios: `hopper` is the bulk discharge of a hopper by a belt under a gate (section 2.4); `drop`, \
         `bend`, `slide` and `compress` are the paper's tests of single fillets (section 2.3); `scene` is whatever one places."),
];

#[rustfmt::skip]
const SEED: &[Field] = &[
    integer("/seed", 1, from_to(0.0, 9_007_199_254_740_991.0), "numerics",
        "Seed of everything drawn at random; at most 2⁵³ − 1, which every JSON reader keeps exact."),
];

const PARTS: &[&[Field]] = &[
    HEAD,
    product::FIELDS,
    material::FIELDS,
    bonds::FIELDS,
    contact::FIELDS,
    equipment::FIELDS,
    drop::FIELDS,
    bend::FIELDS,
    slide::FIELDS,
    compress::FIELDS,
    scene::FIELDS,
    surface::FIELDS,
    numerics::FIELDS,
    SEED,
];

/// Every field of a scenario. A field stands after those that its default reads.
pub const FIELDS: &[Field] = &joined::<{ count(PARTS) }>(PARTS);

const fn count(parts: &[&[Field]]) -> usize {
    let (mut count, mut part) = (0, 0);
    while part < parts.len() {
        count += parts[part].len();
        part += 1;
    }
    count
}

/// One after the other; `N` is how many they are.
const fn joined<const N: usize>(parts: &[&[Field]]) -> [Field; N] {
    let mut all = [parts[0][0]; N];
    let (mut at, mut part) = (0, 0);
    while part < parts.len() {
        let mut k = 0;
        while k < parts[part].len() {
            all[at] = parts[part][k];
            (at, k) = (at + 1, k + 1);
        }
        part += 1;
    }
    all
}
