//! Results: the document and the series of a job, the table of a sweep.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use roost_api::ids::{JobId, SweepId};
use roost_api::job::JobState;
use roost_api::problem::Problem;
use roost_api::sweep::SweepView;
use roost_api::table::{SweepEffects, SweepPoints, SweepResults, TrialRow};
use roost_api::{RunResult, Series};
use serde::Deserialize;
use utoipa::{IntoParams, ToSchema};

use super::aside::aside;
use super::extract::{Params, Segments};
use super::problem::{ApiError, Kind};
use super::sweeps::view;
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
    stored.document.ok_or_else(|| {
        let detail = match stored.state {
            JobState::Queued | JobState::Running => "its result comes when it has run",
            JobState::Succeeded | JobState::Failed | JobState::Cancelled => "it left no result",
        };
        ApiError::new(Kind::NotFound, format!("the job is {}: {detail}", stored.state))
    })
}

/// One series of a job's result.
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
    let text = document(&app, id).await?;
    let result: RunResult = serde_json::from_str(&text).map_err(|error| {
        ApiError::new(Kind::Internal, format!("the stored result cannot be read: {error}"))
    })?;
    let Some(series) = result.series(&name) else {
        let names: Vec<_> = result.series.iter().map(|series| series.name.as_str()).collect();
        let detail = format!("the result has no series `{name}`; it has {}", names.join(", "));
        return Err(ApiError::new(Kind::NotFound, detail));
    };
    Ok(match query.format {
        Format::Json => Json(series).into_response(),
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

/// How the result table of a sweep is written.
#[derive(Clone, Copy, Default, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum TableFormat {
    /// JSON.
    #[default]
    Json,
    /// Comma-separated values with a header line.
    Csv,
    /// Apache Parquet.
    Parquet,
}

/// What a row of the result table is.
#[derive(Clone, Copy, Default, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum By {
    /// A trial.
    #[default]
    Trial,
    /// A design point, its replicates summed up.
    Point,
}

/// How to write the result table of a sweep.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct TableQuery {
    /// `json` unless given.
    #[serde(default)]
    #[param(inline)]
    format: TableFormat,
    /// What a row is: `trial` unless given.
    #[serde(default)]
    #[param(inline)]
    by: By,
}

/// The result table of a sweep: one row a trial, or one a design point with mean, deviation and 95 % interval.
#[utoipa::path(get, path = "/v1/sweeps/{id}/results", tag = "results", operation_id = "sweep_results",
    params(("id" = uuid::Uuid, Path, description = "The sweep"), TableQuery),
    responses((status = 200, description = "The table: `SweepResults`, or `SweepPoints` by point",
               content((Object = "application/json"), (String = "text/csv"),
                       (String = "application/vnd.apache.parquet"))),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn table(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    Params(query): Params<TableQuery>,
) -> Result<Response, ApiError> {
    let sweep = view(&app, id).await?;
    let trials = app.store.trials(id).await?;
    aside(move || written(sweep, trials, &query)).await?
}

fn written(sweep: SweepView, trials: Vec<TrialRow>, query: &TableQuery) -> Result<Response, ApiError> {
    let unwritten = |error: &dyn std::fmt::Display| {
        ApiError::new(Kind::Internal, format!("the table cannot be written: {error}"))
    };
    let points = (query.by == By::Point).then(|| sweep::by_point(&trials));
    let columns = || match &points {
        Some(points) => sweep::of_points(&sweep.factors, points),
        None => sweep::of_trials(&sweep.factors, &trials),
    };
    Ok(match query.format {
        TableFormat::Csv => {
            let text = sweep::csv(&columns()).map_err(|error| unwritten(&error))?;
            csv(String::from_utf8_lossy(&text).into_owned())
        }
        TableFormat::Parquet => {
            let bytes = sweep::to_parquet(&columns()).map_err(|error| unwritten(&error))?;
            ([(header::CONTENT_TYPE, "application/vnd.apache.parquet")], bytes).into_response()
        }
        TableFormat::Json => match points {
            Some(points) => Json(SweepPoints { sweep, points }).into_response(),
            None => Json(SweepResults { sweep, trials }).into_response(),
        },
    })
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
    let trials = app.store.trials(id).await?;
    let responses = aside(move || sweep::effects(&factors, &sweep::by_point(&trials))).await?;
    Ok(Json(SweepEffects { sweep, responses }))
}

fn csv(text: String) -> Response {
    ([(header::CONTENT_TYPE, "text/csv; charset=utf-8")], text).into_response()
}
