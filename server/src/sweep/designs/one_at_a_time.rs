//! One at a time: the base, then each factor through its levels while all others stay as in the base.

use roost_api::Fault;
use serde_json::{Map, Value};

use super::by_levels::{add_levels, counts, levels};
use super::planned::{Plan, PlannedFactor};
use super::{Addition, Design, PointRows, Row};
use crate::sweep::levels::same;
use crate::sweep::values::ValueSource;

#[derive(Debug)]
pub(super) struct OneAtATime;

impl Design for OneAtATime {
    fn values(&self) -> ValueSource {
        ValueSource::Levels { count: 2, is_fixed: false }
    }

    /// The base is a point of its own.
    fn drop_known_levels(&self, levels: &mut Vec<Value>, base: &Value) {
        levels.retain(|level| !same(base, level));
    }

    fn points<'a>(&self, plan: &'a Plan) -> PointRows<'a> {
        let base: Row = vec![None; plan.factors.len()];
        let old = vec![0; plan.factors.len()];
        PointRows::new(
            Some(1 + size(&plan.factors, &old)),
            std::iter::once(base).chain(rows(&plan.factors, old)),
        )
    }

    fn extension_fields(&self) -> Result<&'static [&'static str], &'static str> {
        Ok(&["levels"])
    }

    fn extend<'a>(
        &self,
        plan: &'a mut Plan,
        addition: &Addition<'_>,
        faults: &mut Vec<Fault>,
    ) -> PointRows<'a> {
        let is_known = |name: &str, value: &Value| {
            addition.base.pointer(name).is_some_and(|base| same(base, value))
                || addition.points.iter().any(|point| varies_only(point, name, value, addition))
        };
        let old = add_levels(&mut plan.factors, addition, is_known, faults);
        PointRows::new(Some(size(&plan.factors, &old)), rows(&plan.factors, old))
    }
}

/// The number of levels after the old ones.
fn size(factors: &[PlannedFactor], old: &[usize]) -> u64 {
    counts(factors).iter().zip(old).map(|(count, old)| (count - old) as u64).sum()
}

/// Each factor in turn through its levels after the old ones.
fn rows(factors: &[PlannedFactor], old: Vec<usize>) -> impl Iterator<Item = Row> {
    factors.iter().zip(old).enumerate().flat_map(move |(index, (factor, old))| {
        levels(factor)[old..].iter().map(move |level| {
            let mut row = vec![None; factors.len()];
            row[index] = Some(level.clone());
            row
        })
    })
}

/// Whether a point has this value of one factor and the base's value of every other.
fn varies_only(point: &Map<String, Value>, name: &str, value: &Value, addition: &Addition<'_>) -> bool {
    let has = |at: &str, value: &Value| point.get(at).is_some_and(|level| same(level, value));
    let Some(base) = addition.points.first() else { return false };
    has(name, value) && base.iter().all(|(other, level)| other == name || has(other, level))
}
