//! Results: the document and the series of a job, the effects of a sweep.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use roost_api::ids::{JobId, SweepId};
use roost_api::job::JobState;
use roost_api::problem::Problem;
use roost_api::table::SweepEffects;
use roost_api::{RunResult, Series};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use super::aside::aside;
use super::extract::{Params, Segments};
use super::problem::{ApiError, Kind};
use super::sweeps::view;
use super::tables::Rows;
use crate::app::App;
use crate::queue::Refusal;
use crate::sweep;

/// How a table is written.
#[derive(Clone, Copy, Default, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Format {
    /// JSON.
    #[default]
    Json,
    /// Comma-separated values with a header line.
    Csv,
}

/// How to write a table.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct FormatQuery {
    /// `json` unless given.
    #[serde(default)]
    #[param(inline)]
    format: Format,
}

/// The result document of a job; of one that failed or was cancelled, what its last attempt left.
#[utoipa::path(get, path = "/v1/jobs/{id}/result", tag = "results", operation_id = "job_result",
    params(("id" = uuid::Uuid, Path, description = "The job")),
    responses((status = 200, description = "The result document `roost.result/1`", body = Object),
              (status = 404, description = "No such job, or no result (yet)", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn result(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
) -> Result<Response, ApiError> {
    let document = document(&app, id).await?;
    Ok(([(header::CONTENT_TYPE, "application/json")], document).into_response())
}

async fn document(app: &App, id: JobId) -> Result<String, ApiError> {
    let stored = app.store.result(id).await?.ok_or(Refusal::NoJob)?;
    stored.document.ok_or_else(|| no_result(stored.state))
}

fn no_result(state: JobState) -> ApiError {
    let detail = match state {
        JobState::Queued | JobState::Running => "its result comes when it has run",
        JobState::Succeeded | JobState::Failed | JobState::Cancelled => "it left no result",
    };
    ApiError::new(Kind::NotFound, format!("the job is {state}: {detail}"))
}

/// A series, and whether more of it is to come.
#[derive(Serialize)]
struct Told<'a> {
    #[serde(flatten)]
    series: &'a Series,
    partial: bool,
}

/// One series of a job's result; of a running job what there is so far.
#[utoipa::path(get, path = "/v1/jobs/{id}/series/{name}", tag = "results", operation_id = "job_series",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("name" = String, Path, description = "Name of the series, such as `discharged_mass`"), FormatQuery),
    responses((status = 200, description = "The series", content((Object = "application/json"),
                                                                 (String = "text/csv"))),
              (status = 404, description = "No such job, result or series", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn series(
    State(app): State<App>,
    Segments((id, name)): Segments<(JobId, String)>,
    Params(query): Params<FormatQuery>,
) -> Result<Response, ApiError> {
    let stored = app.store.result(id).await?.ok_or(Refusal::NoJob)?;
    let partial = stored.document.is_none();
    let all = match stored.document {
        Some(text) => {
            let result: RunResult = serde_json::from_str(&text).map_err(|error| {
                ApiError::new(Kind::Internal, format!("the stored result cannot be read: {error}"))
            })?;
            result.series
        }
        None if stored.state == JobState::Running => app.progress.series(id),
        None => Vec::new(),
    };
    if all.is_empty() && partial {
        return Err(no_result(stored.state));
    }
    let Some(series) = all.iter().find(|series| series.name == name) else {
        let names: Vec<_> = all.iter().map(|series| series.name.as_str()).collect();
        let detail = format!("the result has no series `{name}`; it has {}", names.join(", "));
        return Err(ApiError::new(Kind::NotFound, detail));
    };
    Ok(match query.format {
        Format::Json => Json(Told { series, partial }).into_response(),
        Format::Csv => csv(series_csv(series)?),
    })
}

/// Two columns, the unit in the name of the second.
fn series_csv(series: &Series) -> Result<String, ApiError> {
    let write = || {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(["t_s", &format!("{} [{}]", series.name, series.unit)])?;
        for (t_s, value) in series.t_s.iter().zip(&series.values) {
            writer.serialize((t_s, value))?;
        }
        writer.into_inner().map_err(|error| csv::Error::from(error.into_error()))
    };
    let bytes = write().map_err(|error| ApiError::new(Kind::Internal, error.to_string()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// How each factor of a sweep acts on each response: main effects and rank correlations.
#[utoipa::path(get, path = "/v1/sweeps/{id}/effects", tag = "results", operation_id = "sweep_effects",
    params(("id" = uuid::Uuid, Path, description = "The sweep")),
    responses((status = 200, description = "Effects by response and factor", body = SweepEffects),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn effects(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<SweepEffects>, ApiError> {
    let sweep = view(&app, id).await?;
    let factors = app.store.factors(id).await?.ok_or(Refusal::NoSweep)?;
    let mut rows = Rows::of_points(app, &sweep)?;
    let mut effects = sweep::Effects::of(factors);
    while let Some(points) = rows.next_points().await? {
        effects.add(points);
    }
    let responses = aside(move || effects.responses()).await?;
    Ok(Json(SweepEffects { sweep, responses }))
}

pub(super) fn csv(text: String) -> Response {
    ([(header::CONTENT_TYPE, "text/csv; charset=utf-8")], text).into_response()
}
