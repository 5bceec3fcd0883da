//! Design points: rows of the matrix, each made into a scenario when it is wanted.
//!
//! A row takes some hundred bytes, a complete scenario thousands. So all rows are looked at first, and of a sweep that is sound
//! nothing but rows is kept: scenarios are made anew, point by point, while those before them are stored.

use std::collections::BTreeSet;

use rayon::prelude::*;
use roost_api::Fault;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario};
use serde_json::{Map, Value, json};

use super::extend::replicate;
use super::factor;
use super::matrix::Row;
use super::plan::{Input, Plan};
use crate::mesh;

/// Past so many faults the rest says nothing new.
const MAX_FAULTS: usize = 100;

/// Points whose scenarios are made together.
const AT_ONCE: usize = 250;

/// A design point.
#[derive(Clone, Debug)]
pub(crate) struct Point {
    /// Level by pointer.
    pub levels: Map<String, Value>,
    /// The scenario of replicate 0, complete.
    pub scenario: Scenario,
}

/// A run of a design point.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    /// Index of the point.
    pub point: u32,
    /// Number of the run.
    pub replicate: u32,
    /// With the seed of that run.
    pub scenario: Scenario,
    /// Levels of the point, with the first of its runs alone.
    pub levels: Option<Map<String, Value>>,
}

/// Design points, as the values that make them.
#[derive(Clone, Debug)]
pub(crate) struct Points {
    /// The base as submitted.
    base: Value,
    /// The base, complete.
    complete: Value,
    factors: Vec<Input>,
    rows: Vec<Row>,
}

/// Where in the document the value of a factor stands in a row of the matrix.
pub(super) type Placed<'a> = &'a dyn Fn(usize, usize, &Value) -> String;

impl Points {
    /// Points of a base as submitted and complete.
    pub(super) fn new(base: &Value, scenario: &Scenario, plan: &Plan, rows: Vec<Row>) -> Self {
        Self { base: base.clone(), complete: json!(scenario), factors: plan.factors.clone(), rows }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Makes every point, one after the other.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Point> {
        self.rows.iter().map(|row| self.point(row).expect("points are made of rows that were looked at"))
    }

    /// Makes every trial, point by point, the first of which has the index `first`. Replicate r has seed `base.seed + r`.
    pub(crate) fn into_trials(self, first: u32, replicates: u32) -> impl Iterator<Item = Trial> {
        (0..self.rows.len()).step_by(AT_ONCE).flat_map(move |from| {
            let rows = &self.rows[from..self.rows.len().min(from + AT_ONCE)];
            let made = rows.par_iter().map(|row| self.point(row).expect("rows were looked at"));
            let made: Vec<Point> = made.collect();
            made.into_iter().zip(first + from as u32..).flat_map(
                move |(Point { levels, scenario }, point)| {
                    let mut levels = Some(levels);
                    (0..replicates).map(move |number| Trial {
                        point,
                        replicate: number,
                        scenario: replicate(&scenario, number),
                        levels: levels.take(),
                    })
                },
            )
        })
    }

    /// Looks at every point, the first of which has the index `first`: the seconds that all take together, or every fault.
    /// What no value is to blame for lies under `rest`.
    pub(super) fn check(
        &self,
        (meshes, limits): (&Meshes, &roost_solver::Limits),
        first: usize,
        rest: &str,
        placed: Placed,
    ) -> Result<f64, Vec<Fault>> {
        let look = |row: &Row| {
            let Point { levels, scenario } = self.point(row)?;
            mesh::check(&scenario, meshes, limits)
                .map(|estimate| estimate.wall_s)
                .map_err(|found| (levels, found))
        };
        let looked: Vec<_> = self.rows.par_iter().map(look).collect();
        let (mut wall_s, mut faults, mut seen) = (0.0, Vec::new(), BTreeSet::new());
        for (index, (row, looked)) in self.rows.iter().zip(looked).enumerate() {
            let (levels, found) = match looked {
                Ok(point_s) => {
                    wall_s += point_s;
                    continue;
                }
                Err(wrong) => wrong,
            };
            for found in found {
                let (pointer, told) = match self.blamed(row, &found.pointer) {
                    Some((factor, value, inner)) => {
                        let place = placed(index, factor, value);
                        // A table is one text: its faults differ by their rows.
                        let told = if place.ends_with("/table") { Some(index) } else { None };
                        let inner = if told.is_some() { "" } else { inner };
                        (format!("{place}{inner}"), told)
                    }
                    None => (format!("{rest}{}", found.pointer), None),
                };
                if faults.len() < MAX_FAULTS && seen.insert((pointer.clone(), told)) {
                    let (point, levels) = (first + index, Value::Object(levels.clone()));
                    let detail = format!("{} (design point {point}: {levels})", found.detail);
                    faults.push(Fault { pointer, detail, ..found });
                }
            }
        }
        if faults.is_empty() { Ok(wall_s) } else { Err(faults) }
    }

    /// The point of a row, or its levels and what is wrong with them.
    fn point(&self, row: &Row) -> Result<Point, (Map<String, Value>, Vec<Fault>)> {
        let mut document = self.base.clone();
        let mut levels = Map::new();
        for (input, value) in self.factors.iter().zip(row) {
            let Some(value) = value else { continue };
            for field in &input.fields {
                factor::set(&mut document, &self.complete, field, value);
            }
            levels.insert(input.name().to_owned(), value.clone());
        }
        let scenario = match scenario::from_value(&document) {
            Ok(scenario) => scenario,
            Err(found) => return Err((levels, found)),
        };
        // What stays as in the base may follow defaults that other factors choose: the scenario knows.
        if levels.len() < self.factors.len() {
            let complete = json!(scenario);
            for input in &self.factors {
                let value = || complete.pointer(input.name()).cloned().unwrap_or_default();
                levels.entry(input.name()).or_insert_with(value);
            }
        }
        Ok(Point { levels, scenario })
    }

    /// The factor whose field a fault lies in, its value in the row, and the rest of the pointer inside that.
    fn blamed<'a, 'f>(&self, row: &'a Row, pointer: &'f str) -> Option<(usize, &'a Value, &'f str)> {
        self.factors.iter().zip(row).enumerate().find_map(|(index, (input, value))| {
            let field = input.fields.iter().find(|field| factor::is_within(pointer, field))?;
            Some((index, value.as_ref()?, &pointer[field.len()..]))
        })
    }
}
