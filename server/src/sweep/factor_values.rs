//! Reading the values of a factor: its levels, or the numbers of its range, checked against its fields and the design.

use roost_api::Fault;
use roost_api::design::{DesignKind, Factor, Scale};
use roost_solver::scenario::field::FieldKind;
use roost_solver::scenario::fields;
use serde_json::{Value, json};

use super::levels::{self, position, same};
use super::values::{FactorValues, NumberRange, ValueSource};
use crate::document::fault;

/// The values of a factor in a design of some kind; none when they are at fault.
pub(super) fn read(
    at: &str,
    factor: &Factor,
    (kind, source): (DesignKind, ValueSource),
    faults: &mut Vec<Fault>,
) -> Option<FactorValues> {
    let before = faults.len();
    let numbers = [
        ("low", factor.low.map(|low| json!(low))),
        ("high", factor.high.map(|high| json!(high))),
        ("scale", factor.scale.map(|scale| json!(scale))),
        ("count", factor.count.map(|count| json!(count))),
    ];
    let given: Vec<(&str, Value)> =
        numbers.into_iter().filter_map(|(name, value)| value.map(|value| (name, value))).collect();
    if source == ValueSource::Rows {
        let levels = factor.levels.as_ref().map(|levels| ("levels", json!(levels)));
        for (name, value) in given.into_iter().chain(levels) {
            let detail = format!("the rows of a {kind} give the values of its factors");
            faults.push(fault(&format!("{at}/{name}"), value, &detail, "`pointer` or `pointers` alone"));
        }
        return Some(FactorValues::Rows);
    }
    if let Some(levels) = &factor.levels {
        for (name, value) in given {
            faults.push(fault(
                &format!("{at}/{name}"),
                value,
                "the factor has `levels` already",
                "levels, or low and high",
            ));
        }
        check_levels(&format!("{at}/levels"), levels, faults);
        if let ValueSource::Levels { count, is_fixed: true } = source
            && levels.len() != count as usize
        {
            let detail = format!("{} levels in a design of the kind {kind}", levels.len());
            let allowed = format!("{count} levels, or `low` and `high`");
            faults.push(fault(&format!("{at}/levels"), json!(levels), &detail, &allowed));
        }
        return (faults.len() == before).then(|| FactorValues::Levels(levels.clone()));
    }
    let (Some(low), Some(high)) = (factor.low, factor.high) else {
        let (name, detail) = match (factor.low, factor.high) {
            (Some(_), None) => ("high", "`low` needs `high`"),
            (None, Some(_)) => ("low", "`high` needs `low`"),
            _ => ("levels", "a factor needs values"),
        };
        faults.push(fault(&format!("{at}/{name}"), Value::Null, detail, "`levels`, or `low` and `high`"));
        return None;
    };
    let range = number_range(at, factor, low, high, faults)?;
    let takes_count = matches!(source, ValueSource::Levels { is_fixed: false, .. });
    if let Some(count) = factor.count.filter(|_| !takes_count) {
        let detail = format!("{kind} does not take a number of levels");
        faults.push(fault(
            &format!("{at}/count"),
            json!(count),
            &detail,
            "`count` is for grid and one_at_a_time",
        ));
    }
    if let Some(count) = factor.count.filter(|count| !(2..=MAX_COUNT).contains(count)) {
        faults.push(fault(
            &format!("{at}/count"),
            json!(count),
            "not a number of levels",
            &format!("2 to {MAX_COUNT}"),
        ));
    }
    if faults.len() > before {
        return None;
    }
    let ValueSource::Levels { count, .. } = source else { return Some(FactorValues::Range(range)) };
    let count = factor.count.unwrap_or(count);
    let levels = range.levels(count);
    if levels.windows(2).any(|pair| same(&pair[0], &pair[1])) {
        let detail =
            format!("there are no {count} different whole numbers at equal distances from {low} to {high}");
        faults.push(fault(at, json!(factor), &detail, "a wider range, or `levels`"));
        return None;
    }
    Some(FactorValues::Levels(levels))
}

/// Maximum number of levels of a range.
const MAX_COUNT: u32 = 1000;

fn number_range(
    at: &str,
    factor: &Factor,
    low: f64,
    high: f64,
    faults: &mut Vec<Fault>,
) -> Option<NumberRange> {
    let before = faults.len();
    let scale = factor.scale.unwrap_or(Scale::Linear);
    if low >= high {
        faults.push(fault(
            &format!("{at}/high"),
            json!(high),
            "not above `low`",
            &format!("more than {low}"),
        ));
    }
    if scale == Scale::Log && low <= 0.0 {
        let detail = "a logarithmic scale has positive numbers only";
        faults.push(fault(&format!("{at}/low"), json!(low), detail, "more than 0, or a linear scale"));
    }
    let fields: Vec<_> = factor.fields().into_iter().filter_map(fields::find).collect();
    for field in &fields {
        for (name, end) in [("low", low), ("high", high)] {
            if !levels::fits(field, &json!(end)) {
                let detail = format!("not a value of {}", field.pointer);
                faults.push(fault(&format!("{at}/{name}"), json!(end), &detail, &field.allowed()));
            }
        }
    }
    let is_whole = is_whole(factor);
    (faults.len() == before).then_some(NumberRange { low, high, scale, is_whole })
}

/// Whether one of the factor's fields has whole numbers.
pub(crate) fn is_whole(factor: &Factor) -> bool {
    let is_integer = |pointer: &str| {
        let kind = fields::find(pointer).map(|field| field.kind);
        matches!(kind, Some(FieldKind::Integer(_) | FieldKind::NullableInteger(_)))
    };
    factor.fields().into_iter().any(|pointer| is_integer(pointer) || is_count(pointer))
}

/// Whether a pointer names one number of a list of counts.
fn is_count(pointer: &str) -> bool {
    let parent = pointer.rsplit_once('/').and_then(|(parent, _)| fields::find(parent));
    parent.is_some_and(|field| matches!(field.kind, FieldKind::Counts(_)))
}

/// Finds an empty list of levels, and levels that are listed twice.
pub(super) fn check_levels(at: &str, levels: &[Value], faults: &mut Vec<Fault>) {
    if levels.is_empty() {
        faults.push(fault(at, json!([]), "a factor needs levels", "at least one value"));
    }
    for (index, value) in levels.iter().enumerate() {
        if position(value, &levels[..index]).is_some() {
            let detail = "the level is listed twice; use `replicates` to repeat a point";
            faults.push(fault(&format!("{at}/{index}"), value.clone(), detail, ""));
        }
    }
}
