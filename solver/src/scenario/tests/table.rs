//! The field table agrees with itself, with the types, and with the two forms made from it.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use super::{documents_with, every_experiment};
use crate::scenario::field::{FieldKind, Preset, unit_suffix};
use crate::scenario::fields::{EXPERIMENTS, FIELDS, SECTIONS, experiments_of, find, in_table};
use crate::scenario::{DECLARATIONS, Scenario, field_tables_markdown, from_value, json_schema};

/// Pointers of all leaves as the table has them; a list of numbers is one.
fn leaves(value: &Value, pointer: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            object.iter().for_each(|(name, value)| leaves(value, &format!("{pointer}/{name}"), found));
        }
        Value::Array(items) if items.first().is_some_and(Value::is_object) => {
            items.iter().for_each(|item| leaves(item, &in_table(&format!("{pointer}/0")), found));
        }
        _ => {
            found.insert(pointer.to_owned());
        }
    }
}

#[test]
fn the_typed_scenario_and_the_table_have_the_same_fields() {
    let mut typed = BTreeSet::new();
    for document in every_experiment() {
        leaves(&document, "", &mut typed);
    }
    let table = FIELDS.iter().map(|field| field.pointer.to_owned()).collect::<BTreeSet<_>>();
    assert_eq!(typed, table);
    assert_eq!(table.len(), FIELDS.len(), "a field stands twice");
}

#[test]
fn every_section_of_a_field_is_described() {
    let described = SECTIONS.iter().map(|section| section.pointer).collect::<BTreeSet<_>>();
    let mut used = BTreeSet::new();
    for field in FIELDS {
        let mut pointer = field.pointer;
        while let Some((section, _)) = pointer.rsplit_once('/').filter(|(section, _)| !section.is_empty()) {
            pointer = section;
            // The fields of a list stand in the table under its first list.
            if !section.ends_with('*') {
                used.insert(section);
            }
        }
    }
    used.insert("/equipment/surfaces");
    assert_eq!(used, described);
}

#[test]
fn experiments_name_shared_fields_that_exist() {
    let shared = |pointer: &str| find(pointer).filter(|field| field.pointer == pointer);
    for declaration in DECLARATIONS {
        for pointer in declaration.takes {
            let field = shared(pointer).unwrap_or_else(|| panic!("{}: {pointer}", declaration.name));
            assert!(field.by_name, "{}: every experiment has {pointer}", declaration.name);
        }
        for (pointer, _) in declaration.defaults {
            let field = shared(pointer).unwrap_or_else(|| panic!("{}: {pointer}", declaration.name));
            assert!(declaration.takes(field), "{} does not take {pointer}", declaration.name);
        }
    }
}

#[test]
fn every_default_lies_in_its_own_range() {
    for field in FIELDS {
        let own = DECLARATIONS.iter().map(|declaration| declaration.default_of(field));
        for preset in [Some(field.default), field.wet].into_iter().flatten().chain(own) {
            let inside = match (field.kind, preset) {
                (FieldKind::Number(range) | FieldKind::NumberOrAuto(range), Preset::Number(number)) => {
                    range.contains(number)
                }
                (FieldKind::Nullable(range), Preset::Number(number)) => range.contains(number),
                (FieldKind::Nullable(_), Preset::Null) => true,
                (FieldKind::Integer(range), Preset::Integer(number)) => range.contains(number as f64),
                (FieldKind::Choice(words), Preset::Word(word)) => words.contains(&word),
                (FieldKind::Flag, Preset::Flag(_)) => true,
                (FieldKind::Sizes(range), Preset::Sizes(sizes)) => {
                    sizes.iter().flatten().all(|edge| range.contains(*edge))
                }
                (FieldKind::Number(range), Preset::SameAs(other)) => {
                    matches!(find(other).unwrap().kind, FieldKind::Number(same) if same == range)
                }
                (FieldKind::NullableInteger(range), Preset::Integer(number)) => range.contains(number as f64),
                (FieldKind::NullableInteger(_) | FieldKind::Mesh | FieldKind::Plate(_), Preset::Null) => true,
                (FieldKind::Vector(range), Preset::Vector(vector)) => {
                    vector.iter().all(|number| range.contains(*number))
                }
                (FieldKind::Counts(range), Preset::Counts(counts)) => {
                    counts.iter().all(|count| range.contains(*count as f64))
                }
                (FieldKind::Choice(_) | FieldKind::Vector(_) | FieldKind::Text, Preset::Required) => true,
                _ => false,
            };
            assert!(inside, "{}: {preset:?}", field.pointer);
        }
    }
}

#[test]
fn defaults_depend_only_on_earlier_fields() {
    let place = |pointer: &str| FIELDS.iter().position(|field| field.pointer == pointer).unwrap();
    for (index, field) in FIELDS.iter().enumerate() {
        if let Preset::SameAs(other) = field.default {
            assert!(place(other) < index, "{}", field.pointer);
        }
        if field.wet.is_some() {
            assert!(place("/contact/condition") < index, "{}", field.pointer);
        }
        if let Some(other) = field.yields_to {
            assert!(place(other) < index, "{}", field.pointer);
        }
    }
}

