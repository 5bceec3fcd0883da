//! The result document `roost.result/1`, estimates and progress.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::scenario::{self, Scenario};

/// Changes with every change of a result: a bit of the simulation, or the meaning of a response, series or curve. Results
/// of different revisions are never mixed, and stored results are keyed by it.
pub const SOLVER_REVISION: u32 = 17;

/// The version of the solver crate.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The schema name that every result carries.
pub const SCHEMA: &str = "roost.result/1";

/// The outcome of one simulation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// Why the run ended.
    pub end_reason: EndReason,
    /// Where and why the physics diverged, when `end_reason` is `unstable`.
    pub instability: Option<Instability>,
    /// Scalar results by name, units last in the name; null where not reached. Empty for a cancelled run.
    pub responses: Map<String, Value>,
    /// Sampled quantities.
    pub series: Vec<Series>,
    /// Quantities over something other than time, such as stress over strain.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub curves: Vec<Curve>,
    /// Conditions under which the result may mislead. Results of revision 14 and before have none written.
    #[serde(default)]
    pub warnings: Vec<Warning>,
    /// The solver and its device.
    pub solver: SolverInfo,
    /// The cost of the run.
    pub performance: Performance,
    /// The scenario as run, every default written out.
    pub scenario: Scenario,
    /// blake3 of the canonical JSON of `scenario`, in hex.
    pub scenario_digest: String,
}

impl RunResult {
    /// Reads a result document, also one of an earlier version, whose scenario is brought to the present schema. Its digest
    /// remains that of the scenario as it was.
    ///
    /// # Errors
    /// Names, in words, the part that cannot be read.
    pub fn from_value(mut document: Value) -> Result<Self, String> {
        if let Some(stored) = document.get_mut("scenario") {
            let scenario = scenario::from_value(stored).map_err(|faults| {
                faults.iter().map(|fault| format!("scenario: {fault}")).collect::<Vec<_>>().join("\n")
            })?;
            *stored = json!(scenario);
        }
        serde_json::from_value(document).map_err(|error| error.to_string())
    }

    /// Whether an earlier version wrote the scenario in another form. [`Self::scenario_digest`] is the digest of that form.
    pub fn is_of_earlier_form(&self) -> bool {
        self.scenario.digest() != self.scenario_digest
    }

    /// The series of that name.
    pub fn series(&self, name: &str) -> Option<&Series> {
        self.series.iter().find(|series| series.name == name)
    }

    /// The response of that name as a number, if it is one.
    pub fn response(&self, name: &str) -> Option<f64> {
        self.responses.get(name).and_then(Value::as_f64)
    }
}

/// A condition under which the result may mislead.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Warning {
    /// Stable code, such as `escaped_mass`; [`crate::experiments::ALL_WARNINGS`] lists all.
    pub code: String,
    /// The finding, with figures, and the advised action.
    pub message: String,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EndReason {
    /// `numerics.duration_s` was simulated.
    Duration,
    /// `numerics.stop.when_empty`: every fillet has left.
    Empty,
    /// `numerics.stop.when_jammed_s`: nothing has passed the gate for that long.
    Jammed,
    /// `numerics.stop.when_done`: the results are known.
    Done,
    /// The fillets did not come to rest before t = 0.
    FillNotAtRest,
    /// The physics diverged.
    Unstable,
    /// Somebody cancelled the run.
    Cancelled,
}

/// Where and why the physics diverged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Instability {
    /// Step number, counted from the start of the fill.
    pub step: u64,
    /// Belt time, in seconds.
    pub time_s: f64,
    /// The reason, in words.
    pub reason: String,
}

/// A sampled quantity over belt time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Series {
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolverInfo {
    /// Version of the solver crate.
    pub version: String,
    /// Its [`SOLVER_REVISION`].
    pub revision: u32,
    /// Name of the backend, such as `cpu`.
    pub backend: String,
    /// The device, in words: processor and instruction set, or graphics adapter.
    pub device: String,
    /// Threads used.
    pub threads: usize,
    /// Time step used, in seconds.
    pub timestep_s: f64,
}

/// The cost of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Performance {
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Filling the hopper (t < 0) or running the belt.
    pub phase: Phase,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Before belt start.
    Fill,
    /// From belt start on.
    Process,
}

/// The answer of a progress callback.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Continue the run.
    Continue,
    /// End the run as soon as possible; the result has the samples so far.
    Cancel,
}
