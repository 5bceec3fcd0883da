//! From the specification to the design points: every point is validated, every fault listed.

use roost_api::Fault;
use roost_api::sweep::{SCHEMA, SweepSpec};
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, fields};
use serde_json::{Value, json};

use super::levels::position;
use super::points::{Points, RowSource};
use super::posterior::{self, Posterior};
use super::{Expansion, SweepLimits, levels, plan};
use crate::document::{fault, label_faults, name_fault, prefixed, running_faults};
use crate::mesh;

/// Expands a sweep, or lists every fault with pointers into its document.
pub(crate) fn expand(
    spec: &SweepSpec,
    meshes: &Meshes,
    limits: SweepLimits,
) -> Result<Expansion, Vec<Fault>> {
    let mut faults = Vec::new();
    let base = scenario::from_value(&spec.base).map_err(|found| faults.extend(prefixed("/base", found))).ok();
    let complete = base.as_ref().map(|base| json!(base));
    check_envelope(spec, &mut faults);
    let plan = plan::plan(spec, complete.as_ref(), &mut faults);
    check_replicates(spec.replicates, &mut faults);
    if let Some(plan) = &plan {
        let points = plan.design.points(plan).count;
        let jobs = points.and_then(|points| points.checked_mul(spec.replicates.into()));
        check_jobs("/factors", jobs, limits, &mut faults);
    }
    if let Some(base) = &base {
        check_seeds("/replicates", spec.replicates, base.seed, spec.replicates, &mut faults);
    }
    if let Some(draws) = &spec.posterior {
        let varied: Vec<&str> = spec.factors.iter().flat_map(|factor| factor.fields()).collect();
        let found = posterior::faults(draws, complete.as_ref(), &varied);
        let posterior = Posterior::of(draws).filter(|_| found.is_empty());
        faults.extend(found);
        if let (Some(posterior), Some(base)) = (posterior, &base) {
            faults.extend(posterior::too_many("/replicates", spec.replicates, &posterior, spec.replicates));
            let all = posterior.check(base, 0..posterior.len(), (meshes, &limits.scenario));
            faults.extend(all.err().into_iter().flatten());
        }
    }
    if !faults.is_empty() {
        levels::check(&spec.factors, &mut faults);
    }
    let (Some(base), Some(plan), true) = (base, plan, faults.is_empty()) else { return Err(faults) };

    let estimate = mesh::check(&base, meshes, &limits.scenario).map_err(|found| prefixed("/base", found))?;
    let factors = plan.factors.iter().map(|factor| factor.name().to_owned()).collect();
    let points = Points::new(&spec.base, &base, plan.factors.clone(), RowSource::Plan(plan))
        .with_posterior(spec.posterior.as_ref().and_then(Posterior::of));
    let placed = |row: usize, factor: usize, value: &Value| place_in_spec(spec, row, factor, value);
    let once_s = points.check((meshes, &limits.scenario), (0, spec.replicates), "/base", &placed)?;
    let wall_s = once_s * f64::from(spec.replicates);
    Ok(Expansion { factors, points, replicates: spec.replicates, base, estimate, wall_s })
}

fn check_envelope(spec: &SweepSpec, faults: &mut Vec<Fault>) {
    if let Some(schema) = spec.schema.as_deref().filter(|schema| *schema != SCHEMA) {
        faults.push(fault("/schema", json!(schema), "unknown schema", SCHEMA));
    }
    if spec.name.trim().is_empty() {
        faults.push(fault("/name", json!(spec.name), "a sweep needs a name", "some text"));
    }
    faults.extend(name_fault("/name", &spec.name));
    faults.extend(running_faults(spec.max_wall_s, spec.frame_interval_s));
    faults.extend(label_faults(&spec.labels));
    faults.extend(spec.needs.backend.iter().filter_map(|name| name_fault("/needs/backend", name)));
}

fn check_replicates(replicates: u32, faults: &mut Vec<Fault>) {
    if replicates == 0 {
        faults.push(fault("/replicates", json!(0), "a point has at least one replicate", "1 or more"));
    }
}

/// Checks the number of jobs; `None` is past 2⁶⁴.
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

/// Checks the seed of the last replicate.
pub(super) fn check_seeds(at: &str, asked: u32, base_seed: u64, replicates: u32, faults: &mut Vec<Fault>) {
    let last = base_seed.saturating_add(u64::from(replicates.max(1)) - 1);
    let Some(seed) = fields::find("/seed") else { return };
    if !levels::fits(seed, &json!(last)) {
        let detail = format!("the last replicate would run with seed {last}");
        let allowed = format!("base.seed + replicates - 1: {}", seed.allowed());
        faults.push(fault(at, json!(asked), &detail, &allowed));
    }
}

/// The place in a specification that gives the value of a factor at a point.
fn place_in_spec(spec: &SweepSpec, row: usize, index: usize, value: &Value) -> String {
    if spec.design.rows.is_some() {
        return format!("/design/rows/{row}/{index}");
    }
    if spec.design.table.is_some() {
        return "/design/table".to_owned();
    }
    let levels = spec.factors.get(index).and_then(|factor| factor.levels.as_ref());
    match levels.and_then(|levels| position(value, levels)) {
        Some(level) => format!("/factors/{index}/levels/{level}"),
        None => format!("/factors/{index}"),
    }
}
