//! The result table of a sweep, written in chunks: a large table is never in memory as a whole, except for
//! the values of a Parquet file.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderValue, Uri, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use roost_api::ids::SweepId;
use roost_api::problem::Problem;
use roost_api::sweep::SweepView;
use roost_api::table::{PointRow, TrialRow};
use serde::{Deserialize, Serialize};
use utoipa::openapi::schema::Object;
use utoipa::{IntoParams, ToSchema};

use super::blocking::run_blocking;
use super::extract::{Params, Segments};
use super::page::{RowRange, link_to_next, rows_schema};
use super::posteriors;
use super::problem::{ApiError, ProblemKind};
use super::sweeps::view;
use crate::queue::Refusal;
use crate::state::App;
use crate::store::{Subject, TrialPlace};
use crate::sweep::{self, Posterior};

/// Maximum of trials in memory.
const CHUNK: u32 = 500;

/// Maximum number of rows of a page.
const MAX_ROWS: u32 = 5000;

/// The format of a result table.
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

/// The meaning of a row of the result table.
#[derive(Clone, Copy, Default, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum By {
    /// A trial.
    #[default]
    Trial,
    /// A design point: statistics over its replicates.
    Point,
}

/// Query of a result table.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct TableQuery {
    /// Format; the default is `json`.
    #[serde(default)]
    #[param(inline)]
    format: TableFormat,
    /// Meaning of a row; the default is `trial`.
    #[serde(default)]
    #[param(inline)]
    by: By,
    /// Only these responses: names separated by commas.
    responses: Option<String>,
    /// `next_cursor` of the previous page.
    cursor: Option<String>,
    /// Maximum of rows of the page; the default is all rows.
    #[param(schema_with = all_schema)]
    limit: Option<u32>,
}

fn all_schema() -> Object {
    rows_schema(MAX_ROWS, None)
}

/// Shows the result table of a sweep: a row per trial, or per design point with mean, deviation and 95 % interval.
#[utoipa::path(get, path = "/v1/sweeps/{id}/results", tag = "results", operation_id = "sweep_results",
    params(("id" = uuid::Uuid, Path, description = "The sweep"), TableQuery),
    responses((status = 200, description = "The table: `SweepResults`, or `SweepPoints` for `by=point`",
               content((Object = "application/json"), (String = "text/csv"),
                       (String = "application/vnd.apache.parquet"))),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn table(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    uri: Uri,
    Params(query): Params<TableQuery>,
) -> Result<Response, ApiError> {
    let sweep = view(&app, id).await?;
    let by_point = query.by == By::Point;
    let cursor = query.cursor.as_deref();
    let range = match by_point {
        true => RowRange::new(sweep.points, 1, cursor, query.limit, MAX_ROWS)?,
        false => RowRange::of_trials(&sweep, cursor, query.limit, MAX_ROWS)?,
    };
    let next_cursor = range.next_cursor();
    let selected = query.responses.map(|names| names.split(',').map(str::to_owned).collect::<Vec<_>>());
    // JSON rows contain the names.
    let responses = match (query.format, &selected) {
        (TableFormat::Json, _) => Vec::new(),
        (_, None) => responses(&app, id).await?.to_vec(),
        (_, Some(names)) => {
            // Only columns of points depend on the types of responses.
            let known = if by_point { responses(&app, id).await? } else { Arc::default() };
            let of = |name: &String| known.iter().find(|response| response.name == *name).cloned();
            names
                .iter()
                .map(|name| {
                    of(name).unwrap_or_else(|| sweep::Response { name: name.clone(), ..Default::default() })
                })
                .collect()
        }
    };
    let (drawn, is_drawn) = (sweep.runs_per_sample, sweep.runs_per_sample.is_some());
    let posterior = if is_drawn && !by_point { posteriors::of_sweep(&app, id).await? } else { None };
    let parameters = posterior.iter().flat_map(|samples| samples.parameters()).cloned().collect();
    let columns = Columns { factors: sweep.factors.clone(), parameters, responses, selected, is_drawn };
    let replicates = sweep.replicates;
    let rows = TableRows { app, id, by_point, replicates, runs_per_sample: drawn, posterior, range };
    let mut response = match query.format {
        TableFormat::Json => stream_table(
            json_head(&sweep, by_point)?,
            json_tail(next_cursor.as_deref()),
            rows,
            columns,
            json_rows,
        ),
        TableFormat::Csv => {
            let header = columns.csv(&Chunk::none(by_point), true)?;
            stream_table(header, Vec::new(), rows, columns, |columns, chunk, _| columns.csv(chunk, false))
        }
        TableFormat::Parquet => parquet(rows, columns).await?,
    };
    let media_type = match query.format {
        TableFormat::Json => "application/json",
        TableFormat::Csv => "text/csv; charset=utf-8",
        TableFormat::Parquet => "application/vnd.apache.parquet",
    };
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type));
    link_to_next(&mut response, &uri, next_cursor.as_deref());
    Ok(response)
}

