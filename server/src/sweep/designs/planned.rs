//! The input of a design: factors with their values, and the parameters of the design.

use roost_api::design::Factor;
use roost_api::sweep::SweepSpec;

use super::rows::headings;
use super::{Design, Parameters};
use crate::sweep::values::FactorValues;

/// Factors and design of a sweep.
#[derive(Clone, Debug)]
pub(in crate::sweep) struct Plan {
    pub(in crate::sweep) factors: Vec<PlannedFactor>,
    pub(in crate::sweep) design: &'static dyn Design,
    pub(in crate::sweep) parameters: Parameters,
}

/// A factor: fields that take the same value.
#[derive(Clone, Debug)]
pub(in crate::sweep) struct PlannedFactor {
    pub(in crate::sweep) fields: Vec<String>,
    pub(in crate::sweep) values: FactorValues,
}

impl PlannedFactor {
    /// Its name: its first field.
    pub(in crate::sweep) fn name(&self) -> &str {
        self.fields.first().map_or("", String::as_str)
    }
}

/// The factors of a specification. A table without others has a factor per column.
pub(crate) fn factors(spec: &SweepSpec) -> Vec<Factor> {
    match &spec.design.table {
        Some(table) if spec.factors.is_empty() => {
            let column = |pointer| Factor { pointer: Some(pointer), ..Factor::default() };
            headings(table).into_iter().map(column).collect()
        }
        _ => spec.factors.clone(),
    }
}
