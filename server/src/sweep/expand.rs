//! From the specification to the design points: every one validated, every fault listed.

use std::collections::BTreeSet;

use rayon::prelude::*;
use roost_api::Fault;
use roost_api::sweep::{SCHEMA, SweepSpec};
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario, fields};
use serde_json::{Map, Value, json};

use super::matrix::{self, Row};
use super::plan::{self, Plan};
use super::{Expansion, Point, SweepLimits, factor, levels, rows};
use crate::document::{fault, prefixed, running_faults};
use crate::mesh;

/// Past so many faults the rest says nothing new.
const MAX_FAULTS: usize = 100;

/// Expands a sweep, or lists every fault with pointers into its document.
pub(crate) fn expand(
    spec: &SweepSpec,
    meshes: &Meshes,
    limits: SweepLimits,
) -> Result<Expansion, Vec<Fault>> {
    let mut faults = Vec::new();
    let base = scenario::from_value(&spec.base).map_err(|found| faults.extend(prefixed("/base", found))).ok();
    let complete = base.as_ref().map(|base| json!(base));
    check_words(spec, &mut faults);
    let plan = plan::plan(spec, complete.as_ref(), &mut faults);
    check_replicates(spec.replicates, &mut faults);
    if let Some(plan) = &plan {
        let jobs = matrix::size(plan).and_then(|points| points.checked_mul(spec.replicates.into()));
        check_jobs("/factors", jobs, limits, &mut faults);
    }
    if let Some(base) = &base {
        check_seeds("/replicates", spec.replicates, base.seed, spec.replicates, &mut faults);
    }
    if !faults.is_empty() {
        levels::check(&spec.factors, &mut faults);
    }
    let (Some(base), Some(plan), true) = (base, plan, faults.is_empty()) else { return Err(faults) };

    let estimate = mesh::check(&base, meshes, &limits.scenario).map_err(|found| prefixed("/base", found))?;
    let matrix = matrix::rows(&plan);
    let placed = |row: usize, factor: usize, value: &Value| place_in_spec(spec, row, factor, value);
    let points = Bench { base: &spec.base, scenario: &base, plan: &plan, meshes, limits }
        .points(&matrix, 0, "/base", &placed)?;
    let factors = plan.factors.iter().map(|input| input.name().to_owned()).collect();
    Ok(Expansion { factors, points, replicates: spec.replicates, base, estimate })
}

fn check_words(spec: &SweepSpec, faults: &mut Vec<Fault>) {
    if let Some(schema) = spec.schema.as_deref().filter(|schema| *schema != SCHEMA) {
        faults.push(fault("/schema", json!(schema), "unknown schema", SCHEMA));
    }
    if spec.name.trim().is_empty() {
        faults.push(fault("/name", json!(spec.name), "a sweep needs a name", "some text"));
    }
    faults.extend(running_faults(spec.max_wall_s, spec.frame_interval_s));
}

fn check_replicates(replicates: u32, faults: &mut Vec<Fault>) {
    if replicates == 0 {
        faults.push(fault("/replicates", json!(0), "a point runs at least once", "1 or more"));
    }
}

/// Looks whether so many jobs are allowed.
pub(super) fn check_jobs(at: &str, jobs: Option<u64>, limits: SweepLimits, faults: &mut Vec<Fault>) {
    if jobs.is_none_or(|jobs| jobs > limits.max_jobs) {
        let detail = match jobs {
            Some(jobs) => format!("the sweep would make {jobs} jobs"),
            None => "the sweep would make more jobs than can be counted".to_owned(),
        };
        let allowed = format!("at most {} jobs (max_jobs_per_sweep)", limits.max_jobs);
        faults.push(fault(at, json!(jobs), &detail, &allowed));
    }
}

/// Looks whether the last of so many replicates has a seed that a scenario may have.
pub(super) fn check_seeds(at: &str, asked: u32, base_seed: u64, replicates: u32, faults: &mut Vec<Fault>) {
    let last = base_seed.saturating_add(u64::from(replicates.max(1)) - 1);
    let Some(seed) = fields::find("/seed") else { return };
    if !levels::fits(seed, &json!(last)) {
        let detail = format!("the last replicate would run with seed {last}");
        let allowed = format!("base.seed + replicates - 1: {}", seed.allowed());
        faults.push(fault(at, json!(asked), &detail, &allowed));
    }
}

