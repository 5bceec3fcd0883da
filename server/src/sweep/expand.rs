//! From the specification to the design points: every one validated, every fault listed.

use std::collections::BTreeSet;

use roost_api::Fault;
use roost_api::sweep::{SCHEMA, SweepSpec};
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario, fields};
use serde_json::{Map, Value, json};

use super::levels::{self, same};
use super::{Expansion, Point, SweepLimits, design, factor};
use crate::document::wall_time_fault;
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
    let base = match scenario::from_value(&spec.base) {
        Ok(base) => Some(base),
        Err(found) => {
            faults.extend(found.into_iter().map(|fault| prefixed("/base", fault)));
            None
        }
    };
    check_words(spec, &mut faults);
    check_factors(spec, base.as_ref(), &mut faults);
    check_size(spec, limits, &mut faults);
    if let Some(base) = &base {
        check_seeds(spec, base, &mut faults);
    }
    if !faults.is_empty() {
        levels::check(spec, &mut faults);
    }
    let (Some(base), true) = (base, faults.is_empty()) else { return Err(faults) };

    let estimate = mesh::check(&base, meshes, &limits.scenario)
        .map_err(|found| found.into_iter().map(|fault| prefixed("/base", fault)).collect::<Vec<_>>())?;
    let points = points(spec, &base, meshes, limits)?;
    let factors = spec.factors.iter().map(|factor| factor.pointer.clone()).collect();
    Ok(Expansion { factors, points, replicates: spec.replicates, base, estimate })
}

fn fault(
    pointer: impl Into<String>,
    value: Value,
    detail: impl Into<String>,
    allowed: Option<String>,
) -> Fault {
    Fault { pointer: pointer.into(), value, detail: detail.into(), allowed }
}

fn prefixed(prefix: &str, fault: Fault) -> Fault {
    Fault { pointer: format!("{prefix}{}", fault.pointer), ..fault }
}

fn check_words(spec: &SweepSpec, faults: &mut Vec<Fault>) {
    if let Some(schema) = spec.schema.as_deref().filter(|schema| *schema != SCHEMA) {
        faults.push(fault("/schema", json!(schema), "unknown schema", Some(SCHEMA.to_owned())));
    }
    if spec.name.trim().is_empty() {
        faults.push(fault("/name", json!(spec.name), "a sweep needs a name", Some("some text".to_owned())));
    }
    faults.extend(wall_time_fault(spec.max_wall_s));
}

fn check_factors(spec: &SweepSpec, base: Option<&Scenario>, faults: &mut Vec<Fault>) {
    let complete = base.map(|base| json!(base));
    for (index, factor) in spec.factors.iter().enumerate() {
        let at = format!("/factors/{index}/pointer");
        let pointer = factor.pointer.as_str();
        if factor::segments(pointer).is_none() {
            let allowed =
                Some("a JSON pointer into the scenario, such as /equipment/gate_opening_m".to_owned());
            faults.push(fault(&at, json!(pointer), "not a JSON pointer", allowed));
        } else if pointer == "/seed" || pointer == "/schema" {
            let detail = format!("`{pointer}` cannot be a factor; more seeds are what `replicates` is for");
            faults.push(fault(&at, json!(pointer), detail, None));
        } else if complete.as_ref().is_some_and(|complete| complete.pointer(pointer).is_none()) {
            let allowed = scenario::nearest(pointer).map(|nearest| format!("did you mean {nearest}?"));
            faults.push(fault(&at, json!(pointer), "the scenario has no such field", allowed));
        }
        let earlier = &spec.factors[..index];
        if let Some(other) = earlier.iter().position(|other| {
            factor::segments(&other.pointer).is_some() && factor::overlap(&other.pointer, pointer)
        }) {
            let detail = format!("factor {other} varies the same field");
            faults.push(fault(&at, json!(pointer), detail, None));
        }
        let at = format!("/factors/{index}/levels");
        if factor.levels.is_empty() {
            faults.push(fault(
                &at,
                json!([]),
                "a factor needs levels",
                Some("at least one value".to_owned()),
            ));
        }
        for (level, value) in factor.levels.iter().enumerate() {
            if factor.levels[..level].iter().any(|other| same(other, value)) {
                let detail = "the level is listed twice; more runs of a point are what `replicates` is for";
                faults.push(fault(format!("{at}/{level}"), value.clone(), detail, None));
            }
        }
    }
}

