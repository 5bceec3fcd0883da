//! Design points: rows of the design, each made into a scenario when it is needed.
//!
//! A row takes some hundred bytes, a complete scenario thousands, and neither is kept: the design makes the rows once to check all points
//! in batches, and once more while earlier batches are stored.

use std::collections::BTreeSet;

use rayon::prelude::*;
use roost_api::Fault;
use roost_api::design::Factor;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario};
use serde_json::{Map, Value, json};

use super::designs::{Plan, PlannedFactor, Row};
use super::extend::replicate;
use super::pointer;
use super::posterior::Posterior;
use super::values::FactorValues;
use crate::mesh;

/// Faults that are listed: more have the same reasons.
const MAX_FAULTS: usize = 100;

/// Points whose scenarios are made or checked together.
const BATCH: usize = 250;

/// A design point.
#[derive(Clone, Debug)]
pub(crate) struct Point {
    /// Level by pointer.
    pub levels: Map<String, Value>,
    /// The scenario of replicate 0, complete.
    pub scenario: Scenario,
}

/// A replicate of a design point.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    /// Index of the point.
    pub point: u32,
    /// Number of the replicate.
    pub replicate: u32,
    /// The scenario with the seed of the replicate.
    pub scenario: Scenario,
    /// Levels of the point, with its first trial only.
    pub levels: Option<Map<String, Value>>,
}

/// The source of the rows of design points.
#[derive(Clone, Debug)]
pub(super) enum RowSource {
    /// All points of a plan.
    Plan(Plan),
    /// Rows that an extension adds.
    Rows(Vec<Row>),
}

/// Design points, as the rows that make them.
#[derive(Clone, Debug)]
pub(crate) struct Points {
    /// The base as submitted.
    base: Value,
    /// The base, complete.
    complete: Value,
    factors: Vec<PlannedFactor>,
    source: RowSource,
    count: usize,
    /// The distribution from which replicates draw their parameters.
    posterior: Option<Posterior>,
}

/// The place in the document that gives the value of a factor in a row.
pub(super) type Place<'a> = &'a dyn Fn(usize, usize, &Value) -> String;

impl Points {
    /// Points of a base as submitted and complete.
    pub(super) fn new(
        base: &Value,
        scenario: &Scenario,
        factors: Vec<PlannedFactor>,
        source: RowSource,
    ) -> Self {
        let count = match &source {
            RowSource::Plan(plan) => plan.design.points(plan).count.unwrap_or(0) as usize,
            RowSource::Rows(rows) => rows.len(),
        };
        Self { base: base.clone(), complete: json!(scenario), factors, source, count, posterior: None }
    }

    /// The same points, whose replicates draw parameters from samples.
    pub(crate) fn with_posterior(self, posterior: Option<Posterior>) -> Self {
        Self { posterior, ..self }
    }

    /// Points of these factors without rows: [`Points::at_values`] makes them one by one.
    pub(crate) fn without_rows(base: &Value, scenario: &Scenario, factors: &[Factor]) -> Self {
        let planned = factors.iter().map(|factor| PlannedFactor {
            fields: factor.fields().into_iter().map(str::to_owned).collect(),
            values: FactorValues::Rows,
        });
        Self::new(base, scenario, planned.collect(), RowSource::Rows(Vec::new()))
    }

    /// The point with a value per factor, or the faults of its scenario.
    pub(crate) fn at_values(&self, values: Vec<Value>) -> Result<Point, Vec<Fault>> {
        let row: Row = values.into_iter().map(Some).collect();
        self.point(&row).map_err(|(_, faults)| faults)
    }

    /// The complete base.
    pub(crate) fn complete_base(&self) -> &Value {
        &self.complete
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// The rows, one after the other.
    fn rows(&self) -> Box<dyn Iterator<Item = Row> + Send + '_> {
        match &self.source {
            RowSource::Plan(plan) => plan.design.points(plan).rows,
            RowSource::Rows(rows) => Box::new(rows.iter().cloned()),
        }
    }

