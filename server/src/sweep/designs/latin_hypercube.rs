//! Latin hypercube: each of as many equal parts of every factor as there are points holds one point.

use roost_api::Fault;
use roost_api::design::Design as DesignSpec;

use super::planned::Plan;
use super::{Addition, Design, Parameters, PointRows, drawn};
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
        let columns = move || -> Vec<Vec<f64>> {
            let factors = 0..plan.factors.len();
            factors.map(|factor| column(points as usize, factor, plan.parameters.seed)).collect()
        };
        let rows = move |columns: Vec<Vec<f64>>| {
            (0..points as usize).map(move |point| drawn::row(&plan.factors, |factor| columns[factor][point]))
        };
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

/// The numbers of one factor for all points: one in each of as many equal parts as there are points, in random order
/// (McKay, Beckman and Conover 1979).
pub(in crate::sweep) fn column(points: usize, factor: usize, seed: u64) -> Vec<f64> {
    let mut generator = drawn::generator(seed, factor as u64);
    let mut parts: Vec<usize> = (0..points).collect();
    for last in (1..points).rev() {
        parts.swap(last, (drawn::uniform(&mut generator) * (last + 1) as f64) as usize);
    }
    parts.into_iter().map(|part| (part as f64 + drawn::uniform(&mut generator)) / points as f64).collect()
}
