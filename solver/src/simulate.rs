//! From a checked scenario to its result document.

use serde_json::Map;

use crate::check::Checked;
use crate::engine::Backend;
use crate::engine::run::{Observer, run};
use crate::result::{EndReason, RunResult, SCHEMA, SOLVER_REVISION, SolverInfo, VERSION};

/// Runs a checked scenario on a backend to its end; see [`crate::simulate()`].
pub fn simulate_on<B: Backend>(backend: &B, checked: &Checked, observer: &mut dyn Observer) -> RunResult {
    let (setup, scenario) = (checked.setup(), checked.scenario());
    let mut monitor = setup.monitor();
    let ended = run(backend, setup.scene(), setup.plan(), &mut *monitor, observer);
    let info = backend.info();
    RunResult {
        schema: SCHEMA.to_owned(),
        responses: match ended.reason {
            EndReason::Cancelled => Map::new(),
            reason => monitor.responses(reason),
        },
        series: monitor.recorder().series(),
        curves: monitor.curves(),
        end_reason: ended.reason,
        instability: ended.instability,
        solver: SolverInfo {
            version: VERSION.to_owned(),
            revision: SOLVER_REVISION,
            backend: info.name,
            device: info.device,
            threads: info.threads,
            timestep_s: setup.scene().timestep_s,
        },
        performance: ended.performance,
        scenario: scenario.clone(),
        scenario_digest: scenario.digest(),
    }
}