    /// The rows in batches.
    fn batches(&self) -> impl Iterator<Item = Vec<Row>> + Send + '_ {
        let mut rows = self.rows();
        let batch = move || Some(rows.by_ref().take(BATCH).collect());
        std::iter::from_fn(batch).take_while(|batch: &Vec<Row>| !batch.is_empty())
    }

    /// Makes every point, one after the other.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Point> {
        self.rows().map(|row| self.point(&row).expect("rows were checked"))
    }

    /// Makes every trial, point by point, the first of which has the index `first`. Replicate r has seed `base.seed + r`.
    pub(crate) fn trials(&self, first: u32, replicates: u32) -> impl Iterator<Item = Trial> + Send + '_ {
        self.batches().zip(0..).flat_map(move |(rows, batch)| {
            let made = rows.par_iter().map(|row| self.point(row).expect("rows were checked"));
            let made: Vec<Point> = made.collect();
            made.into_iter().zip(first + batch * BATCH as u32..).flat_map(
                move |(Point { levels, scenario }, point)| {
                    let mut levels = Some(levels);
                    (0..replicates).map(move |number| Trial {
                        point,
                        replicate: number,
                        scenario: replicate(&scenario, number, self.posterior.as_ref()),
                        levels: levels.take(),
                    })
                },
            )
        })
    }

    /// Checks every point with as many replicates; the first has the index `first`. Returns the seconds that all take together, or every fault.
    /// Faults outside all factors have pointers under `base_at`.
    pub(super) fn check(
        &self,
        (meshes, limits): (&Meshes, &roost_solver::Limits),
        (first, replicates): (usize, u32),
        base_at: &str,
        place_of: Place,
    ) -> Result<f64, Vec<Fault>> {
        let check = |row: &Row| {
            let Point { levels, scenario } = self.point(row)?;
            let drawn = self.posterior.as_ref().map_or(Ok(()), |samples| {
                samples.check(&scenario, 0..samples.used(replicates), (meshes, limits))
            });
            drawn
                .and_then(|()| mesh::check(&scenario, meshes, limits))
                .map(|estimate| estimate.wall_s)
                .map_err(|found| (levels, found))
        };
        let checked = self.batches().flat_map(|rows| {
            let checked: Vec<_> = rows.par_iter().map(check).collect();
            rows.into_iter().zip(checked)
        });
        let (mut wall_s, mut faults, mut seen) = (0.0, Vec::new(), BTreeSet::new());
        for (index, (row, checked)) in checked.enumerate() {
            if faults.len() == MAX_FAULTS {
                break;
            }
            let (levels, found) = match checked {
                Ok(point_s) => {
                    wall_s += point_s;
                    continue;
                }
                Err(found) => found,
            };
            for found in found {
                let (pointer, row_key) = match self.factor_at(&row, &found.pointer) {
                    Some((factor, value, inner)) => {
                        let place = place_of(index, factor, value);
                        // A table is one text: its faults differ by their rows.
                        let row_key = if place.ends_with("/table") { Some(index) } else { None };
                        let inner = if row_key.is_some() { "" } else { inner };
                        (format!("{place}{inner}"), row_key)
                    }
                    None if found.pointer.starts_with("/posterior/") => (found.pointer.clone(), None),
                    None => (format!("{base_at}{}", found.pointer), None),
                };
                if faults.len() < MAX_FAULTS && seen.insert((pointer.clone(), row_key)) {
                    let (point, levels) = (first + index, Value::Object(levels.clone()));
                    let detail = format!("{} (design point {point}: {levels})", found.detail);
                    faults.push(Fault { pointer, detail, ..found });
                }
            }
        }
        if faults.is_empty() { Ok(wall_s) } else { Err(faults) }
    }

    /// The point of a row, or its levels and their faults.
    fn point(&self, row: &Row) -> Result<Point, (Map<String, Value>, Vec<Fault>)> {
        let mut document = self.base.clone();
        let mut levels = Map::new();
        for (factor, value) in self.factors.iter().zip(row) {
            let Some(value) = value else { continue };
            for field in &factor.fields {
                pointer::set(&mut document, &self.complete, field, value);
            }
            levels.insert(factor.name().to_owned(), value.clone());
        }
        let scenario = match scenario::from_value(&document) {
            Ok(scenario) => scenario,
            Err(found) => return Err((levels, found)),
        };
        // A factor that stays as in the base may follow a default that another factor chooses.
        if levels.len() < self.factors.len() {
            let complete = json!(scenario);
            for factor in &self.factors {
                let value = || complete.pointer(factor.name()).cloned().unwrap_or_default();
                levels.entry(factor.name()).or_insert_with(value);
            }
        }
        Ok(Point { levels, scenario })
    }

    /// The factor whose field holds a pointer, its value in the row, and the rest of the pointer within the value.
    fn factor_at<'a, 'f>(&self, row: &'a Row, pointer: &'f str) -> Option<(usize, &'a Value, &'f str)> {
        self.factors.iter().zip(row).enumerate().find_map(|(index, (factor, value))| {
            let field = factor.fields.iter().find(|field| pointer::is_within(pointer, field))?;
            Some((index, value.as_ref()?, &pointer[field.len()..]))
        })
    }
}
