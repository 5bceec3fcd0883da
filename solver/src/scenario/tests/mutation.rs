//! Wrong values in every place: never a panic, and the fault points at the place.

use serde_json::{Value, json};

use super::documents_with;
use crate::scenario::field::{Field, FieldKind, Preset};
use crate::scenario::fields::{FIELDS, SECTIONS, find};
use crate::scenario::from_value;

fn wrong_values() -> Vec<Value> {
    vec![
        json!(null),
        json!(true),
        json!(-1),
        json!(0),
        json!(0.5),
        json!(1e308),
        json!(-1e308),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(""),
        json!("auto"),
        json!("NaN"),
        json!([]),
        json!([[]]),
        json!([[0.1, 0.1, null]]),
        json!({}),
        json!({"": {"/": 1}}),
    ]
}

/// Each of the one with each of the other.
fn pairs<'a, A, B>(ones: &'a [A], others: &'a [B]) -> impl Iterator<Item = (&'a A, &'a B)> {
    ones.iter().flat_map(move |one| others.iter().map(move |other| (one, other)))
}

/// Whether a field takes a value, worked out apart from the code under test.
fn sound(field: &Field, value: &Value) -> bool {
    match field.kind {
        FieldKind::Number(range) => value.as_f64().is_some_and(|number| range.contains(number)),
        FieldKind::Nullable(range) => {
            value.is_null() || value.as_f64().is_some_and(|number| range.contains(number))
        }
        FieldKind::NumberOrAuto(range) => {
            value == "auto" || value.as_f64().is_some_and(|number| range.contains(number))
        }
        FieldKind::Integer(range) => value.as_u64().is_some_and(|number| range.contains(number as f64)),
        FieldKind::Choice(words) => value.as_str().is_some_and(|word| words.contains(&word)),
        FieldKind::Flag => value.is_boolean(),
        FieldKind::NullableInteger(range) => {
            value.is_null() || value.as_u64().is_some_and(|number| range.contains(number as f64))
        }
        FieldKind::Text => value.as_str().is_some_and(|text| !text.is_empty()),
        FieldKind::Mesh | FieldKind::Plate(_) => value.is_null(),
        FieldKind::Sizes(_) | FieldKind::Vector(_) | FieldKind::Counts(_) => false,
    }
}

#[test]
fn every_wrong_value_of_every_field_is_a_fault_at_its_pointer() {
    let mut refused = 0;
    for field in FIELDS {
        let documents = documents_with(field.pointer);
        assert!(!documents.is_empty(), "{} means nothing anywhere", field.pointer);
        for ((sound_document, pointer), wrong) in pairs(&documents, &wrong_values()) {
            let mut document = sound_document.clone();
            *document.pointer_mut(pointer).unwrap() = wrong.clone();
            match from_value(&document) {
                Ok(_) => assert!(sound(field, wrong), "{pointer} took {wrong}"),
                Err(found) if sound(field, wrong) => {
                    // Sound alone, at fault with another field: the pair's own tests say where.
                    assert_eq!(found.len(), 1, "{pointer}: {wrong}");
                    assert!(find(&found[0].pointer).is_some(), "{pointer}: {wrong}");
                }
                Err(found) => {
                    refused += 1;
                    for fault in &found {
                        assert!(fault.pointer.starts_with(pointer.as_str()), "{pointer}: {wrong}: {fault}");
                        assert!(fault.allowed.is_some(), "{fault}");
                    }
                }
            }
        }
    }
    assert!(refused > 10 * FIELDS.len(), "only {refused} refused");
}

#[test]
fn every_wrong_value_of_every_section_is_a_fault_at_its_pointer() {
    for section in SECTIONS {
        let pointer = section.pointer;
        for ((sound_document, _), wrong) in pairs(&documents_with(pointer), &wrong_values()) {
            let mut document = sound_document.clone();
            *document.pointer_mut(pointer).unwrap() = wrong.clone();
            match from_value(&document) {
                Ok(scenario) => {
                    assert!(*wrong == json!({}) || *wrong == json!([]), "{pointer}: {wrong}");
                    assert_eq!(
                        serde_json::to_value(&scenario).unwrap()["experiment"],
                        document["experiment"]
                    );
                }
                Err(found) => {
                    assert!(
                        found.iter().all(|fault| fault.pointer.starts_with(pointer)),
                        "{pointer}: {wrong}"
                    );
                }
            }
        }
    }
}

#[test]
fn omitted_fields_take_their_defaults() {
    for field in FIELDS.iter().filter(|field| field.default != Preset::Required) {
        for (full, pointer) in documents_with(field.pointer) {
            // The one that stands in for another is no default.
            if pointer.ends_with("/plate_m") {
                continue;
            }
            let mut document = full.clone();
            let (section, name) = pointer.rsplit_once('/').unwrap();
            document.pointer_mut(section).unwrap().as_object_mut().unwrap().remove(name).unwrap();
            let scenario = from_value(&document).unwrap_or_else(|found| panic!("{pointer}: {found:?}"));
            assert_eq!(serde_json::to_value(scenario).unwrap(), full, "{pointer}");
        }
    }
}
