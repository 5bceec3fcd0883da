//! Deliveries of attempts: a result, several results, or a failure.

use axum::Json;
use axum::extract::State;
use futures_util::future::join_all;
use roost_api::ids::JobId;
use roost_api::job::AttemptOutcome;
use roost_api::job::MAX_NAME_BYTES;
use roost_api::lease::{
    AttemptResult, FailureReport, MAX_RESULTS, ResultAnswer, ResultDelivery, ResultsDelivery, ResultsReply,
};
use roost_api::problem::Problem;
use roost_api::{Fault, RunResult};
use roost_solver::SOLVER_REVISION;
use roost_solver::experiments::response_names;
use roost_solver::result::{EndReason, SCHEMA};
use roost_solver::scenario::escape;
use serde::Serialize;
use serde_json::json;
use utoipa::ToSchema;

use super::blocking::run_blocking_if_long;
use super::delivery::{Delivery, DeliveryBody};
use super::problem::ApiError;
use crate::document::fault;
use crate::queue::{JobChange, Verdict};
use crate::state::App;
use crate::store::EncodedResult;

/// The answer to a delivery.
#[derive(Serialize, ToSchema)]
pub(crate) struct Receipt {
    /// Whether this delivery was recorded; false if it repeats a recorded one.
    pub(super) recorded: bool,
}

