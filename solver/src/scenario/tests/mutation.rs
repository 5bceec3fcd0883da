//! Wrong values in every place: never a panic, and the fault points at the place.

use serde_json::{Value, json};

use super::full;
use crate::scenario::field::{Field, Kind};
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

/// Whether a field takes a value, worked out apart from the code under test.
fn sound(field: &Field, value: &Value) -> bool {
    match field.kind {
        Kind::Number(range) => value.as_f64().is_some_and(|number| range.contains(number)),
        Kind::Nullable(range) => {
            value.is_null() || value.as_f64().is_some_and(|number| range.contains(number))
        }
        Kind::NumberOrAuto(range) => {
            value == "auto" || value.as_f64().is_some_and(|number| range.contains(number))
        }
        Kind::Integer(range) => value.as_u64().is_some_and(|number| range.contains(number as f64)),
        Kind::Choice(words) => value.as_str().is_some_and(|word| words.contains(&word)),
        Kind::Flag => value.is_boolean(),
        Kind::Sizes(_) => false,
    }
}

#[test]
fn every_wrong_value_in_every_field_is_told_at_its_place() {
    let mut refused = 0;
    for field in FIELDS {
        for wrong in wrong_values() {
            let mut document = full();
            *document.pointer_mut(field.pointer).unwrap() = wrong.clone();
            match from_value(&document) {
                Ok(_) => assert!(sound(field, &wrong), "{} took {wrong}", field.pointer),
                Err(found) if sound(field, &wrong) => {
                    // Sound alone, at fault with another field: the pair's own tests say where.
                    assert_eq!(found.len(), 1, "{}: {wrong}", field.pointer);
                    assert!(find(&found[0].pointer).is_some(), "{}: {wrong}", field.pointer);
                }
                Err(found) => {
                    refused += 1;
                    for fault in &found {
                        assert!(
                            fault.pointer.starts_with(field.pointer),
                            "{}: {wrong}: {fault}",
                            field.pointer
                        );
                        assert!(fault.allowed.is_some(), "{fault}");
                    }
                }
            }
        }
    }
    assert!(refused > 10 * FIELDS.len(), "only {refused} refused");
}

#[test]
fn every_wrong_value_in_every_section_is_told_at_its_place() {
    for (pointer, _) in SECTIONS {
        for wrong in wrong_values() {
            let mut document = full();
            *document.pointer_mut(pointer).unwrap() = wrong.clone();
            match from_value(&document) {
                Ok(scenario) => {
                    assert_eq!(wrong, json!({}), "{pointer}");
                    assert_eq!(serde_json::to_value(scenario).unwrap(), full());
                }
                Err(found) => {
                    assert_eq!(found.len(), 1, "{pointer}: {wrong}");
                    assert!(found[0].pointer.starts_with(pointer), "{pointer}: {wrong}");
                }
            }
        }
    }
}

#[test]
fn what_is_left_out_takes_its_default() {
    for field in FIELDS.iter().filter(|field| field.pointer != "/experiment") {
        let mut document = full();
        let (section, name) = field.pointer.rsplit_once('/').unwrap();
        document.pointer_mut(section).unwrap().as_object_mut().unwrap().remove(name).unwrap();
        let scenario = from_value(&document).unwrap_or_else(|found| panic!("{}: {found:?}", field.pointer));
        assert_eq!(serde_json::to_value(scenario).unwrap(), full(), "{}", field.pointer);
    }
}
