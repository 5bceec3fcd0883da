//! Parts that designs by levels share.

use roost_api::Fault;
use roost_solver::scenario::escape;
use serde_json::{Value, json};

use super::planned::PlannedFactor;
use super::{Addition, names};
use crate::document::fault;
use crate::sweep::factor_values::check_levels;
use crate::sweep::levels::position;
use crate::sweep::values::FactorValues;

/// The levels of a factor.
pub(super) fn levels(factor: &PlannedFactor) -> &[Value] {
    match &factor.values {
        FactorValues::Levels(levels) => levels,
        FactorValues::Range(_) | FactorValues::Rows => &[],
    }
}

/// The number of levels of each factor.
pub(super) fn counts(factors: &[PlannedFactor]) -> Vec<usize> {
    factors.iter().map(|factor| levels(factor).len()).collect()
}

/// Mixed-radix digits of the index, the last varying fastest.
pub(in crate::sweep) fn digits(counts: &[usize], mut index: u64) -> Vec<usize> {
    let mut digits = vec![0; counts.len()];
    for (digit, count) in digits.iter_mut().zip(counts).rev() {
        *digit = (index % *count as u64) as usize;
        index /= *count as u64;
    }
    digits
}

/// Adds the levels of an extension to the factors, after those they have. `is_known` says whether a point holds a level of a
/// factor that is not in its list. Returns how many levels each factor had.
pub(super) fn add_levels(
    factors: &mut [PlannedFactor],
    addition: &Addition<'_>,
    is_known: impl Fn(&str, &Value) -> bool,
    faults: &mut Vec<Fault>,
) -> Vec<usize> {
    let names = names(factors);
    let added = addition.extension.levels.as_ref();
    for (name, levels) in added.into_iter().flatten() {
        let at = format!("/levels/{}", escape(name));
        if !names.contains(name) {
            faults.push(fault(&at, json!(name), "the sweep has no such factor", &names.join(", ")));
        }
        check_levels(&at, levels, faults);
    }
    let mut old = Vec::new();
    for (factor, name) in factors.iter_mut().zip(&names) {
        let FactorValues::Levels(levels) = &mut factor.values else { continue };
        old.push(levels.len());
        for (index, value) in added.and_then(|added| added.get(name)).into_iter().flatten().enumerate() {
            if position(value, levels).is_some() || is_known(name, value) {
                let at = format!("/levels/{}/{index}", escape(name));
                faults.push(fault(&at, value.clone(), "the factor has this level already", "another value"));
            } else {
                levels.push(value.clone());
            }
        }
    }
    old
}
