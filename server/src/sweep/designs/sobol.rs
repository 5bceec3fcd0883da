//! Sobol: points of a Sobol sequence with Owen's scrambling.

use std::ops::{Range, RangeInclusive};

use roost_api::Fault;
use roost_api::design::Design as DesignSpec;
use serde_json::json;

use super::planned::Plan;
use super::{Addition, Design, Parameters, PointRows, drawn};
use crate::document::fault;
use crate::sweep::values::ValueSource;

/// Points of the longest sequence.
const MAX_POINTS: u32 = 1 << 16;
/// Factors that the sequence has numbers for.
const MAX_FACTORS: usize = sobol_burley::NUM_DIMENSIONS as usize;

#[derive(Debug)]
pub(super) struct Sobol;

impl Design for Sobol {
    fn fields(&self) -> &'static [&'static str] {
        drawn::FIELDS
    }

    fn values(&self) -> ValueSource {
        ValueSource::LevelsOrRange
    }

    fn factor_counts(&self) -> RangeInclusive<usize> {
        1..=MAX_FACTORS
    }

    fn read(&self, spec: &DesignSpec, _factors: &[String], faults: &mut Vec<Fault>) -> Option<Parameters> {
        let parameters = drawn::read(spec)?;
        check_length("/design/points", parameters.points, parameters.points.into(), faults);
        Some(parameters)
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
        faults: &mut Vec<Fault>,
    ) -> PointRows<'a> {
        let asked = addition.extension.points.unwrap_or(0);
        check_length("/points", asked, addition.points.len() as u64 + u64::from(asked), faults);
        if faults.is_empty() { rows(plan, addition.next_points()) } else { PointRows::none() }
    }
}

fn check_length(at: &str, asked: u32, length: u64, faults: &mut Vec<Fault>) {
    if length > u64::from(MAX_POINTS) {
        let detail = format!("the sequence would have {length} points");
        faults.push(fault(at, json!(asked), &detail, &format!("at most {MAX_POINTS} points in all")));
    }
}

fn rows(plan: &Plan, points: Range<u32>) -> PointRows<'_> {
    let count = points.len() as u64;
    let row = |point| drawn::row(&plan.factors, |factor| number(point, factor, plan.parameters.seed));
    PointRows::new(Some(count), points.map(row))
}

/// One number of the sequence (directions of Joe and Kuo) in Owen's scrambling by hashes (Burley 2020). It also shuffles
/// the points, but keeps every power of two of them even.
pub(in crate::sweep) fn number(point: u32, factor: usize, seed: u64) -> f64 {
    // The crate takes 32 bits: both halves of the seed count.
    f64::from(sobol_burley::sample(point, factor as u32, (seed ^ (seed >> 32)) as u32))
}