/// Where in a specification the value of a factor stands at a point.
fn place_in_spec(spec: &SweepSpec, row: usize, index: usize, value: &Value) -> String {
    if spec.design.rows.is_some() {
        return format!("/design/rows/{row}/{index}");
    }
    if spec.design.table.is_some() {
        return "/design/table".to_owned();
    }
    let levels = spec.factors.get(index).and_then(|factor| factor.levels.as_ref());
    match levels.and_then(|levels| rows::place(value, levels)) {
        Some(level) => format!("/factors/{index}/levels/{level}"),
        None => format!("/factors/{index}"),
    }
}

/// What points are made of.
pub(super) struct Bench<'a> {
    /// The base as submitted.
    pub(super) base: &'a Value,
    /// The base, complete.
    pub(super) scenario: &'a Scenario,
    pub(super) plan: &'a Plan,
    pub(super) meshes: &'a Meshes,
    pub(super) limits: SweepLimits,
}

impl Bench<'_> {
    /// The design points of a matrix whose first row has the index `first`, all valid. `placed` says where in the document
    /// the value of a factor stands in a row of the matrix; what no value is to blame for lies under `rest`.
    pub(super) fn points(
        &self,
        matrix: &[Row],
        first: usize,
        rest: &str,
        placed: &dyn Fn(usize, usize, &Value) -> String,
    ) -> Result<Vec<Point>, Vec<Fault>> {
        let complete = json!(self.scenario);
        let mut points = Vec::with_capacity(matrix.len());
        let mut faults = Vec::new();
        let mut seen = BTreeSet::new();
        let read: Vec<_> = matrix.par_iter().map(|row| self.point(&complete, row)).collect();
        for (index, (row, read)) in matrix.iter().zip(read).enumerate() {
            match read {
                Ok(point) => points.push(point),
                Err((levels, found)) => {
                    for found in found {
                        let blamed = self.blamed(row, &found.pointer);
                        let (pointer, told) = match blamed {
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
                            let point = first + index;
                            let detail = format!(
                                "{} (design point {point}: {})",
                                found.detail,
                                Value::Object(levels.clone())
                            );
                            faults.push(Fault { pointer, detail, ..found });
                        }
                    }
                }
            }
        }
        if faults.is_empty() { Ok(points) } else { Err(faults) }
    }

    /// One point, or its levels and what is wrong with them.
    fn point(&self, complete: &Value, row: &Row) -> Result<Point, (Map<String, Value>, Vec<Fault>)> {
        let mut document = self.base.clone();
        let mut levels = Map::new();
        for (input, value) in self.plan.factors.iter().zip(row) {
            let Some(value) = value else { continue };
            for field in &input.fields {
                factor::set(&mut document, complete, field, value);
            }
            levels.insert(input.name().to_owned(), value.clone());
        }
        let valid = scenario::from_value(&document).and_then(|scenario| {
            mesh::check(&scenario, self.meshes, &self.limits.scenario).map(|_| scenario)
        });
        let scenario = match valid {
            Ok(scenario) => scenario,
            Err(found) => return Err((levels, found)),
        };
        // What stays as in the base may follow defaults that other factors choose: the scenario knows.
        if levels.len() < self.plan.factors.len() {
            let complete = json!(scenario);
            for input in &self.plan.factors {
                let value = || complete.pointer(input.name()).cloned().unwrap_or_default();
                levels.entry(input.name()).or_insert_with(value);
            }
        }
        Ok(Point { levels, scenario })
    }

    /// The factor whose field a fault lies in, its value in the row, and the rest of the pointer inside that.
    fn blamed<'a, 'f>(&self, row: &'a Row, pointer: &'f str) -> Option<(usize, &'a Value, &'f str)> {
        self.plan.factors.iter().zip(row).enumerate().find_map(|(index, (input, value))| {
            let field = input.fields.iter().find(|field| factor::inside(pointer, field))?;
            Some((index, value.as_ref()?, &pointer[field.len()..]))
        })
    }
}
