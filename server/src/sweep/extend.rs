//! Extending a sweep: more points of its design, more replicates. Existing points keep their indices.

use std::collections::BTreeMap;

use roost_api::Fault;
use roost_api::design::Extension;
use roost_api::sweep::SweepSpec;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario, escape};
use serde_json::{Map, Value, json};

use super::designs::Addition;
use super::designs::PlannedFactor;
use super::levels::position;
use super::plan;
use super::points::{Points, RowSource};
use super::posterior::{self, Posterior};
use super::{SweepLimits, expand};
use crate::document::{fault, read_leniently};

/// A sweep in the store.
#[derive(Clone, Debug)]
pub(crate) struct StoredSweep {
    /// As submitted.
    pub spec: SweepSpec,
    /// Levels of each design point, by index.
    pub points: Vec<Map<String, Value>>,
    /// Replicates of each.
    pub replicates: u32,
}

/// The expansion of an extension.
#[derive(Clone, Debug)]
pub(crate) struct AddedPoints {
    /// New points; their indices follow those of the sweep.
    pub points: Points,
    /// Replicates of every point from now on.
    pub replicates: u32,
}

/// Reads an extension of a sweep and expands it, or lists every fault with pointers into the extension.
pub(crate) fn extend(
    stored: &StoredSweep,
    document: Value,
    meshes: &Meshes,
    limits: SweepLimits,
) -> Result<AddedPoints, Vec<Fault>> {
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

    check_fields(&extension, plan.design.extension_fields(), &stored.spec, &mut faults);
    let replicates = stored.replicates.saturating_add(extension.replicates.unwrap_or(0));
    let at = if extension.replicates.is_some() { "/replicates" } else { "" };
    expand::check_seeds(at, extension.replicates.unwrap_or(0), base.seed, replicates, &mut faults);
    // Counted before the levels are compared: every level makes at least one point.
    let levels = extension.levels.iter().flat_map(BTreeMap::values).map(Vec::len).sum::<usize>() as u64;
    let asked = u64::from(extension.points.unwrap_or(0)) + levels;
    check_jobs(stored, Some(asked), replicates, limits, &mut faults);
    let posterior = stored.spec.posterior.as_ref().and_then(Posterior::of);
    if let Some(posterior) = &posterior {
        faults.extend(posterior::too_many(at, extension.replicates.unwrap_or(0), posterior, replicates));
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    let addition = Addition { extension: &extension, points: &stored.points, base: &complete };
    let factors = plan.factors.clone();
    let added = plan.design.extend(&mut plan, &addition, &mut faults);
    check_jobs(stored, added.count, replicates, limits, &mut faults);
    if !faults.is_empty() {
        return Err(faults);
    }
    let rows = added.rows.collect();
    let placed = |row: usize, factor: usize, value: &Value| place(&extension, &factors, row, factor, value);
    let points = Points::new(&stored.spec.base, &base, factors.clone(), RowSource::Rows(rows))
        .with_posterior(posterior);
    points.check((meshes, &limits.scenario), (stored.points.len(), replicates), "", &placed)?;
    Ok(AddedPoints { points, replicates })
}

/// Checks the samples that further replicates of existing points draw from a posterior. `firsts` are the scenarios of their first replicates.
pub(crate) fn check_samples(
    stored: &StoredSweep,
    replicates: u32,
    firsts: &[(u32, Scenario)],
) -> Result<(), Vec<Fault>> {
    let Some(posterior) = stored.spec.posterior.as_ref().and_then(Posterior::of) else { return Ok(()) };
    for index in posterior.used(stored.replicates)..posterior.used(replicates) {
        for (_, first) in firsts {
            posterior.applied(first, index)?;
        }
    }
    Ok(())
}

/// Checks the number of points that are added; `None` is past 2⁶⁴.
fn check_jobs(
    stored: &StoredSweep,
    points: Option<u64>,
    replicates: u32,
    limits: SweepLimits,
    faults: &mut Vec<Fault>,
) {
    let points = points.and_then(|points| points.checked_add(stored.points.len() as u64));
    if faults.is_empty() {
        let jobs = points.and_then(|points| points.checked_mul(replicates.into()));
        expand::check_jobs("", jobs, limits, faults);
    }
}

/// Checks which fields an extension gives. `accepted` are those that add points to the design, or the reason why none do.
fn check_fields(
    extension: &Extension,
    accepted: Result<&[&str], &str>,
    spec: &SweepSpec,
    faults: &mut Vec<Fault>,
) {
    let kind = spec.design.kind;
    let given = [
        ("points", extension.points.map(|points| json!(points))),
        ("levels", extension.levels.as_ref().map(|levels| json!(levels))),
        ("rows", extension.rows.as_ref().map(|rows| json!(rows.len()))),
        ("table", extension.table.as_ref().map(|table| json!(table.len()))),
    ];
    let names = |names: &[&str]| format!("{}, replicates", names.join(", "));
    for (name, value) in given {
        let Some(value) = value else { continue };
        match accepted {
            Err(reason) => faults.push(fault(&format!("/{name}"), value, reason, "more replicates")),
            Ok(fields) if !fields.contains(&name) => {
                let detail = format!("a design of the kind {kind} is not extended by this field");
                faults.push(fault(&format!("/{name}"), value, &detail, &names(fields)));
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
        let allowed = accepted.map_or_else(|_| "replicates".to_owned(), names);
        faults.push(fault("", json!({}), "nothing to add", &allowed));
    }
}

/// The place in an extension that gives the value of a factor in a new row.
fn place(
    extension: &Extension,
    factors: &[PlannedFactor],
    row: usize,
    factor: usize,
    value: &Value,
) -> String {
    if extension.rows.is_some() {
        return format!("/rows/{row}/{factor}");
    }
    if extension.table.is_some() {
        return "/table".to_owned();
    }
    let name = factors[factor].name();
    let levels = extension.levels.as_ref().and_then(|levels| levels.get(name));
    match levels.and_then(|levels| position(value, levels)) {
        Some(level) => format!("/levels/{}/{level}", escape(name)),
        None if extension.points.is_some() => "/points".to_owned(),
        None => "/levels".to_owned(),
    }
}

/// A scenario with the seed of a replicate, and with its parameters; these were checked.
pub(crate) fn replicate(first: &Scenario, replicate: u32, posterior: Option<&Posterior>) -> Scenario {
    let drawn = posterior.map(|samples| samples.applied(first, samples.index(replicate)));
    let mut scenario = drawn.map_or_else(|| first.clone(), |drawn| drawn.expect("samples were checked"));
    scenario.seed += u64::from(replicate);
    scenario
}
