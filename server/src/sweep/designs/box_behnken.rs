//! Box–Behnken, for quadratic models of 3 to 7 factors: two or three factors are low or high, and the others in the middle. One
//! more point is the centre.

use std::ops::RangeInclusive;

use roost_api::Fault;

use super::by_levels::{digits, levels};
use super::planned::{Plan, PlannedFactor};
use super::{Addition, Design, PointRows, Row};
use crate::sweep::values::ValueSource;

/// The factors that vary together in the designs of 3 to 7 factors, block by block (Box and Behnken 1960, Technometrics
/// 2(4), 455–475): pairs up to five factors, triples of six and seven.
const BLOCKS: [&[&[usize]]; 5] = [
    &[&[0, 1], &[0, 2], &[1, 2]],
    &[&[0, 1], &[2, 3], &[0, 3], &[1, 2], &[0, 2], &[1, 3]],
    &[&[0, 1], &[2, 3], &[1, 4], &[0, 2], &[3, 4], &[1, 2], &[0, 3], &[2, 4], &[0, 4], &[1, 3]],
    &[&[0, 1, 3], &[1, 2, 4], &[2, 3, 5], &[0, 3, 4], &[1, 4, 5], &[0, 2, 5]],
    &[&[3, 4, 5], &[0, 5, 6], &[1, 4, 6], &[0, 1, 3], &[2, 3, 6], &[0, 2, 4], &[1, 2, 5]],
];

#[derive(Debug)]
pub(super) struct BoxBehnken;

impl Design for BoxBehnken {
    fn values(&self) -> ValueSource {
        ValueSource::Levels { count: 3, is_fixed: true }
    }

    fn factor_counts(&self) -> RangeInclusive<usize> {
        3..=7
    }

    fn points<'a>(&self, plan: &'a Plan) -> PointRows<'a> {
        let mut points = edges(plan.factors.len());
        points.push(vec![0; plan.factors.len()]);
        PointRows::new(Some(points.len() as u64), points.into_iter().map(|signs| row(&plan.factors, &signs)))
    }

    fn extension_fields(&self) -> Result<&'static [&'static str], &'static str> {
        Err("a Box-Behnken design is complete: submit the points to add as a list of their own")
    }

    fn extend<'a>(&self, _: &'a mut Plan, _: &Addition<'_>, _: &mut Vec<Fault>) -> PointRows<'a> {
        PointRows::none()
    }
}

fn row(factors: &[PlannedFactor], signs: &[i8]) -> Row {
    let level = |(factor, sign): (&PlannedFactor, &i8)| Some(levels(factor)[(sign + 1) as usize].clone());
    factors.iter().zip(signs).map(level).collect()
}

/// The points without the centre: −1, 0 and 1 for the low, middle and high level of each factor. A block has every
/// combination of low and high, the last factor varying fastest.
pub(in crate::sweep) fn edges(factors: usize) -> Vec<Vec<i8>> {
    let Some(blocks) = factors.checked_sub(3).and_then(|index| BLOCKS.get(index)) else { return Vec::new() };
    let mut points = Vec::new();
    for block in *blocks {
        for index in 0..1_u64 << block.len() {
            let mut point = vec![0; factors];
            for (factor, digit) in block.iter().zip(digits(&vec![2; block.len()], index)) {
                point[*factor] = if digit == 0 { -1 } else { 1 };
            }
            points.push(point);
        }
    }
    points
}
