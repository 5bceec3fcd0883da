//! What an attempt delivers: its result, or why there is none.

use axum::Json;
use axum::extract::State;
use roost_api::ids::JobId;
use roost_api::job::AttemptOutcome;
use roost_api::job::MAX_NAME_BYTES;
use roost_api::lease::{FailureReport, ResultDelivery};
use roost_api::problem::Problem;
use roost_api::{Fault, RunResult};
use roost_solver::SOLVER_REVISION;
use roost_solver::experiments::response_names;
use roost_solver::result::{EndReason, SCHEMA};
use roost_solver::scenario::escape;
use serde::Serialize;
use serde_json::json;
use utoipa::ToSchema;

use super::aside::unless_short;
use super::delivery::Delivery;
use super::problem::ApiError;
use crate::app::App;
use crate::document::fault;
use crate::queue::{JobChange, Verdict};
use crate::store::StoredResult;

/// The answer to a delivery.
#[derive(Serialize, ToSchema)]
pub(crate) struct Receipt {
    /// Whether this delivery changed something; false when it repeats one that counted already.
    pub(super) recorded: bool,
}

/// Delivers the result of an attempt. It is recorded exactly once; repeating it is safe.
#[utoipa::path(post, path = "/v1/jobs/{id}/attempts/{n}/result", tag = "workers", operation_id = "deliver_result",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt")),
    request_body = ResultDelivery,
    responses((status = 200, description = "Recorded, now or before", body = Receipt),
              (status = 404, description = "No such job or attempt", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The attempt is stale: nothing changed", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "The result is not that of the job, its worker or its experiment", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn result(
    State(app): State<App>,
    Delivery { job: id, attempt, body, bytes, turn: _turn }: Delivery<ResultDelivery>,
) -> Result<Json<Receipt>, ApiError> {
    let ResultDelivery { worker_id, result } = body;
    let stored = unless_short(bytes, move || prepared_result(result)).await??;
    let verdict = app.store.record_result(id, attempt, worker_id, stored, app.clock.now()).await??;
    Ok(Json(settle(&app, id, AttemptOutcome::Succeeded, &verdict)))
}

fn prepared_result(result: RunResult) -> Result<StoredResult, ApiError> {
    let mut faults = result_faults(&result);
    if matches!(result.end_reason, EndReason::Unstable | EndReason::Cancelled) {
        let detail = "an unstable or cancelled run has no result: report it as a failure";
        faults.push(fault("/result/end_reason", json!(result.end_reason), detail, ""));
    }
    if !faults.is_empty() {
        return Err(ApiError::faults(faults));
    }
    Ok(StoredResult::new(&result)?)
}

/// Reports why an attempt has no result. Repeating it is safe.
#[utoipa::path(post, path = "/v1/jobs/{id}/attempts/{n}/failure", tag = "workers",
    operation_id = "report_failure",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt")),
    request_body = FailureReport,
    responses((status = 200, description = "Recorded, now or before", body = Receipt),
              (status = 404, description = "No such job or attempt", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The attempt is stale: nothing changed", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "The report does not fit the job", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn failure(
    State(app): State<App>,
    Delivery { job: id, attempt, body, bytes, turn: _turn }: Delivery<FailureReport>,
) -> Result<Json<Receipt>, ApiError> {
    let FailureReport { worker_id, outcome, message, result } = body;
    let prepare = move || result.map(|result| prepared_partial(outcome, result)).transpose();
    let partial = unless_short(bytes, prepare).await??;
    let (policy, now) = (app.config.retry, app.clock.both());
    let recorded = app.store.record_failure(id, attempt, worker_id, outcome, message, partial, policy, now);
    let verdict = recorded.await??;
    Ok(Json(settle(&app, id, outcome, &verdict)))
}

/// What a cancelled run had come to is no response.
fn prepared_partial(outcome: AttemptOutcome, mut result: RunResult) -> Result<StoredResult, ApiError> {
    let faults = result_faults(&result);
    if !faults.is_empty() {
        return Err(ApiError::faults(faults));
    }
    if outcome == AttemptOutcome::Cancelled {
        result.responses.clear();
    }
    Ok(StoredResult::new(&result)?)
}

/// What a delivery means for those who wait and watch.
fn settle(app: &App, job: JobId, outcome: AttemptOutcome, verdict: &Verdict) -> Receipt {
    if let Verdict::Record(change) = verdict {
        app.metrics.attempt_ended(outcome);
        app.progress.forget(job);
        if matches!(change, JobChange::Requeue { not_before: None, .. }) {
            app.work.notify_waiters();
        }
    }
    Receipt { recorded: matches!(verdict, Verdict::Record(_)) }
}

/// What must hold within a result, whatever the job.
fn result_faults(result: &RunResult) -> Vec<Fault> {
    let mut faults = Vec::new();
    if result.schema != SCHEMA {
        faults.push(fault("/result/schema", json!(result.schema), "unknown schema", SCHEMA));
    }
    if result.scenario.digest() != result.scenario_digest {
        let detail = "not the digest of the scenario in the result";
        let found = json!(result.scenario_digest);
        faults.push(fault("/result/scenario_digest", found, detail, &result.scenario.digest()));
    }
    faults.extend(unknown_responses(result));
    for (index, series) in result.series.iter().enumerate() {
        if series.t_s.len() != series.values.len() {
            let at = format!("/result/series/{index}/values");
            let detail = format!("series `{}` has {} values", series.name, series.values.len());
            let allowed = format!("as many as times: {}", series.t_s.len());
            faults.push(fault(&at, json!(series.values.len()), &detail, &allowed));
        }
    }
    faults
}

/// Unknown responses that are listed one by one.
const MAX_LISTED: usize = 20;

/// Responses that the experiment has not. Which ones an older revision had is not known here: a result of one that waited in an outbox
/// is taken as it is, but for names of any length.
fn unknown_responses(result: &RunResult) -> Vec<Fault> {
    let is_of_this_revision = result.solver.revision == SOLVER_REVISION;
    let known = response_names(&result.scenario.experiment);
    let is_known = |name: &str| match is_of_this_revision {
        true => known.contains(&name),
        false => name.len() <= MAX_NAME_BYTES,
    };
    let unknown = result.responses.iter().filter(|(name, _)| !is_known(name)).take(MAX_LISTED);
    let unknown = unknown.map(|(name, value)| match name.len() <= MAX_NAME_BYTES {
        true => {
            let at = format!("/result/responses/{}", escape(name));
            fault(&at, value.clone(), "the experiment has no such response", &known.join(", "))
        }
        false => {
            let allowed = format!("names of at most {MAX_NAME_BYTES} bytes");
            fault("/result/responses", json!(name), "the experiment has no such response", &allowed)
        }
    });
    unknown.collect()
}
