//! Designs: the rules that turn the values of factors into design points, a file a kind.
//!
//! The rest of `sweep` knows the trait [`Design`] alone. Points of drawn designs depend on the seed and their index only, so that
//! a longer sequence begins with the shorter one.

mod box_behnken;
mod by_levels;
mod csv;
mod drawn;
mod grid;
mod latin_hypercube;
mod list;
mod one_at_a_time;
mod planned;
mod random;
mod rows;
mod sobol;

use std::ops::{Range, RangeInclusive};

use roost_api::Fault;
use roost_api::design::{Design as DesignSpec, DesignKind, Extension};
use serde_json::{Map, Value};

use super::values::ValueSource;
pub(crate) use planned::factors;
pub(super) use planned::{Plan, PlannedFactor};

/// The numbers behind the designs, for tests.
#[cfg(test)]
pub(super) mod testing {
    pub(in crate::sweep) use super::box_behnken::edges;
    pub(in crate::sweep) use super::by_levels::digits;
    pub(in crate::sweep) use super::latin_hypercube::column as latin_hypercube;
    pub(in crate::sweep) use super::random::numbers as random;
    pub(in crate::sweep) use super::sobol::number as sobol;
}

/// A design point: a value per factor, none where the factor stays as in the base.
pub(super) type Row = Vec<Option<Value>>;

/// A kind of design.
pub(super) trait Design: std::fmt::Debug + Sync {
    /// Fields of the specification that the kind takes beside `kind`. All but `seed` are required.
    fn fields(&self) -> &'static [&'static str] {
        &[]
    }

    /// The source of the values of its factors.
    fn values(&self) -> ValueSource;

    /// How many factors it can have.
    fn factor_counts(&self) -> RangeInclusive<usize> {
        1..=usize::MAX
    }

    /// Removes levels of a factor that the design holds already: `base` is the factor's value in the base.
    fn drop_known_levels(&self, _levels: &mut Vec<Value>, _base: &Value) {}

    /// Reads its parameters for factors of these names; none when they are at fault.
    fn read(&self, _spec: &DesignSpec, _factors: &[String], _faults: &mut Vec<Fault>) -> Option<Parameters> {
        Some(Parameters::default())
    }

    /// All points of a plan.
    fn points<'a>(&self, plan: &'a Plan) -> PointRows<'a>;

    /// Fields of an extension that add points beside `replicates`, or the reason why none do.
    fn extension_fields(&self) -> Result<&'static [&'static str], &'static str>;

    /// The points that an extension adds to a sweep. Levels that it adds go into the plan.
    fn extend<'a>(
        &self,
        plan: &'a mut Plan,
        addition: &Addition<'_>,
        faults: &mut Vec<Fault>,
    ) -> PointRows<'a>;
}

/// The rules of a kind.
pub(super) fn of_kind(kind: DesignKind) -> &'static dyn Design {
    match kind {
        DesignKind::Grid => &grid::Grid,
        DesignKind::OneAtATime => &one_at_a_time::OneAtATime,
        DesignKind::Random => &random::Random,
        DesignKind::LatinHypercube => &latin_hypercube::LatinHypercube,
        DesignKind::Sobol => &sobol::Sobol,
        DesignKind::BoxBehnken => &box_behnken::BoxBehnken,
        DesignKind::List => &list::List,
        DesignKind::Csv => &csv::Csv,
    }
}

/// Parameters of a design.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Parameters {
    /// Points to draw.
    pub(super) points: u32,
    /// Seed of the numbers drawn.
    pub(super) seed: u64,
    /// Listed points.
    pub(super) rows: Vec<Vec<Value>>,
}

/// Rows of design points, counted before they are made. A million of them fit in no memory: they are made one after the other.
pub(super) struct PointRows<'a> {
    /// How many there are; `None` past 2⁶⁴.
    pub(super) count: Option<u64>,
    /// The rows.
    pub(super) rows: Box<dyn Iterator<Item = Row> + Send + 'a>,
}

impl<'a> PointRows<'a> {
    fn new(count: Option<u64>, rows: impl Iterator<Item = Row> + Send + 'a) -> Self {
        Self { count, rows: Box::new(rows) }
    }

    fn none() -> Self {
        Self::new(Some(0), std::iter::empty())
    }

    fn listed(rows: Vec<Vec<Value>>) -> Self {
        let count = rows.len() as u64;
        Self::new(Some(count), rows.into_iter().map(|row| row.into_iter().map(Some).collect()))
    }

    fn of_parameters(parameters: &'a Parameters) -> Self {
        let rows = &parameters.rows;
        Self::new(Some(rows.len() as u64), rows.iter().map(|row| row.iter().cloned().map(Some).collect()))
    }
}

/// An extension of a sweep.
pub(super) struct Addition<'a> {
    /// As submitted.
    pub(super) extension: &'a Extension,
    /// Levels of each existing point, by index.
    pub(super) points: &'a [Map<String, Value>],
    /// The complete base.
    pub(super) base: &'a Value,
}

impl Addition<'_> {
    /// Indices of the points that it asks for.
    fn next_points(&self) -> Range<u32> {
        let first = self.points.len() as u32;
        first..first.saturating_add(self.extension.points.unwrap_or(0))
    }
}

fn names(factors: &[PlannedFactor]) -> Vec<String> {
    factors.iter().map(|factor| factor.name().to_owned()).collect()
}
