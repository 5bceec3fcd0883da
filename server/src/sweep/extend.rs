//! Extending a sweep: more points of its design, more replicates. Points that are there keep their indices.

use std::collections::BTreeMap;

use roost_api::Fault;
use roost_api::design::{DesignKind, Extension};
use roost_api::sweep::SweepSpec;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario, escape};
use serde_json::{Map, Value, json};

use super::matrix::{self, Row};
use super::plan::{self, Plan, Points};
use super::points::Points as DesignPoints;
use super::values::Values;
use super::{SweepLimits, expand, inputs, rows};
use crate::document::{fault, read_leniently};

/// A sweep as it is kept.
#[derive(Clone, Debug)]
pub(crate) struct Stored {
    /// As submitted.
    pub spec: SweepSpec,
    /// Levels of each design point, by index.
    pub matrix: Vec<Map<String, Value>>,
    /// Replicates of each.
    pub replicates: u32,
}

/// What is added to a sweep.
#[derive(Clone, Debug)]
pub(crate) struct Growth {
    /// New points, whose indices follow those that are there.
    pub points: DesignPoints,
    /// Replicates of every point from now on.
    pub replicates: u32,
}

/// Reads an extension of a sweep and expands what is new, or lists every fault with pointers into the extension.
pub(crate) fn extend(
    stored: &Stored,
    document: Value,
    meshes: &Meshes,
    limits: SweepLimits,
) -> Result<Growth, Vec<Fault>> {
    let (extension, mut faults) = read_leniently::<Extension>(document);
    let Some(extension) = extension else { return Err(faults) };
    let unreadable = |found: Vec<Fault>| {
        let reason = found.first().map(ToString::to_string).unwrap_or_default();
        vec![fault(
            "",
            Value::Null,
            &format!("this server can no longer read the sweep's base: {reason}"),
            "",
        )]
    };
    let base = scenario::from_value(&stored.spec.base).map_err(unreadable)?;
    let complete = json!(base);
    let mut plan = plan::plan(&stored.spec, Some(&complete), &mut Vec::new()).ok_or_else(|| {
        vec![fault("", Value::Null, "this server can no longer read the sweep's design", "")]
    })?;

    check_fields(&extension, stored.spec.design.kind, &mut faults);
    let replicates = stored.replicates.saturating_add(extension.replicates.unwrap_or(0));
    let at = if extension.replicates.is_some() { "/replicates" } else { "" };
    expand::check_seeds(at, extension.replicates.unwrap_or(0), base.seed, replicates, &mut faults);
    // Before anything is made of them: every value is a point at least.
    let levels = extension.levels.iter().flat_map(BTreeMap::values).map(Vec::len).sum::<usize>() as u64;
    let asked = u64::from(extension.points.unwrap_or(0)) + levels;
    check_jobs(stored, Some(asked), replicates, limits, &mut faults);
    if !faults.is_empty() {
        return Err(faults);
    }
    let old = add_levels(stored, &mut plan, extension.levels.as_ref(), &complete, &mut faults);
    check_jobs(stored, matrix::added(&plan, &old), replicates, limits, &mut faults);
    if !faults.is_empty() {
        return Err(faults);
    }
    let matrix = new_rows(stored, &plan, &extension, &old, &mut faults);
    check_jobs(stored, Some(matrix.len() as u64), replicates, limits, &mut faults);
    if !faults.is_empty() {
        return Err(faults);
    }
    let placed = |row: usize, factor: usize, value: &Value| place(&extension, &plan, row, factor, value);
    let points = DesignPoints::new(&stored.spec.base, &base, &plan, matrix);
    points.check((meshes, &limits.scenario), stored.matrix.len(), "", &placed)?;
    Ok(Growth { points, replicates })
}

/// Looks whether so many more points are allowed; none is more than can be counted.
fn check_jobs(
    stored: &Stored,
    points: Option<u64>,
    replicates: u32,
    limits: SweepLimits,
    faults: &mut Vec<Fault>,
) {
    let points = points.and_then(|points| points.checked_add(stored.matrix.len() as u64));
    if faults.is_empty() {
        let jobs = points.and_then(|points| points.checked_mul(replicates.into()));
        expand::check_jobs("", jobs, limits, faults);
    }
}

