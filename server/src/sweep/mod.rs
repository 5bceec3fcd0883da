//! Sweeps, without IO: from the specification to design points and trials, and from trials to tables and effects.
//!
//! - `plan` reads factors (`factor_pointers`, `factor_values`, `levels`, `values`) and the design.
//! - `designs` has a file per kind of design, behind one trait; `points` makes scenarios of their rows (`pointer`),
//!   with parameters from a `posterior`.
//! - `expand` validates a sweep and lists every fault; `extend` does the same for an extension.
//! - `summary`, `effects`, `differences` (both by `replicates`) and `table` evaluate trials; `units` has the units of a table's columns.

mod designs;
mod differences;
mod effects;
mod expand;
mod extend;
mod factor_pointers;
mod factor_values;
mod levels;
mod plan;
mod pointer;
mod points;
mod posterior;
mod replicates;
mod schema;
mod summary;
mod table;
#[cfg(test)]
mod tests;
mod to_parquet;
mod units;
mod values;

use roost_api::sweep::SweepSpec;
use roost_api::{Estimate, Fault};
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::Scenario;
use serde_json::Value;

use crate::document::{MAX_FAULTS, read_leniently};
pub(crate) use designs::factors;
pub(crate) use differences::differences;
pub(crate) use effects::{Effects, MAX_EFFECTS_BYTES};
use expand::expand;
pub(crate) use extend::{AddedPoints, StoredSweep, check_samples, extend, replicate};
pub(crate) use factor_values::is_whole;
pub(crate) use points::{Point, Points, Trial};
pub use posterior::posterior_columns;
pub(crate) use posterior::{Posterior, runs_per_sample};
pub(crate) use schema::json_schema;
pub(crate) use summary::by_point;
pub(crate) use table::{Column, SweepResponse, csv, of_points, of_trials, text};
pub(crate) use to_parquet::to_parquet;
pub(crate) use units::{headline_first, unit_of};

/// Reads a sweep and expands it, or lists the faults of its shape and its content.
pub(crate) fn read(
    document: Value,
    meshes: &Meshes,
    limits: SweepLimits,
) -> Result<(SweepSpec, Expansion), Vec<Fault>> {
    let (spec, mut faults) = read_leniently::<SweepSpec>(document);
    let Some(spec) = spec else { return Err(faults) };
    // Past the maximum, placeholders are in places that no listed fault names.
    if faults.len() >= MAX_FAULTS {
        return Err(faults);
    }
    match expand(&spec, meshes, limits) {
        Ok(expansion) if faults.is_empty() => Ok((spec, expansion)),
        Ok(_) => Err(faults),
        Err(found) => {
            // A placeholder has no faults of its own. What a design takes depends on its kind.
            let mut listed: Vec<_> = faults.iter().map(|fault| fault.pointer.clone()).collect();
            if listed.iter().any(|pointer| pointer == "/design/kind") {
                listed.push("/design".to_owned());
            }
            let is_new = |fault: &Fault| !listed.iter().any(|other| pointer::overlap(&fault.pointer, other));
            faults.extend(found.into_iter().filter(is_new));
            Err(faults)
        }
    }
}

/// Limits of sweeps, set by the operator.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SweepLimits {
    /// Jobs of one sweep.
    pub max_jobs: u64,
    /// Cost of each scenario.
    pub scenario: Limits,
}

/// An expanded sweep.
#[derive(Clone, Debug)]
pub(crate) struct Expansion {
    /// Pointers of the factors, in the order of the specification.
    pub factors: Vec<String>,
    /// The design points; their indices never change.
    pub points: Points,
    /// Replicates per point.
    pub replicates: u32,
    /// The base scenario, complete.
    pub base: Scenario,
    /// Its cost.
    pub estimate: Estimate,
    /// The estimated time of all jobs, one after the other.
    pub wall_s: f64,
}

impl Expansion {
    /// How many jobs it makes.
    pub(crate) fn jobs(&self) -> u64 {
        self.points.len() as u64 * u64::from(self.replicates)
    }
}