fn check_size(spec: &SweepSpec, limits: SweepLimits, faults: &mut Vec<Fault>) {
    if spec.replicates == 0 {
        faults.push(fault(
            "/replicates",
            json!(0),
            "a point runs at least once",
            Some("1 or more".to_owned()),
        ));
    }
    let levels: Vec<_> = spec.factors.iter().map(|factor| factor.levels.len()).collect();
    let jobs = design::size(&spec.design, &levels).and_then(|n| n.checked_mul(spec.replicates.into()));
    if jobs.is_none_or(|jobs| jobs > limits.max_jobs) {
        let detail = match jobs {
            Some(jobs) => format!("the sweep would make {jobs} jobs"),
            None => "the sweep would make more jobs than can be counted".to_owned(),
        };
        let allowed = Some(format!("at most {} jobs (max_jobs_per_sweep)", limits.max_jobs));
        faults.push(fault("/factors", json!(jobs), detail, allowed));
    }
}

fn check_seeds(spec: &SweepSpec, base: &Scenario, faults: &mut Vec<Fault>) {
    let last = base.seed.saturating_add(u64::from(spec.replicates.max(1)) - 1);
    let Some(seed) = fields::find("/seed") else { return };
    if !levels::fits(seed, &json!(last)) {
        let detail = format!("the last replicate would run with seed {last}");
        let allowed = Some(format!("base.seed + replicates - 1: {}", seed.allowed()));
        faults.push(fault("/replicates", json!(spec.replicates), detail, allowed));
    }
}

fn points(
    spec: &SweepSpec,
    base: &Scenario,
    meshes: &Meshes,
    limits: SweepLimits,
) -> Result<Vec<Point>, Vec<Fault>> {
    let complete = json!(base);
    let counts: Vec<_> = spec.factors.iter().map(|factor| factor.levels.len()).collect();
    let size = design::size(&spec.design, &counts).unwrap_or(0);
    let mut points = Vec::new();
    let mut faults = Vec::new();
    let mut seen = BTreeSet::new();
    for index in 0..size {
        let chosen = design::level_indices(&spec.design, &counts, index);
        let mut document = spec.base.clone();
        let mut levels = Map::new();
        for (factor, level) in spec.factors.iter().zip(&chosen) {
            factor::set(&mut document, &complete, &factor.pointer, &factor.levels[*level]);
            levels.insert(factor.pointer.clone(), factor.levels[*level].clone());
        }
        let valid = scenario::from_value(&document)
            .and_then(|scenario| mesh::check(&scenario, meshes, &limits.scenario).map(|_| scenario));
        match valid {
            Ok(scenario) => points.push(Point { levels, scenario }),
            Err(found) => {
                for found in found {
                    let told = point_fault(spec, &chosen, index, &levels, found);
                    if faults.len() < MAX_FAULTS && seen.insert(told.pointer.clone()) {
                        faults.push(told);
                    }
                }
            }
        }
    }
    if faults.is_empty() { Ok(points) } else { Err(faults) }
}

/// Says a design point's fault in terms of the sweep: the level to blame where the fault lies in a factor's
/// field, else the base field with the point that it does not go with.
fn point_fault(
    spec: &SweepSpec,
    chosen: &[usize],
    index: u64,
    levels: &Map<String, Value>,
    found: Fault,
) -> Fault {
    let blamed = spec.factors.iter().position(|factor| factor::inside(&found.pointer, &factor.pointer));
    let detail = format!("{} (design point {index}: {})", found.detail, Value::Object(levels.clone()));
    match blamed {
        Some(factor) => {
            let rest = found.pointer[spec.factors[factor].pointer.len()..].to_owned();
            let pointer = format!("/factors/{factor}/levels/{}{rest}", chosen[factor]);
            Fault { pointer, detail, ..found }
        }
        None => Fault { pointer: format!("/base{}", found.pointer), detail, ..found },
    }
}