/// The fields of an extension that add points to a design of that kind, or why nothing does.
fn takes(kind: DesignKind) -> Result<&'static [&'static str], &'static str> {
    match kind {
        DesignKind::Grid | DesignKind::OneAtATime => Ok(&["levels"]),
        DesignKind::Random | DesignKind::Sobol => Ok(&["points"]),
        DesignKind::List | DesignKind::Csv => Ok(&["rows", "table"]),
        DesignKind::LatinHypercube => {
            Err("each point of a Latin hypercube has its own part of every factor, and with more \
                                           points these would be other parts: submit a larger one, or use sobol")
        }
        DesignKind::BoxBehnken => {
            Err("a Box-Behnken design is complete: submit the points to add as a list of their own")
        }
    }
}

fn check_fields(extension: &Extension, kind: DesignKind, faults: &mut Vec<Fault>) {
    let taken = takes(kind);
    let given = [
        ("points", extension.points.map(|points| json!(points))),
        ("levels", extension.levels.as_ref().map(|levels| json!(levels))),
        ("rows", extension.rows.as_ref().map(|rows| json!(rows.len()))),
        ("table", extension.table.as_ref().map(|table| json!(table.len()))),
    ];
    let names = |names: &[&str]| format!("{}, replicates", names.join(", "));
    for (name, value) in given {
        let Some(value) = value else { continue };
        match taken {
            Err(reason) => faults.push(fault(&format!("/{name}"), value, reason, "more replicates")),
            Ok(taken) if !taken.contains(&name) => {
                let detail = format!("not how a design of the kind {kind} is extended");
                faults.push(fault(&format!("/{name}"), value, &detail, &names(taken)));
            }
            Ok(_) => {}
        }
    }
    for (name, number) in [("points", extension.points), ("replicates", extension.replicates)] {
        if number == Some(0) {
            faults.push(fault(&format!("/{name}"), json!(0), "nothing to add", "1 or more"));
        }
    }
    if *extension == Extension::default() && faults.is_empty() {
        let allowed = taken.map_or_else(|_| "replicates".to_owned(), names);
        faults.push(fault("", json!({}), "nothing to add", &allowed));
    }
}

/// The rows to add; of each factor of a design by levels, so many levels are old.
fn new_rows(
    stored: &Stored,
    plan: &Plan,
    extension: &Extension,
    old: &[usize],
    faults: &mut Vec<Fault>,
) -> Vec<Row> {
    let there = stored.matrix.len() as u64;
    let more = extension.points.unwrap_or(0);
    let end = there + u64::from(more);
    let range = there as u32..u32::try_from(end).unwrap_or(u32::MAX);
    match plan.points {
        Points::Random { seed, .. } => matrix::random(&plan.factors, range, seed),
        Points::Sobol { seed, .. } => {
            plan::check_sobol("/points", more, end, faults);
            if faults.is_empty() { matrix::sobol(&plan.factors, range, seed) } else { Vec::new() }
        }
        Points::Grid if matrix::added(plan, old) == Some(0) => Vec::new(),
        Points::Grid => matrix::grid(&plan.factors, old),
        Points::OneAtATime => matrix::one_at_a_time(&plan.factors, old),
        Points::Rows(_) => added_rows(stored, plan, extension, faults)
            .into_iter()
            .map(|row| row.into_iter().map(Some).collect())
            .collect(),
        Points::LatinHypercube { .. } | Points::BoxBehnken => Vec::new(),
    }
}

