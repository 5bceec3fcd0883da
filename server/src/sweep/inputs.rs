//! What values a factor takes: its levels, or the numbers of its range, as far as they fit its fields and the design.

use roost_api::Fault;
use roost_api::design::{DesignKind, Factor, Scale};
use roost_solver::scenario::field::FieldKind;
use roost_solver::scenario::fields;
use serde_json::{Value, json};

use super::levels::{self, same};
use super::rows;
use super::values::{Between, Values};
use crate::document::fault;

/// The values of a factor in a design of that kind; none when they are at fault.
pub(super) fn values(at: &str, factor: &Factor, kind: DesignKind, faults: &mut Vec<Fault>) -> Option<Values> {
    let before = faults.len();
    let numbers = [
        ("low", factor.low.map(|low| json!(low))),
        ("high", factor.high.map(|high| json!(high))),
        ("scale", factor.scale.map(|scale| json!(scale))),
        ("count", factor.count.map(|count| json!(count))),
    ];
    let given: Vec<(&str, Value)> =
        numbers.into_iter().filter_map(|(name, value)| value.map(|value| (name, value))).collect();
    if matches!(kind, DesignKind::List | DesignKind::Csv) {
        let levels = factor.levels.as_ref().map(|levels| ("levels", json!(levels)));
        for (name, value) in given.into_iter().chain(levels) {
            let detail = format!("in a {kind} the rows say which values a factor takes");
            faults.push(fault(&format!("{at}/{name}"), value, &detail, "`pointer` or `pointers` alone"));
        }
        return Some(Values::Listed);
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
        if kind == DesignKind::BoxBehnken && levels.len() != 3 {
            let detail = format!("{} levels of a Box-Behnken design", levels.len());
            faults.push(fault(
                &format!("{at}/levels"),
                json!(levels),
                &detail,
                "three: low, middle and high; or `low` and `high`",
            ));
        }
        return (faults.len() == before).then(|| Values::Levels(levels.clone()));
    }
    let (Some(low), Some(high)) = (factor.low, factor.high) else {
        let (name, detail) = match (factor.low, factor.high) {
            (Some(_), None) => ("high", "`low` stands without `high`"),
            (None, Some(_)) => ("low", "`high` stands without `low`"),
            _ => ("levels", "a factor needs values"),
        };
        faults.push(fault(&format!("{at}/{name}"), Value::Null, detail, "`levels`, or `low` and `high`"));
        return None;
    };
    let between = between(at, factor, low, high, faults)?;
    let by_levels = matches!(kind, DesignKind::Grid | DesignKind::OneAtATime);
    if let Some(count) = factor.count.filter(|_| !by_levels) {
        let detail = format!("{kind} has no use for a number of levels");
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
    let count = match kind {
        DesignKind::Grid | DesignKind::OneAtATime => factor.count.unwrap_or(2),
        DesignKind::BoxBehnken => 3,
        _ => return Some(Values::Between(between)),
    };
    let levels = between.spread(count);
    if levels.windows(2).any(|pair| same(&pair[0], &pair[1])) {
        let detail =
            format!("there are no {count} different whole numbers at equal distances from {low} to {high}");
        faults.push(fault(at, json!(factor), &detail, "a wider range, or `levels`"));
        return None;
    }
    Some(Values::Levels(levels))
}

/// The most levels that a range is cut into.
const MAX_COUNT: u32 = 1000;

fn between(at: &str, factor: &Factor, low: f64, high: f64, faults: &mut Vec<Fault>) -> Option<Between> {
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
        let detail = "a logarithmic scale has no such number";
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
    let is_integer = |kind| matches!(kind, FieldKind::Integer(_) | FieldKind::NullableInteger(_));
    let is_whole =
        fields.iter().any(|field| is_integer(field.kind)) || factor.fields().iter().any(|at| counts(at));
    (faults.len() == before).then_some(Between { low, high, scale, is_whole })
}

/// Whether a pointer leads to one of three whole numbers.
fn counts(pointer: &str) -> bool {
    let parent = pointer.rsplit_once('/').and_then(|(parent, _)| fields::find(parent));
    parent.is_some_and(|field| matches!(field.kind, FieldKind::Counts(_)))
}

/// Looks for levels that stand there twice, or not at all.
pub(super) fn check_levels(at: &str, levels: &[Value], faults: &mut Vec<Fault>) {
    if levels.is_empty() {
        faults.push(fault(at, json!([]), "a factor needs levels", "at least one value"));
    }
    for (index, value) in levels.iter().enumerate() {
        if rows::place(value, &levels[..index]).is_some() {
            let detail = "the level is listed twice; more runs of a point are what `replicates` is for";
            faults.push(fault(&format!("{at}/{index}"), value.clone(), detail, ""));
        }
    }
}
