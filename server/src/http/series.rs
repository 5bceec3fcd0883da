//! One series of many jobs of a sweep, thinned.

use axum::Json;
use axum::extract::State;
use axum::http::Uri;
use axum::response::{IntoResponse, Response};
use roost_api::Series;
use roost_api::ids::SweepId;
use roost_api::problem::Problem;
use roost_api::table::{JobSeries, SweepSeries};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa::openapi::schema::{Object, ObjectBuilder, Type};

use super::blocking::run_blocking;
use super::extract::{Params, Segments};
use super::page::{RowRange, link_to_next, rows_schema};
use super::problem::{ApiError, ProblemKind};
use super::stored_result::{numbers, series_of};
use super::sweeps::view;
use crate::state::App;
use crate::store::{MAX_DOCUMENTS, TrialDocument};

/// Default number of samples of each job.
const SAMPLES: usize = 200;
/// Minimum of samples of each job: the first and the last.
const MIN_SAMPLES: usize = 2;
/// Maximum of samples of each job.
const MAX_SAMPLES: usize = 1000;
/// Default number of jobs of a page.
const JOBS: u32 = 50;
/// Maximum number of jobs of a page.
const MAX_JOBS: u32 = 200;

/// Query of series.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct SeriesQuery {
    /// Maximum of samples of each job.
    #[param(schema_with = samples_schema)]
    samples: Option<usize>,
    /// `next_cursor` of the previous page.
    cursor: Option<String>,
    /// Maximum of jobs of the page.
    #[param(schema_with = jobs_schema)]
    limit: Option<u32>,
}

fn samples_schema() -> Object {
    let schema = ObjectBuilder::new().schema_type(Type::Integer);
    let schema = schema.minimum(Some(MIN_SAMPLES)).maximum(Some(MAX_SAMPLES));
    schema.default(Some(SAMPLES.into())).build()
}

fn jobs_schema() -> Object {
    rows_schema(MAX_JOBS, Some(JOBS))
}

/// Shows one series of many jobs of a sweep. Each is thinned to some samples, including the first and the last.
#[utoipa::path(get, path = "/v1/sweeps/{id}/series/{name}", tag = "results", operation_id = "sweep_series",
    params(("id" = uuid::Uuid, Path, description = "The sweep"),
           ("name" = String, Path, description = "Name of the series, such as `discharged_mass`"), SeriesQuery),
    responses((status = 200, description = "A page of series", body = SweepSeries),
              (status = 404, description = "No such sweep, or no such series", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn of_sweep(
    State(app): State<App>,
    Segments((id, name)): Segments<(SweepId, String)>,
    uri: Uri,
    Params(query): Params<SeriesQuery>,
) -> Result<Response, ApiError> {
    let samples = query.samples.unwrap_or(SAMPLES);
    if !(MIN_SAMPLES..=MAX_SAMPLES).contains(&samples) {
        let detail = format!("samples {samples} is out of range: allowed is {MIN_SAMPLES} to {MAX_SAMPLES}");
        return Err(ApiError::new(ProblemKind::InvalidQuery, detail));
    }
    let sweep = view(&app, id).await?;
    let (limit, cursor) = (Some(query.limit.unwrap_or(JOBS)), query.cursor.as_deref());
    let mut rows = RowRange::of_trials(&sweep, cursor, limit, MAX_JOBS)?;
    let next_cursor = rows.next_cursor();
    let mut answer = SweepSeries { name, unit: None, items: Vec::new(), next_cursor };
    let mut existing = Vec::new();
    while let Some((place, jobs)) = rows.take(MAX_DOCUMENTS) {
        let trials = app.store.documents_from(id, place, jobs).await?;
        let running = |trial: &TrialDocument| app.progress.series(trial.job_id);
        let trials = trials.into_iter().map(|trial| (running(&trial), trial)).collect::<Vec<_>>();
        let name = answer.name.clone();
        let read = run_blocking(move || {
            trials
                .into_iter()
                .map(|(running, trial)| of_job(&name, running, trial, samples))
                .collect::<Vec<_>>()
        });
        for (unit, item, names) in read.await? {
            answer.unit = answer.unit.or(unit);
            answer.items.extend(item);
            if existing.is_empty() {
                existing = names;
            }
        }
    }
    if answer.items.is_empty() && !existing.is_empty() {
        let detail =
            format!("the results have no series `{}`: they have {}", answer.name, existing.join(", "));
        return Err(ApiError::new(ProblemKind::NotFound, detail));
    }
    let next = answer.next_cursor.clone();
    let mut response = Json(answer).into_response();
    link_to_next(&mut response, &uri, next.as_deref());
    Ok(response)
}

/// The series of one job with its unit; without it, the names of the series that the job has.
fn of_job(
    name: &str,
    running: Vec<Series>,
    trial: TrialDocument,
    samples: usize,
) -> (Option<String>, Option<JobSeries>, Vec<String>) {
    let item = |partial, t_s: &[f64], values: &[f64]| JobSeries {
        job_id: trial.job_id,
        point: trial.place.0,
        replicate: trial.place.1,
        state: trial.state,
        partial,
        t_s: thinned(t_s, samples),
        values: thinned(values, samples),
    };
    let stored = trial.document.as_deref().and_then(|document| series_of(document).ok());
    let Some(stored) = stored else {
        return match running.iter().find(|series| series.name == name) {
            Some(series) => {
                (Some(series.unit.clone()), Some(item(true, &series.t_s, &series.values)), Vec::new())
            }
            None => (None, None, running.into_iter().map(|series| series.name).collect()),
        };
    };
    let found = stored.iter().find(|series| series.name == name);
    match found.and_then(|series| Some((series, numbers(series.t_s).ok()?, numbers(series.values).ok()?))) {
        Some((series, t_s, values)) => {
            (Some(series.unit.to_string()), Some(item(false, &t_s, &values)), Vec::new())
        }
        None => (None, None, stored.iter().map(|series| series.name.to_string()).collect()),
    }
}

/// At most this many of the values, evenly spread, including the first and the last.
fn thinned(values: &[f64], samples: usize) -> Vec<f64> {
    if values.len() <= samples {
        return values.to_vec();
    }
    (0..samples).map(|k| values[k * (values.len() - 1) / (samples - 1)]).collect()
}

#[cfg(test)]
mod tests {
    use super::thinned;

    #[test]
    fn thinning_keeps_both_ends_and_the_maximum() {
        let values: Vec<f64> = (0..101).map(f64::from).collect();
        assert_eq!(thinned(&values, 5), [0.0, 25.0, 50.0, 75.0, 100.0]);
        assert_eq!(thinned(&values, 2), [0.0, 100.0]);
        assert_eq!(thinned(&values, 101), values);
        assert_eq!(thinned(&values[..3], 200), [0.0, 1.0, 2.0]);
        assert_eq!(thinned(&[], 2), [0.0; 0]);
    }
}