/// Adds levels to the factors of a plan by levels, after those of earlier extensions; returns how many each had.
fn add_levels(
    stored: &Stored,
    plan: &mut Plan,
    added: Option<&BTreeMap<String, Vec<Value>>>,
    complete: &Value,
    faults: &mut Vec<Fault>,
) -> Vec<usize> {
    let names: Vec<String> = plan.factors.iter().map(|input| input.name().to_owned()).collect();
    for (name, levels) in added.into_iter().flatten() {
        let at = format!("/levels/{}", escape(name));
        if !names.contains(name) {
            faults.push(fault(&at, json!(name), "the sweep has no such factor", &names.join(", ")));
        }
        inputs::check_levels(&at, levels, faults);
    }
    let is_grid = match plan.points {
        Points::Grid => true,
        Points::OneAtATime => false,
        _ => return Vec::new(),
    };
    let mut old = Vec::new();
    for (input, name) in plan.factors.iter_mut().zip(&names) {
        let Values::Levels(levels) = &mut input.values else { continue };
        let base = complete.pointer(name).filter(|_| !is_grid);
        for value in stored.matrix.iter().filter_map(|point| point.get(name)) {
            // What one factor chooses as default of another is no level of that one, nor is the base.
            if is_grid && rows::place(value, levels).is_none() {
                levels.push(value.clone());
            }
        }
        old.push(levels.len());
        for (index, value) in added.and_then(|added| added.get(name)).into_iter().flatten().enumerate() {
            let is_there = rows::place(value, levels).is_some()
                || base.is_some_and(|base| super::levels::same(base, value))
                || (!is_grid && stored.matrix.iter().any(|point| only_varies(point, name, value, stored)));
            if is_there {
                let at = format!("/levels/{}/{index}", escape(name));
                faults.push(fault(&at, value.clone(), "the factor has this level already", "another value"));
            } else {
                levels.push(value.clone());
            }
        }
    }
    old
}

/// Whether a point of a one-at-a-time design has that value of that factor and the base's of all others.
fn only_varies(point: &Map<String, Value>, name: &str, value: &Value, stored: &Stored) -> bool {
    let is = |of: &Map<String, Value>, at: &str, value: &Value| {
        of.get(at).is_some_and(|there| super::levels::same(there, value))
    };
    let Some(base) = stored.matrix.first() else { return false };
    is(point, name, value) && base.iter().all(|(other, kept)| other == name || is(point, other, kept))
}

fn added_rows(
    stored: &Stored,
    plan: &Plan,
    extension: &Extension,
    faults: &mut Vec<Fault>,
) -> Vec<Vec<Value>> {
    let names: Vec<String> = plan.factors.iter().map(|input| input.name().to_owned()).collect();
    let row = |point: &Map<String, Value>| {
        names.iter().map(|name| point.get(name).cloned().unwrap_or_default()).collect::<Vec<_>>()
    };
    let there: Vec<_> = stored.matrix.iter().map(row).collect();
    let (at, added) = match (&extension.rows, &extension.table) {
        (Some(_), Some(table)) => {
            faults.push(fault("/table", json!(table.len()), "there are `rows` already", "one of the two"));
            return Vec::new();
        }
        (Some(rows), None) => ("/rows", rows.clone()),
        (None, Some(table)) => ("/table", rows::of_table("/table", table, &names, faults)),
        (None, None) => return Vec::new(),
    };
    if faults.is_empty() {
        rows::check(at, &added, names.len(), faults);
        rows::repeats(at, &added, &there, faults);
    }
    added
}

/// Where in an extension the value of a factor stands in a new row.
fn place(extension: &Extension, plan: &Plan, row: usize, factor: usize, value: &Value) -> String {
    if extension.rows.is_some() {
        return format!("/rows/{row}/{factor}");
    }
    if extension.table.is_some() {
        return "/table".to_owned();
    }
    let name = plan.factors[factor].name();
    let levels = extension.levels.as_ref().and_then(|levels| levels.get(name));
    match levels.and_then(|levels| rows::place(value, levels)) {
        Some(level) => format!("/levels/{}/{level}", escape(name)),
        None if extension.points.is_some() => "/points".to_owned(),
        None => "/levels".to_owned(),
    }
}

/// A scenario with the seed of a replicate.
pub(crate) fn replicate(first: &Scenario, replicate: u32) -> Scenario {
    let mut scenario = first.clone();
    scenario.seed += u64::from(replicate);
    scenario
}
