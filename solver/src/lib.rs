//! The Roost DEM solver: a scenario goes in, responses and series come out.
//!
//! The library knows no HTTP, no database and no wall clock beyond timing itself. The layers, from the
//! top: [`scenario`] is what a user may ask for, [`experiments`] turns it into a scene of bodies and
//! surfaces, [`engine`] owns the state and the order of the stages of a step, [`cpu`] carries the stages
//! out, [`observe`] reads the state into samples, and [`result`] is what comes back.

mod check;
pub mod cpu;
pub mod engine;
pub mod equipment;
pub mod experiments;
pub mod observe;
pub mod physics;
pub mod result;
pub mod scenario;
pub mod shape;

/// Changes whenever the bits of a result change: results of different revisions are never mixed
/// silently, and the result cache is keyed by it.
pub const PHYSICS_REVISION: u32 = 1;

pub use check::check;
use result::{Progress, RunResult};
use scenario::Scenario;

/// The version of the solver crate.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// What an operator allows a single scenario to cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Sub-particles at the start of a run.
    pub max_subparticles: u64,
    /// Time steps of a run.
    pub max_steps: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { max_subparticles: 2_000_000, max_steps: 50_000_000 }
    }
}

/// What a progress callback answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Go on.
    Continue,
    /// End the run as soon as possible; what was sampled so far is returned.
    Cancel,
}

/// Where a run is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CpuOptions {
    /// Threads; 0 means one per processor.
    pub threads: usize,
}

/// Runs one scenario on the CPU to its end. `on_progress` is called about ten times a second of wall time and
/// at least once per output interval, and may cancel: what was sampled so far is then returned, without responses.
pub fn simulate(
    scenario: &Scenario,
    options: CpuOptions,
    on_progress: &mut dyn FnMut(&Progress) -> Flow,
) -> RunResult {
    experiments::simulate(scenario, &cpu::Cpu::new(options.threads), on_progress)
}