/// The responses that results of a sweep have. Finding them reads every result, so they are cached per version.
async fn responses(app: &App, id: SweepId) -> Result<Arc<Vec<sweep::Response>>, ApiError> {
    let version = app.store.version(Subject::Sweep(id)).await?.ok_or(Refusal::NoSweep)?;
    if let Some(known) = app.sweep_responses.get(id, &version) {
        return Ok(known);
    }
    let found = Arc::new(app.store.responses(id).await?);
    app.sweep_responses.insert(id, version, found.clone());
    Ok(found)
}

/// Some rows of the table.
enum Chunk {
    Trials(Vec<TrialRow>),
    Points(Vec<PointRow>),
}

impl Chunk {
    fn none(by_point: bool) -> Self {
        if by_point { Self::Points(Vec::new()) } else { Self::Trials(Vec::new()) }
    }
}

/// The rows of a table that are still to be read.
pub(super) struct TableRows {
    app: App,
    id: SweepId,
    by_point: bool,
    replicates: u32,
    /// Replicates in a row that have the same parameters, if these come from a posterior.
    runs_per_sample: Option<u32>,
    /// The samples that trials drew, for rows of trials.
    posterior: Option<Posterior>,
    range: RowRange,
}

impl TableRows {
    /// Every design point of a sweep.
    pub(super) fn of_points(app: App, sweep: &SweepView) -> Result<Self, ApiError> {
        let range = RowRange::new(sweep.points, 1, None, None, MAX_ROWS)?;
        let (replicates, runs_per_sample) = (sweep.replicates, sweep.runs_per_sample);
        Ok(Self { app, id: sweep.id, by_point: true, replicates, runs_per_sample, posterior: None, range })
    }

    /// All trials of the next chunk of design points; none after the last.
    pub(super) async fn next_points(&mut self) -> Result<Option<Vec<TrialRow>>, ApiError> {
        let Some((TrialPlace { from: (first, _), .. }, points)) =
            self.range.take((CHUNK / self.replicates.max(1)).max(1))
        else {
            return Ok(None);
        };
        Ok(Some(self.app.store.trials_of(self.id, first..first + points).await?))
    }

    /// The next chunk; none after the last.
    async fn next(&mut self) -> Result<Option<Chunk>, ApiError> {
        if self.by_point {
            let Some(trials) = self.next_points().await? else { return Ok(None) };
            let drawn = self.runs_per_sample;
            return run_blocking(move || Some(Chunk::Points(sweep::by_point(&trials, drawn)))).await;
        }
        let Some((place, rows)) = self.range.take(CHUNK) else { return Ok(None) };
        let mut trials = self.app.store.trials_from(self.id, place, rows).await?;
        if let Some(posterior) = &self.posterior {
            trials.iter_mut().for_each(|trial| trial.parameters = posterior.drawn(trial.replicate));
        }
        Ok(Some(Chunk::Trials(trials)))
    }
}

/// The columns of a table.
struct Columns {
    factors: Vec<String>,
    /// Pointers of the parameters that trials drew from a posterior.
    parameters: Vec<String>,
    responses: Vec<sweep::Response>,
    /// Names of the selected responses; none selects all.
    selected: Option<Vec<String>>,
    /// Whether parameters were drawn from a posterior.
    is_drawn: bool,
}

impl Columns {
    fn of(&self, chunk: &Chunk) -> Vec<sweep::Column> {
        match chunk {
            Chunk::Trials(trials) => {
                sweep::of_trials(&self.factors, &self.parameters, &self.responses, trials)
            }
            Chunk::Points(points) => sweep::of_points(&self.factors, &self.responses, points, self.is_drawn),
        }
    }

