//! The sweeps that a new study begins with: their runs, and the faults of the list.

use roost_api::Fault;
use roost_api::ids::SweepId;
use serde_json::json;

use super::problem::ApiError;
use crate::document::fault;
use crate::state::App;
use crate::study::{Copied, MAX_SEEDING_RUNS, Observation, Study, SweepRun, sentences};

/// A sweep with its finished runs.
pub(super) struct SeedingRuns {
    sweep: SweepId,
    name: String,
    without_result: u64,
    runs: Vec<SweepRun>,
}

/// The finished runs of some sweeps, or every fault of the list.
pub(super) async fn runs(app: &App, sweeps: &[SweepId]) -> Result<Vec<SeedingRuns>, ApiError> {
    let (mut found, mut faults, mut total) = (Vec::new(), Vec::new(), 0);
    for (index, id) in sweeps.iter().enumerate() {
        let Some(sweep) = app.store.sweep(*id).await? else {
            let at = format!("/seeded_by/{index}");
            faults.push(fault(&at, json!(id), "there is no such sweep", "the id of a sweep on this server"));
            continue;
        };
        let counts = sweep.counts;
        total += counts.succeeded;
        let without_result = counts.queued + counts.running + counts.failed + counts.cancelled;
        found.push(SeedingRuns { sweep: *id, name: sweep.name, without_result, runs: Vec::new() });
    }
    if total > MAX_SEEDING_RUNS {
        let allowed = format!("at most {MAX_SEEDING_RUNS} runs with a result in all");
        faults.push(fault("/seeded_by", json!(total), "more runs than a study can begin with", &allowed));
    }
    if !faults.is_empty() {
        return Err(ApiError::faults(faults));
    }
    for sweep in &mut found {
        sweep.runs = app.store.runs_to_copy(sweep.sweep).await?;
    }
    Ok(found)
}

/// Copies the runs of sweeps into a new study. A sweep without any run that the study can use is a fault.
pub(super) fn copy(study: &mut Study, sweeps: Vec<SeedingRuns>) -> Result<Vec<Observation>, Vec<Fault>> {
    let (mut copied, mut observations, mut faults) = (Copied::default(), Vec::new(), Vec::new());
    for (index, SeedingRuns { sweep, name, without_result, runs }) in sweeps.into_iter().enumerate() {
        let (counts, more) = study.copy((sweep, name, without_result), &runs, &mut copied);
        if counts.copied == 0 {
            let reasons = match sentences::left_out(&counts, 0) {
                reasons if reasons.is_empty() => "it has none".to_owned(),
                reasons => reasons.join(", "),
            };
            let detail = format!("no run of this sweep can be used: {reasons}");
            let allowed = "a sweep with results of the same base, by the present solver revision";
            faults.push(fault(&format!("/seeded_by/{index}"), json!(sweep), &detail, allowed));
        }
        study.seeding.push(counts);
        observations.extend(more);
    }
    if faults.is_empty() { Ok(observations) } else { Err(faults) }
}
