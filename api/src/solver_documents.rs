//! The schemas of the solver's documents, which the solver crate does not describe itself: it has no OpenAPI.
//! A test compares them with serialised documents.

use std::collections::BTreeMap;

use roost_solver::scenario;
use serde_json::{Value, json};
use utoipa::ToSchema;
use utoipa::openapi::schema::{Object, ObjectBuilder, Type};

#[cfg(test)]
mod tests;

/// The outcome of one simulation.
#[derive(ToSchema)]
#[schema(as = RunResult)]
pub(crate) struct RunResultSchema {
    /// Always `roost.result/1`.
    pub schema: String,
    /// Why the run ended.
    pub end_reason: EndReasonSchema,
    /// Where and why the physics diverged, when `end_reason` is `unstable`.
    pub instability: Option<InstabilitySchema>,
    /// Scalar results by name, units last in the name; null where not reached. Empty for a cancelled run.
    pub responses: BTreeMap<String, Value>,
    /// Sampled quantities.
    pub series: Vec<SeriesSchema>,
    /// Quantities over something other than time, such as stress over strain.
    #[schema(required = false)]
    pub curves: Vec<CurveSchema>,
    /// Conditions under which the result may mislead. Results of solver revision 14 and before lack them.
    #[schema(required = false)]
    pub warnings: Vec<WarningSchema>,
    /// The solver and its device.
    pub solver: SolverInfoSchema,
    /// The cost of the run.
    pub performance: PerformanceSchema,
    /// The scenario as run, every default written out.
    #[schema(schema_with = complete_scenario)]
    pub scenario: Value,
    /// blake3 of the canonical JSON of `scenario`, in hex.
    pub scenario_digest: String,
}

fn complete_scenario() -> Object {
    ObjectBuilder::new()
        .schema_type(Type::Object)
        .description(Some("The scenario as run, every default written out."))
        .examples(scenario::from_value(&json!({"experiment": "hopper"})).map(|scenario| json!(scenario)))
        .build()
}

/// A condition under which the result may mislead.
#[derive(ToSchema)]
#[schema(as = Warning)]
pub(crate) struct WarningSchema {
    /// Stable code, such as `escaped_mass`.
    pub code: String,
    /// The finding, with figures, and the advised action.
    pub message: String,
}

/// Why a run ended.
#[derive(ToSchema)]
#[schema(as = EndReason, rename_all = "snake_case")]
pub(crate) enum EndReasonSchema {
    Duration,
    Empty,
    Jammed,
    Done,
    FillNotAtRest,
    Unstable,
    Cancelled,
}

/// Where and why the physics diverged.
#[derive(ToSchema)]
#[schema(as = Instability)]
pub(crate) struct InstabilitySchema {
    /// Step number, counted from the start of the fill.
    pub step: u64,
    /// Belt time, in seconds.
    pub time_s: f64,
    /// The reason, in words.
    pub reason: String,
}

/// A sampled quantity over belt time.
#[derive(ToSchema)]
#[schema(as = Series)]
pub(crate) struct SeriesSchema {
    /// Name, such as `discharged_mass`.
    pub name: String,
    /// Unit, such as `kg`.
    pub unit: String,
    /// Belt times of the samples, in seconds.
    pub t_s: Vec<f64>,
    /// The samples, as many as times.
    pub values: Vec<f64>,
}

/// A quantity over something other than time.
#[derive(ToSchema)]
#[schema(as = Curve)]
pub(crate) struct CurveSchema {
    /// Name, such as `stress`.
    pub name: String,
    /// Unit, such as `Pa`.
    pub unit: String,
    /// The quantity along the curve, such as `strain` or `fillet`.
    pub over: String,
    /// Unit of that quantity.
    pub over_unit: String,
    /// Values of that quantity.
    pub x: Vec<f64>,
    /// The values, as many.
    pub values: Vec<f64>,
}

/// The solver and device of a result.
#[derive(ToSchema)]
#[schema(as = SolverInfo)]
pub(crate) struct SolverInfoSchema {
    /// Version of the solver crate.
    pub version: String,
    /// Its `SOLVER_REVISION`.
    pub revision: u32,
    /// Name of the backend, such as `cpu`.
    pub backend: String,
    /// The device, in words: processor and instruction set, or graphics adapter.
    pub device: String,
    /// Threads used.
    pub threads: u64,
    /// Time step used, in seconds.
    pub timestep_s: f64,
}

/// The cost of a run.
#[derive(ToSchema)]
#[schema(as = Performance)]
pub(crate) struct PerformanceSchema {
    /// Sub-particles at the start.
    pub subparticles: u64,
    /// Sub-particle updates really done (the bed empties).
    pub particle_steps: u64,
    /// Time steps done.
    pub steps: u64,
    /// Wall time, in seconds.
    pub wall_s: f64,
    /// Wall time per particle-step, in nanoseconds.
    pub ns_per_particle_step: f64,
}

/// The cost of a scenario, estimated without running it.
#[derive(ToSchema)]
#[schema(as = Estimate)]
pub(crate) struct EstimateSchema {
    /// Fillets.
    pub fillets: u64,
    /// Sub-particles.
    pub subparticles: u64,
    /// Bonds.
    pub bonds: u64,
    /// Mass of all fillets, in kilograms.
    pub mass_kg: f64,
    /// Time step that will be used, in seconds.
    pub timestep_s: f64,
    /// Largest stable time step without damping, 2/ω_max, in seconds.
    pub stable_timestep_s: f64,
    /// Time steps, an upper bound.
    pub steps: u64,
    /// Memory of the CPU backend, in bytes.
    pub memory_bytes: u64,
    /// Rough wall time on two cores, in seconds.
    pub wall_s: f64,
    /// Warnings.
    pub warnings: Vec<String>,
}

/// The progress of a run.
#[derive(ToSchema)]
#[schema(as = Progress)]
pub(crate) struct ProgressSchema {
    /// Filling the hopper (t < 0) or running the belt.
    pub phase: PhaseSchema,
    /// Belt time, in seconds; negative while filling, counted from the longest fill allowed.
    pub time_s: f64,
    /// Simulated seconds so far, fill included.
    pub simulated_s: f64,
    /// Estimated share of the run that is done, 0 to 1.
    pub fraction: f64,
    /// Sub-particles still in the simulation.
    pub subparticles: u64,
    /// Sub-particle updates done.
    pub particle_steps: u64,
    /// Wall time so far, in seconds.
    pub wall_s: f64,
    /// Mass that has passed the gate, in kilograms.
    pub discharged_kg: f64,
}

/// The two phases of a run.
#[derive(ToSchema)]
#[schema(as = Phase, rename_all = "snake_case")]
pub(crate) enum PhaseSchema {
    Fill,
    Process,
}