/// Delivers the result of an attempt. It is recorded exactly once; repeating it is safe.
#[utoipa::path(post, path = "/v1/jobs/{id}/attempts/{n}/result", tag = "workers", operation_id = "deliver_result",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt")),
    request_body = ResultDelivery,
    responses((status = 200, description = "Recorded by this delivery or by an earlier one", body = Receipt),
              (status = 404, description = "No such job or attempt", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The attempt is stale: nothing changed", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "The result does not match the job, its worker or its experiment", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn result(
    State(app): State<App>,
    Delivery { job: id, attempt, body }: Delivery<ResultDelivery>,
) -> Result<Json<Receipt>, ApiError> {
    let DeliveryBody { document, bytes, budget: _budget } = body;
    let ResultDelivery { worker_id, result, filled_by } = document;
    let stored = run_blocking_if_long(bytes, move || checked_result(&result)).await??;
    let recorded = app.store.record_result(id, attempt, worker_id, (stored, filled_by), app.clock.now());
    let verdict = recorded.await??;
    Ok(Json(settle(&app, id, AttemptOutcome::Succeeded, &verdict)))
}

/// Delivers the results of several attempts. Each is recorded or refused as if it were delivered alone.
#[utoipa::path(post, path = "/v1/results", tag = "workers", operation_id = "deliver_results",
    request_body = ResultsDelivery,
    responses((status = 200, description = "An answer for each result, in the order of the request", body = ResultsReply),
              (status = 422, description = "The document has faults: no result was recorded", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn results(
    State(app): State<App>,
    DeliveryBody { document, bytes, budget: _budget }: DeliveryBody<ResultsDelivery>,
) -> Result<Json<ResultsReply>, ApiError> {
    let ResultsDelivery { results } = document;
    if !(1..=MAX_RESULTS).contains(&results.len()) {
        let (detail, allowed) =
            ("the number of results is out of range", format!("1 to {MAX_RESULTS} results"));
        return Err(ApiError::faults(vec![fault("/results", json!(results.len()), detail, &allowed)]));
    }
    let encode = |AttemptResult { job_id, attempt, delivery }: AttemptResult| {
        let ResultDelivery { worker_id, result, filled_by } = delivery;
        (job_id, attempt, worker_id, checked_result(&result).map(|stored| (stored, filled_by)))
    };
    let encoded: Vec<_> =
        run_blocking_if_long(bytes, move || results.into_iter().map(encode).collect()).await?;
    let now = app.clock.now();
    let record = async |(job_id, attempt, worker, stored)| {
        let recorded = async {
            let verdict = app.store.record_result(job_id, attempt, worker, stored?, now).await??;
            Ok::<_, ApiError>(settle(&app, job_id, AttemptOutcome::Succeeded, &verdict).recorded)
        };
        tracing::debug!(job = %job_id, attempt, "a result arrived");
        (job_id, attempt, recorded.await)
    };
    let mut recorded = join_all(encoded.into_iter().map(record)).await;
    // A store that fails shows in the status, so that monitoring sees it.
    if recorded.iter().all(|(.., answer)| answer.as_ref().is_err_and(ApiError::is_of_server))
        && let Some((.., Err(failure))) = recorded.pop()
    {
        return Err(failure);
    }
    let answer = |(job_id, attempt, answer): (JobId, u32, Result<bool, ApiError>)| {
        let (recorded, problem) = match answer {
            Ok(recorded) => (recorded, None),
            Err(refusal) => (false, Some(refusal.into_problem())),
        };
        ResultAnswer { job_id, attempt, recorded, problem }
    };
    Ok(Json(ResultsReply { answers: recorded.into_iter().map(answer).collect() }))
}

fn checked_result(result: &RunResult) -> Result<EncodedResult, ApiError> {
    let mut faults = result_faults(result);
    if matches!(result.end_reason, EndReason::Unstable | EndReason::Cancelled) {
        let detail = "the run was unstable or cancelled: report it as a failure";
        faults.push(fault(
            "/result/end_reason",
            json!(result.end_reason),
            detail,
            "the end of a complete run",
        ));
    }
    if !faults.is_empty() {
        return Err(ApiError::faults(faults));
    }
    Ok(EncodedResult::new(result)?)
}

/// Reports that an attempt ended without a result. Repeating it is safe.
#[utoipa::path(post, path = "/v1/jobs/{id}/attempts/{n}/failure", tag = "workers",
    operation_id = "report_failure",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt")),
    request_body = FailureReport,
    responses((status = 200, description = "Recorded by this delivery or by an earlier one", body = Receipt),
              (status = 404, description = "No such job or attempt", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The attempt is stale: nothing changed", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "The report does not match the job", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn failure(
    State(app): State<App>,
    Delivery { job: id, attempt, body }: Delivery<FailureReport>,
) -> Result<Json<Receipt>, ApiError> {
    let DeliveryBody { document, bytes, budget: _budget } = body;
    let FailureReport { worker_id, outcome, message, result } = document;
    let check = move || result.map(|result| checked_partial(outcome, result)).transpose();
    let partial = run_blocking_if_long(bytes, check).await??;
    let (policy, now) = (app.config.retry, app.clock.both());
    let recorded = app.store.record_failure(id, attempt, worker_id, outcome, message, partial, policy, now);
    let verdict = recorded.await??;
    Ok(Json(settle(&app, id, outcome, &verdict)))
}

/// Checks a partial result. Responses of a cancelled run are removed: they hold for complete runs only.
fn checked_partial(outcome: AttemptOutcome, mut result: RunResult) -> Result<EncodedResult, ApiError> {
    let faults = result_faults(&result);
    if !faults.is_empty() {
        return Err(ApiError::faults(faults));
    }
    if outcome == AttemptOutcome::Cancelled {
        result.responses.clear();
    }
    Ok(EncodedResult::new(&result)?)
}

/// Updates metrics, progress and waiting claims after a delivery.
fn settle(app: &App, job: JobId, outcome: AttemptOutcome, verdict: &Verdict) -> Receipt {
    if let Verdict::Record(change) = verdict {
        app.metrics.attempt_ended(outcome);
        app.progress.remove(job);
        if matches!(change, JobChange::Requeue { not_before: None, .. }) {
            app.work.notify_waiters();
        }
    }
    Receipt { recorded: matches!(verdict, Verdict::Record(_)) }
}

/// The faults of a result that hold for every job.
fn result_faults(result: &RunResult) -> Vec<Fault> {
    let mut faults = Vec::new();
    if result.schema != SCHEMA {
        faults.push(fault("/result/schema", json!(result.schema), "unknown schema", SCHEMA));
    }
    // An older solver leaves out fields that this one writes: its digest is compared with the job's alone.
    if result.solver.revision == SOLVER_REVISION && result.scenario.digest() != result.scenario_digest {
        let detail = "this is not the digest of `scenario` in the result";
        let found = json!(result.scenario_digest);
        faults.push(fault("/result/scenario_digest", found, detail, &result.scenario.digest()));
    }
    faults.extend(unknown_responses(result));
    for (index, series) in result.series.iter().enumerate() {
        if series.t_s.len() != series.values.len() {
            let at = format!("/result/series/{index}/values");
            let detail = format!("series `{}` has {} values", series.name, series.values.len());
            let allowed = format!("{}, the number of times", series.t_s.len());
            faults.push(fault(&at, json!(series.values.len()), &detail, &allowed));
        }
    }
    faults
}

/// Maximum of unknown responses in one answer.
const MAX_LISTED: usize = 20;

/// Faults of responses that the experiment does not have. The responses of older revisions are unknown here:
/// a result that waited in an outbox is accepted if its names are short.
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
