//! Random: points drawn independently, every value of a factor as likely as any other.

use std::ops::Range;

use roost_api::Fault;
use roost_api::design::Design as DesignSpec;

use super::planned::Plan;
use super::{Addition, Design, Parameters, PointRows, drawn};
use crate::sweep::values::ValueSource;

#[derive(Debug)]
pub(super) struct Random;

impl Design for Random {
    fn fields(&self) -> &'static [&'static str] {
        drawn::FIELDS
    }

    fn values(&self) -> ValueSource {
        ValueSource::LevelsOrRange
    }

    fn read(&self, spec: &DesignSpec, _factors: &[String], _faults: &mut Vec<Fault>) -> Option<Parameters> {
        drawn::read(spec)
    }

    fn points<'a>(&self, plan: &'a Plan) -> PointRows<'a> {
        rows(plan, 0..plan.parameters.points)
    }

    fn extension_fields(&self) -> Result<&'static [&'static str], &'static str> {
        Ok(&["points"])
    }

    fn extend<'a>(
        &self,
        plan: &'a mut Plan,
        addition: &Addition<'_>,
        _faults: &mut Vec<Fault>,
    ) -> PointRows<'a> {
        rows(plan, addition.next_points())
    }
}

fn rows(plan: &Plan, points: Range<u32>) -> PointRows<'_> {
    let count = points.len() as u64;
    let row = |point| {
        let mut numbers = numbers(point, plan.parameters.seed);
        drawn::row(&plan.factors, |_| numbers.next().unwrap_or_default())
    };
    PointRows::new(Some(count), points.map(row))
}

/// Independent numbers for the factors of one point.
pub(in crate::sweep) fn numbers(point: u32, seed: u64) -> impl Iterator<Item = f64> {
    let mut generator = drawn::generator(seed, u64::from(point));
    std::iter::repeat_with(move || drawn::uniform(&mut generator))
}
