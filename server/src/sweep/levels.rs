//! Single levels: whether two are the same, and whether a field accepts one in any scenario.
//!
//! The faults of levels are thus listed even where other faults prevent the points from being made.

use roost_api::Fault;
use roost_api::design::Factor;
use roost_solver::scenario::field::{Field, FieldKind};
use roost_solver::scenario::fields;
use serde_json::Value;

use crate::document::fault;

/// Whether two levels are the same value: 1 and 1.0 are.
pub(super) fn same(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => one.as_f64() == other.as_f64(),
        (Value::Array(ones), Value::Array(others)) => {
            ones.len() == others.len() && ones.iter().zip(others).all(|(one, other)| same(one, other))
        }
        _ => one == other,
    }
}

/// The position of a value in a list of levels.
pub(super) fn position(value: &Value, levels: &[Value]) -> Option<usize> {
    levels.iter().position(|other| same(other, value))
}

/// Whether a field accepts a value, whatever the other fields hold. Lists are checked with the whole scenario.
pub(super) fn fits(field: &Field, value: &Value) -> bool {
    match (field.kind, value) {
        (FieldKind::Nullable(_) | FieldKind::NullableInteger(_), Value::Null)
        | (FieldKind::Flag, Value::Bool(_)) => true,
        (FieldKind::NumberOrAuto(_), Value::String(word)) => word == "auto",
        (FieldKind::Integer(range) | FieldKind::NullableInteger(range), Value::Number(number)) => {
            number.as_f64().is_some_and(|number| range.contains(number) && number.fract() == 0.0)
        }
        (
            FieldKind::Number(range) | FieldKind::Nullable(range) | FieldKind::NumberOrAuto(range),
            Value::Number(number),
        ) => number.as_f64().is_some_and(|number| range.contains(number)),
        (FieldKind::Choice(words), Value::String(word)) => words.contains(&word.as_str()),
        (
            FieldKind::Sizes(_)
            | FieldKind::Vector(_)
            | FieldKind::Counts(_)
            | FieldKind::Plate(_)
            | FieldKind::Mesh,
            _,
        ) => true,
        (FieldKind::Text, Value::String(_)) => true,
        _ => false,
    }
}

/// Finds levels that their fields never accept.
pub(super) fn check(factors: &[Factor], faults: &mut Vec<Fault>) {
    for (index, factor) in factors.iter().enumerate() {
        for field in factor.fields().into_iter().filter_map(fields::find) {
            let levels = factor.levels.iter().flatten().enumerate();
            for (level, value) in levels.filter(|(_, value)| !fits(field, value)) {
                let at = format!("/factors/{index}/levels/{level}");
                faults.push(fault(&at, value.clone(), "not a value of this field", &field.allowed()));
            }
        }
    }
}
