//! List: the points in `rows`.

use roost_api::Fault;
use roost_api::design::Design as DesignSpec;

use super::planned::Plan;
use super::{Addition, Design, Parameters, PointRows, rows};
use crate::sweep::values::ValueSource;

#[derive(Debug)]
pub(super) struct List;

impl Design for List {
    fn fields(&self) -> &'static [&'static str] {
        &["rows"]
    }

    fn values(&self) -> ValueSource {
        ValueSource::Rows
    }

    fn read(&self, spec: &DesignSpec, factors: &[String], faults: &mut Vec<Fault>) -> Option<Parameters> {
        let rows = spec.rows.clone()?;
        rows::check("/design/rows", &rows, factors.len(), faults);
        rows::check_repeats("/design/rows", &rows, &[], faults);
        Some(Parameters { rows, ..Parameters::default() })
    }

    fn points<'a>(&self, plan: &'a Plan) -> PointRows<'a> {
        PointRows::of_parameters(&plan.parameters)
    }

    fn extension_fields(&self) -> Result<&'static [&'static str], &'static str> {
        Ok(rows::EXTENSION_FIELDS)
    }

    fn extend<'a>(
        &self,
        plan: &'a mut Plan,
        addition: &Addition<'_>,
        faults: &mut Vec<Fault>,
    ) -> PointRows<'a> {
        PointRows::listed(rows::added(&plan.factors, addition, faults))
    }
}
