//! Forecasts of jobs, sweeps, studies, and of documents that are not submitted; the depth of the queue.

use std::time::Duration;

use axum::Json;
use axum::extract::State;
use roost_api::forecast::{Forecast, RunRange};
use roost_api::ids::{JobId, SweepId};
use roost_api::job::Needs;
use roost_api::problem::Problem;
use roost_api::queue::QueueDepth;
use roost_api::study::{Driver, StudySpec, StudyState};
use roost_api::validate::ValidationReport;
use serde_json::{Value, json};

use super::blocking::run_blocking;
use super::extract::{Document, Segments};
use super::posteriors;
use super::problem::ApiError;
use super::{jobs, sweeps};
use crate::document::fault;
use crate::forecast::{CLIENTS_CHOOSE, no_forecast};
use crate::queue::Refusal;
use crate::state::App;
use crate::store::StoredStudy;
use crate::study::Study;
use crate::validation::{is_study, validate};

/// A forecast of a sweep or study answers all requests for this time.
const AGE: Duration = Duration::from_secs(1);

/// Shows when a job is expected to start and end, and why it waits.
#[utoipa::path(get, path = "/v1/jobs/{id}/forecast", tag = "jobs", operation_id = "job_forecast",
    params(("id" = uuid::Uuid, Path, description = "The job")),
    responses((status = 200, description = "The forecast", body = Forecast),
              (status = 404, description = "No such job", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn of_job(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
) -> Result<Json<Forecast>, ApiError> {
    let job = jobs::view(&app, id).await?;
    Ok(Json(app.job_forecast(&job).await?))
}

/// Shows when a sweep is expected to start and end, and why its jobs wait.
#[utoipa::path(get, path = "/v1/sweeps/{id}/forecast", tag = "sweeps", operation_id = "sweep_forecast",
    params(("id" = uuid::Uuid, Path, description = "The sweep")),
    responses((status = 200, description = "The forecast", body = Forecast),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn of_sweep(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<Forecast>, ApiError> {
    let (sweep, _) = sweeps::recent_view(&app, id, AGE).await?;
    if let Some(known) = app.forecasts.get_recent(id, AGE) {
        return Ok(Json(known));
    }
    let made = app.sweep_forecast(&sweep).await?;
    app.forecasts.insert(id, String::new(), made.clone());
    Ok(Json(made))
}

/// Shows when a study is expected to end, by the range of the runs that are left, and why its jobs wait.
#[utoipa::path(get, path = "/v1/studies/{id}/forecast", tag = "studies", operation_id = "study_forecast",
    params(("id" = uuid::Uuid, Path, description = "The study")),
    responses((status = 200, description = "The forecast", body = Forecast),
              (status = 404, description = "No such study", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn of_study(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<Forecast>, ApiError> {
    let stored = app.store.study(id).await?.ok_or(Refusal::NoStudy)?;
    if let Some(known) = app.study_forecasts.get_recent(id, AGE) {
        return Ok(Json(known));
    }
    let made = study_forecast(&app, &stored).await?;
    app.study_forecasts.insert(id, String::new(), made.clone());
    Ok(Json(made))
}

async fn study_forecast(app: &App, stored: &StoredStudy) -> Result<Forecast, ApiError> {
    let (sweep, _) = sweeps::recent_view(app, stored.id, AGE).await?;
    let observed = app.store.observed(stored.id).await?;
    let of_clients = observed.done + observed.failed + observed.handed_out;
    let spent = sweep.counts.succeeded + sweep.counts.failed + of_clients;
    let left = |runs: u64| runs.saturating_sub(spent);
    // Runs that are not its own may be all that the answer needs.
    let fewest = match observed.outside_budget {
        0 => Study::stored(stored.present()?).map_or(0, |study| study.least_runs()),
        _ => 0,
    };
    let runs_left = match stored.state {
        StudyState::Finished | StudyState::Cancelled => RunRange { least: 0, most: 0 },
        _ => RunRange {
            least: left(fewest).min(left(stored.max_runs.into())),
            most: left(stored.max_runs.into()),
        },
    };
    let obstacle = match (stored.state, stored.driver) {
        (StudyState::Paused, _) => Some("the study is paused"),
        (StudyState::Running, Driver::Client) => Some(CLIENTS_CHOOSE),
        _ => None,
    };
    if let Some(obstacle) = obstacle {
        let made = no_forecast(obstacle, runs_left, app.clock.now());
        return Ok(Forecast { waiting: app.sweep_forecast(&sweep).await?.waiting, ..made });
    }
    Ok(app.forecast_of(&sweep, runs_left).await?)
}

/// Shows the number of queued jobs by needs, beside the workers that could claim them.
#[utoipa::path(get, path = "/v1/queue/depth", tag = "jobs", operation_id = "queue_depth",
    responses((status = 200, description = "The depth of the queue", body = QueueDepth)))]
pub(crate) async fn of_queue(State(app): State<App>) -> Result<Json<QueueDepth>, ApiError> {
    Ok(Json(app.queue_depth().await?))
}

/// Checks a study without submitting it, and forecasts its runs, processor time and time of completion as ranges.
#[utoipa::path(post, path = "/v1/studies/validate", tag = "studies", operation_id = "validate_study",
    request_body = StudySpec,
    responses((status = 200, description = "The study is valid", body = ValidationReport),
              (status = 422, description = "The document has faults; `errors` lists all of them", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn validate_study(
    State(app): State<App>,
    Document(document): Document,
) -> Result<Json<ValidationReport>, ApiError> {
    if !is_study(&document) {
        let schema = document.get("schema").cloned().unwrap_or_default();
        let detail = "the document is no study";
        let allowed = "a study, which has a `goal`: /v1/validate takes scenarios and sweeps";
        return Err(ApiError::faults(vec![fault("/goal", schema, detail, allowed)]));
    }
    report(&app, document).await.map(Json)
}

/// Checks a document, and forecasts its cost on the present workers, unless clients make its runs.
pub(super) async fn report(app: &App, mut document: Value) -> Result<ValidationReport, ApiError> {
    posteriors::fill_in(app, &mut document).await?;
    let (limits, max_jobs) = (app.config.limits, app.config.max_jobs_per_sweep);
    let meshes = app.mesh_cache.meshes_of(&document, &app.store).await?;
    let (needs, priority) = placement(&document);
    let checked = run_blocking(move || validate(document, &meshes, &limits, max_jobs)).await?;
    let report = checked.map_err(ApiError::faults)?;
    if report.forecast.is_some() {
        return Ok(report);
    }
    let runs = RunRange { least: report.min_jobs, most: report.jobs };
    let each_s = report.wall_s / report.jobs.max(1) as f64;
    let forecast = app.cost_forecast((runs, each_s), &needs, priority).await?;
    Ok(ValidationReport { forecast: Some(forecast), ..report })
}

/// Needs and priority of a document, as far as it can be read.
fn placement(document: &Value) -> (Needs, i32) {
    let needs = document.get("needs").cloned().unwrap_or_else(|| json!({}));
    let priority = document.get("priority").and_then(Value::as_i64).unwrap_or(0);
    (serde_json::from_value(needs).unwrap_or_default(), i32::try_from(priority).unwrap_or(0))
}