    fn csv(&self, chunk: &Chunk, with_header: bool) -> Result<Vec<u8>, ApiError> {
        sweep::csv(&self.of(chunk), with_header).map_err(|error| unwritten(&error))
    }

    /// Removes responses that were not selected.
    fn select(&self, chunk: &mut Chunk) {
        let Some(selected) = &self.selected else { return };
        match chunk {
            Chunk::Trials(trials) => {
                trials.iter_mut().for_each(|trial| trial.responses.retain(|name, _| selected.contains(name)));
            }
            Chunk::Points(points) => {
                points.iter_mut().for_each(|point| point.responses.retain(|name, _| selected.contains(name)));
            }
        }
    }
}

/// Writes a chunk; the last argument is whether it is the first.
type Write = fn(&Columns, &Chunk, bool) -> Result<Vec<u8>, ApiError>;

/// Streams a table: head, chunks, tail. If reading fails in between, the answer ends early.
fn stream_table(head: Vec<u8>, tail: Vec<u8>, rows: TableRows, columns: Columns, write: Write) -> Response {
    let state = (Some(head), Some(tail), rows, columns, true);
    let chunks = stream::try_unfold(state, move |(head, tail, mut rows, columns, is_first)| async move {
        if let Some(head) = head {
            return Ok(Some((head, (None, tail, rows, columns, true))));
        }
        let chunk = rows.next().await.map_err(|error| broken(&error))?;
        let Some(mut chunk) = chunk else {
            return Ok(tail.map(|tail| (tail, (None, None, rows, columns, false))));
        };
        let written = run_blocking(move || {
            columns.select(&mut chunk);
            let bytes = write(&columns, &chunk, is_first);
            (bytes, columns)
        });
        let (bytes, columns) = written.await.map_err(|error| broken(&error))?;
        let bytes = bytes.map_err(|error| broken(&error))?;
        Ok::<_, std::io::Error>(Some((bytes, (None, tail, rows, columns, false))))
    });
    Body::from_stream(chunks).into_response()
}

fn broken(error: &ApiError) -> std::io::Error {
    tracing::error!(?error, "writing a table failed");
    std::io::Error::other("the table could not be read completely")
}

fn unwritten(error: &dyn std::fmt::Display) -> ApiError {
    ApiError::new(ProblemKind::Internal, format!("the table cannot be written: {error}"))
}

fn json_head(sweep: &SweepView, by_point: bool) -> Result<Vec<u8>, ApiError> {
    let mut head = br#"{"sweep":"#.to_vec();
    head.extend(json(sweep)?);
    head.extend(if by_point { br#","points":["# } else { br#","trials":["# });
    Ok(head)
}

fn json_tail(next_cursor: Option<&str>) -> Vec<u8> {
    format!(r#"],"next_cursor":{}}}"#, serde_json::json!(next_cursor)).into_bytes()
}

/// The rows as a JSON list without brackets.
fn json_rows(_: &Columns, chunk: &Chunk, is_first: bool) -> Result<Vec<u8>, ApiError> {
    let mut list = match chunk {
        Chunk::Trials(trials) => json(trials)?,
        Chunk::Points(points) => json(points)?,
    };
    list.pop();
    if !is_first && list.len() > 1 {
        list[0] = b',';
    } else {
        list.remove(0);
    }
    Ok(list)
}

fn json(value: &impl Serialize) -> Result<Vec<u8>, ApiError> {
    serde_json::to_vec(value).map_err(|error| unwritten(&error))
}

/// Parquet stores columns, whose types are known after the last row. Only values stay in memory.
async fn parquet(mut rows: TableRows, mut columns: Columns) -> Result<Response, ApiError> {
    let mut all = columns.of(&Chunk::none(rows.by_point));
    while let Some(chunk) = rows.next().await? {
        let extended = run_blocking(move || {
            all.iter_mut().zip(columns.of(&chunk)).for_each(|(column, more)| column.extend(more));
            (all, columns)
        });
        (all, columns) = extended.await?;
    }
    let bytes = run_blocking(move || sweep::to_parquet(all).map_err(|error| unwritten(&error)));
    Ok(bytes.await??.into_response())
}
