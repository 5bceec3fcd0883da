//! Results: document and series of a job, effects and differences of a sweep.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use roost_api::ids::{JobId, SweepId};
use roost_api::job::JobState;
use roost_api::problem::Problem;
use roost_api::sweep::SweepView;
use roost_api::table::{DesignPoint, SweepDifferences, SweepEffects, TrialRow};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use super::blocking::run_blocking;
use super::extract::{Params, Segments};
use super::problem::{ApiError, ProblemKind};
use super::stored_result::{numbers, series_of};
use super::sweeps::view;
use super::table_rows::TableRows;
use crate::queue::Refusal;
use crate::state::App;
use crate::sweep;

/// The format of a table.
#[derive(Clone, Copy, Default, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Format {
    /// JSON.
    #[default]
    Json,
    /// Comma-separated values with a header line.
    Csv,
}

/// Query of a table.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct FormatQuery {
    /// `json` unless given.
    #[serde(default)]
    #[param(inline)]
    format: Format,
}

/// Shows the result document of a job. For a failed or cancelled job it is the partial result of the last attempt.
#[utoipa::path(get, path = "/v1/jobs/{id}/result", tag = "results", operation_id = "job_result",
    params(("id" = uuid::Uuid, Path, description = "The job")),
    responses((status = 200, description = "The result document `roost.result/1`", body = Object),
              (status = 404, description = "No such job, or it has no result yet", body = Problem,
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
        JobState::Queued | JobState::Running => "its result follows when it has succeeded",
        JobState::Succeeded | JobState::Failed | JobState::Cancelled => "its last attempt left no result",
    };
    ApiError::new(ProblemKind::NotFound, format!("the job is {state}: {detail}"))
}

/// A series as JSON.
#[derive(Serialize)]
struct SeriesAnswer<S> {
    #[serde(flatten)]
    series: S,
    /// Whether the job still runs and adds samples.
    partial: bool,
}

/// Shows one series of a job's result, or of a running job so far.
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
    let Some(document) = stored.document else {
        let running = stored.state == JobState::Running;
        let all = if running { app.progress.series(id) } else { Vec::new() };
        if all.is_empty() {
            return Err(no_result(stored.state));
        }
        let series = named(&name, &all, |series| &series.name)?;
        return Ok(match query.format {
            Format::Json => Json(SeriesAnswer { series, partial: true }).into_response(),
            Format::Csv => csv(series_csv(&series.name, &series.unit, &series.t_s, &series.values)?),
        });
    };
    let all = series_of(&document)?;
    let series = named(&name, &all, |series| &series.name)?;
    Ok(match query.format {
        Format::Json => Json(SeriesAnswer { series, partial: false }).into_response(),
        Format::Csv => {
            csv(series_csv(&series.name, &series.unit, &numbers(series.t_s)?, &numbers(series.values)?)?)
        }
    })
}

/// The series of this name, or an error with the names that exist.
fn named<'a, S>(name: &str, all: &'a [S], name_of: impl Fn(&S) -> &str) -> Result<&'a S, ApiError> {
    all.iter().find(|series| name_of(series) == name).ok_or_else(|| {
        let names: Vec<_> = all.iter().map(name_of).collect();
        let detail = format!("the result has no series `{name}`: it has {}", names.join(", "));
        ApiError::new(ProblemKind::NotFound, detail)
    })
}

/// Two columns, with the unit in the name of the second.
fn series_csv(name: &str, unit: &str, t_s: &[f64], values: &[f64]) -> Result<String, ApiError> {
    let write = || {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(["t_s", &format!("{name} [{unit}]")])?;
        for (t_s, value) in t_s.iter().zip(values) {
            writer.serialize((t_s, value))?;
        }
        writer.into_inner().map_err(|error| csv::Error::from(error.into_error()))
    };
    let bytes = write().map_err(|error| ApiError::new(ProblemKind::Internal, error.to_string()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Computes the effect of each factor of a sweep on each response: main effects and rank correlations.
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
    refuse_calibration(&app, &sweep).await?;
    let factors = app.store.factors(id).await?.ok_or(Refusal::NoSweep)?;
    let mut effects = sweep::Effects::of(factors, sweep::MAX_EFFECTS_BYTES, sweep.runs_per_sample);
    let mut is_complete = false;
    while !is_complete {
        let mut rows = TableRows::of_points(app.clone(), &sweep)?;
        while let Some(trials) = rows.next_points().await? {
            let added = run_blocking(move || {
                effects.add(&trials);
                effects
            });
            effects = added.await?;
        }
        let evaluated = run_blocking(move || (effects.finish_pass(), effects));
        (is_complete, effects) = evaluated.await?;
    }
    let (responses, pairing) = effects.responses();
    Ok(Json(SweepEffects { sweep, responses, pairing }))
}

/// Query of differences.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct DifferencesQuery {
    /// Index of the first design point.
    from: u32,
    /// Index of the second design point, another one.
    to: u32,
}

/// Computes the difference of each response between two design points of a sweep, with intervals that use their common seeds.
#[utoipa::path(get, path = "/v1/sweeps/{id}/differences", tag = "results", operation_id = "sweep_differences",
    params(("id" = uuid::Uuid, Path, description = "The sweep"), DifferencesQuery),
    responses((status = 200, description = "Differences by response", body = SweepDifferences),
              (status = 404, description = "No such sweep, or it has no such point", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn differences(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    Params(query): Params<DifferencesQuery>,
) -> Result<Json<SweepDifferences>, ApiError> {
    let sweep = view(&app, id).await?;
    refuse_calibration(&app, &sweep).await?;
    if query.from == query.to {
        let to = query.to;
        let detail = format!(
            "to={to} is the same design point as from={to}: allowed is another one, of 0 to {}",
            sweep.points.saturating_sub(1)
        );
        return Err(ApiError::new(ProblemKind::InvalidQuery, detail));
    }
    let from = trials_of(&app, id, sweep.points, query.from).await?;
    let to = trials_of(&app, id, sweep.points, query.to).await?;
    let point =
        |trials: &[TrialRow]| DesignPoint { point: trials[0].point, factors: trials[0].factors.clone() };
    let (points, drawn) = ([point(&from), point(&to)], sweep.runs_per_sample);
    let (responses, pairing) = run_blocking(move || sweep::differences(&from, &to, drawn)).await?;
    let [from, to] = points;
    Ok(Json(SweepDifferences { sweep, from, to, responses, pairing }))
}

/// Refuses the sweep of a calibration: its points simulate different tests.
async fn refuse_calibration(app: &App, sweep: &SweepView) -> Result<(), ApiError> {
    if !sweep.is_study || !app.store.study(sweep.id).await?.is_some_and(|study| study.is_calibration()) {
        return Ok(());
    }
    let detail =
        "the runs of a calibration simulate different tests: its answer compares them with the measurements";
    Err(ApiError::new(ProblemKind::WrongState, detail))
}

/// The trials of one of `points` design points.
async fn trials_of(app: &App, id: SweepId, points: u32, point: u32) -> Result<Vec<TrialRow>, ApiError> {
    let next = point.saturating_add(1);
    let trials = app.store.trials_of(id, point..next).await?;
    if trials.is_empty() {
        let detail =
            format!("the sweep has no design point {point}: allowed is 0 to {}", points.saturating_sub(1));
        return Err(ApiError::new(ProblemKind::NotFound, detail));
    }
    Ok(trials)
}

pub(super) fn csv(text: String) -> Response {
    ([(header::CONTENT_TYPE, "text/csv; charset=utf-8")], text).into_response()
}
