//! Latin hypercube: each of as many equal parts of every factor as there are points holds one point.

use roost_api::Fault;
use roost_api::design::Design as DesignSpec;

use super::planned::Plan;
use super::{Addition, Design, Parameters, PointRows, Row, drawn};
use crate::sweep::values::ValueSource;

#[derive(Debug)]
pub(super) struct LatinHypercube;

impl Design for LatinHypercube {
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
        let points = plan.parameters.points;
        let columns = move || {
            let column = |factor| column(points, factor, plan.parameters.seed);
            (0..plan.factors.len()).map(column).collect::<Vec<_>>()
        };
        let rows = move |columns| rows(plan, columns);
        PointRows::new(Some(points.into()), std::iter::once_with(columns).flat_map(rows))
    }

    fn extension_fields(&self) -> Result<&'static [&'static str], &'static str> {
        Err(
            "each point of a Latin hypercube has its own part of every factor, and more points would change the parts: \
             submit a larger one, or use sobol",
        )
    }

    fn extend<'a>(&self, _: &'a mut Plan, _: &Addition<'_>, _: &mut Vec<Fault>) -> PointRows<'a> {
        PointRows::none()
    }
}

fn rows(plan: &Plan, mut columns: Vec<impl Iterator<Item = f64> + Send>) -> impl Iterator<Item = Row> + Send {
    let row = move |_| drawn::row(&plan.factors, |factor| columns[factor].next().unwrap_or_default());
    (0..plan.parameters.points).map(row)
}

/// The numbers of one factor for all points: one in each of as many equal parts as there are points, in random order
/// (McKay, Beckman and Conover 1979).
pub(in crate::sweep) fn column(points: u32, factor: usize, seed: u64) -> impl Iterator<Item = f64> + Send {
    let mut generator = drawn::generator(seed, factor as u64);
    let mut parts: Vec<u32> = (0..points).collect();
    for last in (1..points as usize).rev() {
        parts.swap(last, (drawn::uniform(&mut generator) * (last + 1) as f64) as usize);
    }
    let number = move |part| (f64::from(part) + drawn::uniform(&mut generator)) / f64::from(points);
    parts.into_iter().map(number)
}
