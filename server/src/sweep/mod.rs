//! Sweeps, without IO: from the specification to design points and trials, and from trials to tables and effects.
//!
//! `plan` reads factors and design, `names` what factors point at, `inputs` what values they take, `rows` lists of points; `matrix` combines values to points, with
//! the numbers of `draw` and `values`; `factor` puts a level into a scenario, `levels` judges one by itself; `points`
//! makes scenarios of rows; `expand` validates a sweep and lists every fault, `extend` does so for what is added. `summary` and `effects` say what came out.

mod draw;
mod effects;
mod expand;
mod extend;
mod factor;
mod inputs;
mod levels;
mod matrix;
mod names;
mod plan;
mod points;
mod rows;
mod schema;
mod summary;
mod table;
#[cfg(test)]
mod tests;
mod to_parquet;
mod values;

use roost_api::sweep::SweepSpec;
use roost_api::{Estimate, Fault};
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::Scenario;
use serde_json::Value;

use crate::document::read_leniently;
pub(crate) use effects::Effects;
use expand::expand;
pub(crate) use extend::{Growth, Stored, extend, replicate};
pub(crate) use plan::factors;
pub(crate) use points::{Points, Trial};
pub(crate) use schema::json_schema;
pub(crate) use summary::by_point;
pub(crate) use table::{Column, Response, csv, of_points, of_trials};
pub(crate) use to_parquet::to_parquet;

/// Reads a sweep and expands it: the faults of its shape and those of its content, at once.
pub(crate) fn read(
    document: Value,
    meshes: &Meshes,
    limits: SweepLimits,
) -> Result<(SweepSpec, Expansion), Vec<Fault>> {
    let (spec, mut faults) = read_leniently::<SweepSpec>(document);
    let Some(spec) = spec else { return Err(faults) };
    match expand(&spec, meshes, limits) {
        Ok(expansion) if faults.is_empty() => Ok((spec, expansion)),
        Ok(_) => Err(faults),
        Err(found) => {
            // What stands in for a value at fault has no faults of its own.
            let told: Vec<_> = faults.iter().map(|fault| fault.pointer.clone()).collect();
            let news = |fault: &Fault| !told.iter().any(|told| factor::overlap(&fault.pointer, told));
            faults.extend(found.into_iter().filter(news));
            Err(faults)
        }
    }
}

/// What an operator allows a sweep to be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SweepLimits {
    /// Jobs of one sweep.
    pub max_jobs: u64,
    /// Cost of each scenario.
    pub scenario: Limits,
}

/// A sweep written out.
#[derive(Clone, Debug)]
pub(crate) struct Expansion {
    /// Pointers of the factors, in the order of the specification.
    pub factors: Vec<String>,
    /// The design points; their indices are for ever.
    pub points: Points,
    /// Runs per point.
    pub replicates: u32,
    /// The base scenario, complete.
    pub base: Scenario,
    /// Its cost.
    pub estimate: Estimate,
    /// The time of all jobs, one after the other, forecast as that of the base.
    pub wall_s: f64,
}

impl Expansion {
    /// How many jobs it makes.
    pub(crate) fn jobs(&self) -> u64 {
        self.points.len() as u64 * u64::from(self.replicates)
    }
}