#[test]
fn field_names_end_in_their_units_and_descriptions_in_a_full_stop() {
    let suffixes = FIELDS.iter().map(|field| unit_suffix(field.unit)).collect::<BTreeSet<_>>();
    for field in FIELDS {
        // The longest suffix that fits is the one: `_m_s2` ends in no `_m`, but `_n_m3` might look like others.
        let longest =
            suffixes.iter().filter(|suffix| field.pointer.ends_with(*suffix)).max_by_key(|s| s.len());
        assert_eq!(longest, Some(&unit_suffix(field.unit)), "{}", field.pointer);
        assert!(field.doc.ends_with('.') && !field.source.is_empty(), "{}", field.pointer);
    }
}

#[test]
fn the_choices_of_the_table_are_the_variants_of_the_types() {
    for field in FIELDS {
        let FieldKind::Choice(words) = field.kind else { continue };
        if ["/schema", "/experiment"].contains(&field.pointer) {
            continue;
        }
        let (mut document, pointer) = documents_with(field.pointer).swap_remove(0);
        for word in words {
            *document.pointer_mut(&pointer).unwrap() = json!(word);
            let scenario = from_value(&document).unwrap();
            assert_eq!(serde_json::to_value(scenario).unwrap().pointer(&pointer), Some(&json!(word)));
        }
        // The reader of the type names all its variants when it meets a stranger.
        *document.pointer_mut(&pointer).unwrap() = json!("stranger");
        let said = serde_json::from_value::<Scenario>(document).unwrap_err().to_string();
        let (_, expected) = said.split_once("expected ").unwrap();
        let variants = expected.split('`').skip(1).step_by(2).collect::<Vec<_>>();
        assert_eq!(variants, words, "{}: {said}", field.pointer);
    }
}

#[test]
fn json_schema_matches_the_field_table() {
    let schema = json_schema();
    assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    assert_eq!(schema["required"], json!(["experiment"]));
    let property = |pointer: &str| {
        let place = pointer.replace('/', "/properties/").replace("/properties/*", "/items");
        schema.pointer(&place).cloned().unwrap_or_else(|| panic!("no {pointer}"))
    };
    for field in FIELDS {
        let property = property(field.pointer);
        assert!(property["type"].is_string() || property["type"].is_array(), "{}", field.pointer);
        assert!(property["description"].as_str().unwrap().contains(field.source));
        assert_eq!(property.get("default").cloned(), field.default.value());
    }
    for section in SECTIONS {
        let object = match section.items {
            Some(_) => property(&format!("{}/*", section.pointer)),
            None => property(section.pointer),
        };
        assert_eq!(object["additionalProperties"], json!(false), "{}", section.pointer);
    }
    assert_eq!(property("/equipment/surfaces/*")["required"], json!(["name"]));
    let radius = property("/product/subparticle_radius_m");
    assert_eq!(radius["title"], "Subparticle radius");
    assert_eq!((&radius["minimum"], &radius["maximum"]), (&json!(0.0005), &json!(0.05)));
    assert_eq!((&radius["x-unit"], property("/seed").get("x-unit")), (&json!("m"), None));
    assert_eq!(property("/bonds/contact_radius_ratio")["exclusiveMinimum"], json!(1));
    assert_eq!(property("/seed")["maximum"], json!(9_007_199_254_740_991_u64));
    assert_eq!(property("/equipment/side_walls")["enum"], json!(["rough", "frictionless", "periodic"]));
    assert_eq!(property("/numerics/stop/when_jammed_s")["type"], json!(["number", "null"]));
    assert_eq!(property("/product/sizes_m")["items"]["minItems"], json!(3));
}

#[test]
fn field_tables_list_a_field_only_for_experiments_that_take_it() {
    let row = |experiment: &str, pointer: &str| {
        let (section, name) = pointer.rsplit_once('/').unwrap();
        let tables = field_tables_markdown(experiment);
        let heading = if section.is_empty() { "The document" } else { section };
        let table = tables.split("### ").find(|table| table.starts_with(&format!("{heading}\n")))?;
        table.lines().find(|line| line.starts_with(&format!("| `{name}` |"))).map(str::to_owned)
    };
    for field in FIELDS {
        let takes = |name: &&&str| row(name, field.pointer).is_some();
        let experiments: Vec<&&str> = EXPERIMENTS.iter().filter(takes).collect();
        assert!(!experiments.is_empty(), "{} is in no table", field.pointer);
        assert!(
            experiments.iter().all(|name| experiments_of(field).contains(name)),
            "{}: {experiments:?}",
            field.pointer
        );
    }
    let has = |experiment: &str, pointer: &str| row(experiment, pointer).is_some();
    assert!(has("drop", "/drop/speed_m_s") && !has("hopper", "/drop/speed_m_s"));
    assert!(has("hopper", "/equipment/surfaces/*/motion") && !has("hopper", "/scene/surfaces/*/motion"));
    assert!(has("scene", "/scene/surfaces/*/motion") && !has("drop", "/scene/bodies/*/shape"));
    let friction = row("hopper", "/contact/fillet_belt/static_friction").unwrap();
    assert!(friction.starts_with("| `static_friction` | `0.5`; wet `0.2` | ≥ 0 and ≤ 5 |"), "{friction}");
    assert!(row("drop", "/product/count").unwrap().starts_with("| `count` | `90` |"));
    for line in EXPERIMENTS
        .iter()
        .flat_map(|name| field_tables_markdown(name).lines().map(str::to_owned).collect::<Vec<_>>())
    {
        assert!(!line.starts_with("| ") || line.matches(" | ").count() == 4, "{line}");
    }
}
