//! The field table: every field of a scenario, once. Validation, defaults, JSON Schema and the docs all read it.
//!
//! Sources: tables, figures and sections are those of Vink et al. 2026; "derived" is worked out from numbers
//! of the paper, "assumed" is ours, "numerics" is a choice of computation that shall not change the physics.

use super::SCHEMA;
use super::field::{Field, FieldKind, Preset, Section, from_to};
use super::row::{choice, field, integer, section};
use super::sections::Declaration;
use super::sections::{DECLARATIONS, bonds, contact, material, numerics, product, surface};

/// The sections of a scenario, in their order.
pub const SECTIONS: &[Section] = &joined::<Section, { count(SECTION_PARTS) }>(SECTION_PARTS);

const SECTION_PARTS: &[&[Section]] = &[PHYSICS, OWN_SECTIONS, NUMERICS];

#[rustfmt::skip]
const PHYSICS: &[Section] = &[
    section("/product", None,
        "This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in `compress`) or a single \
         sphere."),
    section("/material", None, "This section has the elastic constants of the tissue."),
    section("/bonds", None, "This section describes the bonds between the sub-particles of a body."),
    section("/contact", None, "This section describes the contacts of sub-particles with each other and with the equipment."),
    section("/contact/fillet_fillet", None,
        "These values apply to contacts between two sub-particles."),
    section("/contact/fillet_equipment", None, "These values apply to contacts of sub-particles with walls, gates and plates."),
    section("/contact/fillet_belt", None, "These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."),
];

const NUMERICS: &[Section] = &[
    section(
        "/numerics",
        None,
        "This section sets the time step, the duration, the time between samples, and the end of a simulation.",
    ),
    section(
        "/numerics/stop",
        None,
        "Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its duration.",
    ),
];

/// The pointer of the table for a pointer of a document: `/scene/bodies/*` for `/scene/bodies/3`.
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

/// The declaration of an experiment by its word.
pub fn declaration(experiment: &str) -> Option<&'static Declaration> {
    DECLARATIONS.iter().copied().find(|declaration| declaration.name == experiment)
}

/// The words of the experiments that take a shared field.
pub fn experiments_of(field: &Field) -> Vec<&'static str> {
    DECLARATIONS
        .iter()
        .filter(|declaration| declaration.takes(field))
        .map(|declaration| declaration.name)
        .collect()
}

/// The words of `/experiment`.
pub const EXPERIMENTS: &[&str] = &{
    let mut names = [""; DECLARATIONS.len()];
    let mut k = 0;
    while k < names.len() {
        names[k] = DECLARATIONS[k].name;
        k += 1;
    }
    names
};

/// The head of the document.
#[rustfmt::skip]
const HEAD: &[Field] = &[
    choice("/schema", &[SCHEMA], "format",
        "Name and version of the document's format. Roost also reads the older formats `roost.scenario/1` and \
         `roost.scenario/2`. In both, the default of `/product/fill` is `centres`. In `roost.scenario/1`, bonds have no `reference_radius_m`."),
    field("/experiment", FieldKind::Choice(EXPERIMENTS), "", Preset::Required, "section 2",
        "Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide` and `compress`: the paper's \
         small tests (section 2.3). `scene`: bodies and surfaces at positions that you choose."),
];

#[rustfmt::skip]
const SEED: &[Field] = &[
    integer("/seed", 1, from_to(0.0, 9_007_199_254_740_991.0), "numerics",
        "Start value of all random numbers. With another seed, the random start positions and angles of the bodies are different."),
];

/// The fields of the experiments' own sections.
const OWN_FIELDS: &[Field] = {
    const PARTS: [&[Field]; DECLARATIONS.len()] = {
        let mut parts = [DECLARATIONS[0].fields; DECLARATIONS.len()];
        let mut k = 0;
        while k < parts.len() {
            parts[k] = DECLARATIONS[k].fields;
            k += 1;
        }
        parts
    };
    &joined::<Field, { count(&PARTS) }>(&PARTS)
};

/// The experiments' own sections.
const OWN_SECTIONS: &[Section] = {
    const PARTS: [&[Section]; DECLARATIONS.len()] = {
        let mut parts = [DECLARATIONS[0].sections; DECLARATIONS.len()];
        let mut k = 0;
        while k < parts.len() {
            parts[k] = DECLARATIONS[k].sections;
            k += 1;
        }
        parts
    };
    &joined::<Section, { count(&PARTS) }>(&PARTS)
};

const FIELD_PARTS: &[&[Field]] = &[
    HEAD,
    product::FIELDS,
    material::FIELDS,
    bonds::FIELDS,
    contact::FIELDS,
    OWN_FIELDS,
    surface::FIELDS,
    numerics::FIELDS,
    SEED,
];

/// Every field of a scenario. A field comes after the fields that its default reads.
pub const FIELDS: &[Field] = &joined::<Field, { count(FIELD_PARTS) }>(FIELD_PARTS);

const fn count<T>(parts: &[&[T]]) -> usize {
    let (mut count, mut part) = (0, 0);
    while part < parts.len() {
        count += parts[part].len();
        part += 1;
    }
    count
}

/// The parts, one after the other. `N` is the number of all their items.
const fn joined<T: Copy, const N: usize>(parts: &[&[T]]) -> [T; N] {
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
