//! From a checked scenario to its result document.

use serde_json::{Map, Value};

use crate::check::Checked;
use crate::engine::Backend;
use crate::engine::checkpoint::{Checkpoint, CheckpointError, Stamp};
use crate::engine::run::{ExperimentMonitor, Observer};
use crate::engine::simulation::run;
use crate::experiments::{warning_responses, warnings_of_responses};
use crate::result::{EndReason, RunResult, SCHEMA, SOLVER_REVISION, SolverInfo, VERSION, Warning};
use crate::scenario::Scenario;

/// Runs a checked scenario on a backend to its end, from the beginning or from a checkpoint; see [`crate::simulate()`].
///
/// # Errors
/// A checkpoint of another run, or a damaged one.
pub fn simulate_on<B: Backend>(
    backend: &B,
    checked: &Checked,
    from: Option<&Checkpoint>,
    observer: &mut dyn Observer,
) -> Result<RunResult, CheckpointError> {
    let (setup, scenario) = (checked.setup(), checked.scenario());
    let info = backend.info();
    let stamp = stamp(&info.name, &info.device, scenario);
    from.map_or(Ok(()), |from| from.fits(&stamp))?;
    let mut monitor = setup.monitor();
    let ended = run(backend, setup.scene(), setup.plan(), &stamp, from, &mut *monitor, observer)?;
    let (responses, warnings) = evaluate(checked, &*monitor, ended.reason);
    Ok(RunResult {
        schema: SCHEMA.to_owned(),
        responses,
        warnings,
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
    })
}

/// The stamp of the checkpoints of a scenario's run.
pub(crate) fn stamp(backend: &str, device: &str, scenario: &Scenario) -> Stamp {
    Stamp::new(format!("{backend} {device}"), scenario.digest(), scenario.fill_digest())
}

/// Responses and warnings. A cancelled run has no responses, and only the warnings of its scenario.
fn evaluate(
    checked: &Checked,
    monitor: &dyn ExperimentMonitor,
    reason: EndReason,
) -> (Map<String, Value>, Vec<Warning>) {
    let mut warnings = checked.warnings().to_vec();
    if reason == EndReason::Cancelled {
        return (Map::new(), warnings);
    }
    let mut responses = monitor.responses(reason);
    warnings.extend(monitor.warnings(reason));
    warnings.extend(warnings_of_responses(checked.setup(), &responses));
    responses.extend(warning_responses(&warnings));
    (responses, warnings)
}
