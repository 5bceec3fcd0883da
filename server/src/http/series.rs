//! Series of many jobs at once, thinned.

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

use super::aside::aside;
use super::extract::{Params, Segments};
use super::page::{Places, link_to_next, rows_schema};
use super::problem::{ApiError, Kind};
use super::sweeps::view;
use crate::app::App;
use crate::store::{DOCUMENTS, Documented};

/// Samples of each job unless asked for otherwise.
const SAMPLES: usize = 200;
/// The first and the last.
const MIN_SAMPLES: usize = 2;
/// The most samples of each job.
const MAX_SAMPLES: usize = 1000;
/// Jobs of a page unless asked for otherwise.
const JOBS: u32 = 50;
/// Jobs of the longest page.
const MAX_JOBS: u32 = 200;

/// How much of the series.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct SeriesQuery {
    /// Samples of each job at most.
    #[param(schema_with = samples_schema)]
    samples: Option<usize>,
    /// `next_cursor` of the page before.
    cursor: Option<String>,
    /// Jobs of the page.
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

/// One series of many jobs of a sweep, each thinned to some samples, the first and the last among them.
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
        let detail = format!("samples {samples} is not within {MIN_SAMPLES} to {MAX_SAMPLES}");
        return Err(ApiError::new(Kind::InvalidQuery, detail));
    }
    let sweep = view(&app, id).await?;
    let (limit, cursor) = (Some(query.limit.unwrap_or(JOBS)), query.cursor.as_deref());
    let mut places = Places::new(sweep.points, sweep.replicates, cursor, limit, MAX_JOBS)?;
    let next_cursor = places.next_cursor();
    let mut answer = SweepSeries { name, unit: None, items: Vec::new(), next_cursor };
    let mut others = Vec::new();
    while let Some((place, jobs)) = places.take(DOCUMENTS) {
        let trials = app.store.documents_from(id, place, jobs).await?;
        let partial = |trial: &Documented| app.progress.series(trial.job_id);
        let trials = trials.into_iter().map(|trial| (partial(&trial), trial)).collect::<Vec<_>>();
        let name = answer.name.clone();
        let read = aside(move || {
            trials
                .into_iter()
                .map(|(partial, trial)| of_job(&name, partial, trial, samples))
                .collect::<Vec<_>>()
        });
        for (unit, item, names) in read.await? {
            answer.unit = answer.unit.or(unit);
            answer.items.extend(item);
            if others.is_empty() {
                others = names;
            }
        }
    }
    if answer.items.is_empty() && !others.is_empty() {
        let detail = format!("the results have no series `{}`; they have {}", answer.name, others.join(", "));
        return Err(ApiError::new(Kind::NotFound, detail));
    }
    let next = answer.next_cursor.clone();
    let mut response = Json(answer).into_response();
    link_to_next(&mut response, &uri, next.as_deref());
    Ok(response)
}

/// Of a result document only its series.
#[derive(Deserialize)]
struct OnlySeries {
    series: Vec<Series>,
}

/// The series of that name of one job, its unit, and the names that there are instead.
fn of_job(
    name: &str,
    running: Vec<Series>,
    trial: Documented,
    samples: usize,
) -> (Option<String>, Option<JobSeries>, Vec<String>) {
    let document = trial.document.as_deref().and_then(|text| serde_json::from_str::<OnlySeries>(text).ok());
    let partial = document.is_none();
    let all = document.map_or(running, |document| document.series);
    let Some(series) = all.iter().find(|series| series.name == name) else {
        return (None, None, all.into_iter().map(|series| series.name).collect());
    };
    let item = JobSeries {
        job_id: trial.job_id,
        point: trial.place.0,
        replicate: trial.place.1,
        state: trial.state,
        partial,
        t_s: thinned(&series.t_s, samples),
        values: thinned(&series.values, samples),
    };
    (Some(series.unit.clone()), Some(item), Vec::new())
}

/// So many of the values at most, evenly spread, with the first and the last.
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
    fn thinning_keeps_both_ends_and_never_more_than_asked() {
        let values: Vec<f64> = (0..101).map(f64::from).collect();
        assert_eq!(thinned(&values, 5), [0.0, 25.0, 50.0, 75.0, 100.0]);
        assert_eq!(thinned(&values, 2), [0.0, 100.0]);
        assert_eq!(thinned(&values, 101), values);
        assert_eq!(thinned(&values[..3], 200), [0.0, 1.0, 2.0]);
        assert_eq!(thinned(&[], 2), [0.0; 0]);
    }
}
