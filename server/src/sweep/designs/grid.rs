//! Grid: every combination of all levels, the last factor varying fastest.

use std::ops::RangeInclusive;

use roost_api::Fault;

use super::by_levels::{add_levels, counts, digits, levels};
use super::planned::{Plan, PlannedFactor};
use super::{Addition, Design, PointRows, Row};
use crate::sweep::levels::position;
use crate::sweep::values::FactorValues;
use crate::sweep::values::ValueSource;

#[derive(Debug)]
pub(super) struct Grid;

impl Design for Grid {
    fn values(&self) -> ValueSource {
        ValueSource::Levels { count: 2, is_fixed: false }
    }

    /// Without factors it has one point, for replicates alone.
    fn factor_counts(&self) -> RangeInclusive<usize> {
        0..=usize::MAX
    }

    fn points<'a>(&self, plan: &'a Plan) -> PointRows<'a> {
        let counts = counts(&plan.factors);
        let size = size(&counts);
        let rows = (0..size.unwrap_or(0)).map(move |index| row(&plan.factors, &digits(&counts, index)));
        PointRows::new(size, rows)
    }

    fn extension_fields(&self) -> Result<&'static [&'static str], &'static str> {
        Ok(&["levels"])
    }

    /// Every combination that holds a new level.
    fn extend<'a>(
        &self,
        plan: &'a mut Plan,
        addition: &Addition<'_>,
        faults: &mut Vec<Fault>,
    ) -> PointRows<'a> {
        add_earlier_levels(&mut plan.factors, addition);
        let old = add_levels(&mut plan.factors, addition, |_, _| false, faults);
        let counts = counts(&plan.factors);
        let all = size(&counts);
        let added = all.zip(size(&old)).and_then(|(all, old)| all.checked_sub(old));
        let is_new = move |digits: &Vec<usize>| digits.iter().zip(&old).any(|(digit, old)| digit >= old);
        let combinations = (0..all.unwrap_or(0)).map(move |index| digits(&counts, index)).filter(is_new);
        PointRows::new(added, combinations.map(|digits| row(&plan.factors, &digits)))
    }
}

/// The number of combinations; `None` past 2⁶⁴.
fn size(counts: &[usize]) -> Option<u64> {
    counts.iter().try_fold(1_u64, |product, count| product.checked_mul(*count as u64))
}

fn row(factors: &[PlannedFactor], digits: &[usize]) -> Row {
    factors.iter().zip(digits).map(|(factor, level)| Some(levels(factor)[*level].clone())).collect()
}

/// Adds the levels of earlier extensions to the factors: the points have them.
fn add_earlier_levels(factors: &mut [PlannedFactor], addition: &Addition<'_>) {
    for factor in factors {
        let name = factor.name().to_owned();
        let FactorValues::Levels(levels) = &mut factor.values else { continue };
        for value in addition.points.iter().filter_map(|point| point.get(&name)) {
            if position(value, levels).is_none() {
                levels.push(value.clone());
            }
        }
    }
}
