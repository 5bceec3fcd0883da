//! The result table of a sweep, written piece by piece: a large one is never whole in memory, but
//! for the values of a Parquet file.

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

use super::aside::aside;
use super::extract::{Params, Segments};
use super::page::{Places, link_to_next, rows_schema};
use super::problem::{ApiError, Kind};
use super::sweeps::view;
use crate::app::App;
use crate::queue::Refusal;
use crate::store::Subject;
use crate::sweep;

/// Trials that are in memory at a time.
const PIECE: u32 = 500;

/// Rows of the longest page, where pages are asked for.
const MAX_ROWS: u32 = 5000;

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

/// How to write the result table of a sweep, and how much of it.
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
    /// Only these responses: names with commas between.
    responses: Option<String>,
    /// `next_cursor` of the page before.
    cursor: Option<String>,
    /// Rows of the page; all unless given.
    #[param(schema_with = all_schema)]
    limit: Option<u32>,
}

fn all_schema() -> Object {
    rows_schema(MAX_ROWS, None)
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
    uri: Uri,
    Params(query): Params<TableQuery>,
) -> Result<Response, ApiError> {
    let sweep = view(&app, id).await?;
    let by_point = query.by == By::Point;
    let per_point = if by_point { 1 } else { sweep.replicates };
    let places = Places::new(sweep.points, per_point, query.cursor.as_deref(), query.limit, MAX_ROWS)?;
    let next_cursor = places.next_cursor();
    let asked = query.responses.map(|names| names.split(',').map(str::to_owned).collect::<Vec<_>>());
    // JSON carries its names itself.
    let responses = match (query.format, &asked) {
        (TableFormat::Json, _) => Vec::new(),
        (_, None) => responses(&app, id).await?.to_vec(),
        (_, Some(names)) => {
            // What they have been shows in columns of points alone.
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
    let columns = Columns { factors: sweep.factors.clone(), responses, asked };
    let rows = Rows { app, id, by_point, replicates: sweep.replicates, places };
    let mut response = match query.format {
        TableFormat::Json => {
            written(json_head(&sweep, by_point)?, json_tail(next_cursor.as_deref()), rows, columns, json_rows)
        }
        TableFormat::Csv => {
            let header = columns.csv(&Piece::none(by_point), true)?;
            written(header, Vec::new(), rows, columns, |columns, piece, _| columns.csv(piece, false))
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

/// The responses that results of a sweep have. Every result is looked at: once for all pages while there is no other.
async fn responses(app: &App, id: SweepId) -> Result<Arc<Vec<sweep::Response>>, ApiError> {
    let version = app.store.version(Subject::Sweep(id)).await?.ok_or(Refusal::NoSweep)?;
    if let Some(known) = app.responses.get(id, &version) {
        return Ok(known);
    }
    let found = Arc::new(app.store.responses(id).await?);
    app.responses.put(id, version, found.clone());
    Ok(found)
}

/// Some rows of the table.
enum Piece {
    Trials(Vec<TrialRow>),
    Points(Vec<PointRow>),
}

impl Piece {
    fn none(by_point: bool) -> Self {
        if by_point { Self::Points(Vec::new()) } else { Self::Trials(Vec::new()) }
    }
}

/// Rows that are still to be read.
pub(super) struct Rows {
    app: App,
    id: SweepId,
    by_point: bool,
    replicates: u32,
    places: Places,
}

impl Rows {
    /// Every design point of a sweep.
    pub(super) fn of_points(app: App, sweep: &SweepView) -> Result<Self, ApiError> {
        let places = Places::new(sweep.points, 1, None, None, MAX_ROWS)?;
        Ok(Self { app, id: sweep.id, by_point: true, replicates: sweep.replicates, places })
    }

    /// The next design points; none after the last.
    pub(super) async fn next_points(&mut self) -> Result<Option<Vec<PointRow>>, ApiError> {
        let Some(((first, _), points)) = self.places.take((PIECE / self.replicates.max(1)).max(1)) else {
            return Ok(None);
        };
        let trials = self.app.store.trials_of(self.id, first..first + points).await?;
        aside(move || sweep::by_point(&trials)).await.map(Some)
    }

    /// The next piece; none after the last.
    async fn next(&mut self) -> Result<Option<Piece>, ApiError> {
        if self.by_point {
            return Ok(self.next_points().await?.map(Piece::Points));
        }
        let Some((place, rows)) = self.places.take(PIECE) else { return Ok(None) };
        Ok(Some(Piece::Trials(self.app.store.trials_from(self.id, place, rows).await?)))
    }
}

/// What a row has.
struct Columns {
    factors: Vec<String>,
    responses: Vec<sweep::Response>,
    /// Only these, if only some.
    asked: Option<Vec<String>>,
}

impl Columns {
    fn of(&self, piece: &Piece) -> Vec<sweep::Column> {
        match piece {
            Piece::Trials(trials) => sweep::of_trials(&self.factors, &self.responses, trials),
            Piece::Points(points) => sweep::of_points(&self.factors, &self.responses, points),
        }
    }

    fn csv(&self, piece: &Piece, with_header: bool) -> Result<Vec<u8>, ApiError> {
        sweep::csv(&self.of(piece), with_header).map_err(|error| unwritten(&error))
    }

    /// Leaves only what was asked for.
    fn narrow(&self, piece: &mut Piece) {
        let Some(asked) = &self.asked else { return };
        match piece {
            Piece::Trials(trials) => {
                trials.iter_mut().for_each(|trial| trial.responses.retain(|name, _| asked.contains(name)));
            }
            Piece::Points(points) => {
                points.iter_mut().for_each(|point| point.responses.retain(|name, _| asked.contains(name)));
            }
        }
    }
}

/// How a piece is written; whether it is the first.
type Write = fn(&Columns, &Piece, bool) -> Result<Vec<u8>, ApiError>;

/// The table as it is read: a head, piece after piece, a tail. When reading fails in between, the answer breaks off.
fn written(head: Vec<u8>, tail: Vec<u8>, rows: Rows, columns: Columns, write: Write) -> Response {
    let state = (Some(head), Some(tail), rows, columns, true);
    let pieces = stream::try_unfold(state, move |(head, tail, mut rows, columns, is_first)| async move {
        if let Some(head) = head {
            return Ok(Some((head, (None, tail, rows, columns, true))));
        }
        let piece = rows.next().await.map_err(|error| broken(&error))?;
        let Some(mut piece) = piece else {
            return Ok(tail.map(|tail| (tail, (None, None, rows, columns, false))));
        };
        let written = aside(move || {
            columns.narrow(&mut piece);
            let bytes = write(&columns, &piece, is_first);
            (bytes, columns)
        });
        let (bytes, columns) = written.await.map_err(|error| broken(&error))?;
        let bytes = bytes.map_err(|error| broken(&error))?;
        Ok::<_, std::io::Error>(Some((bytes, (None, tail, rows, columns, false))))
    });
    Body::from_stream(pieces).into_response()
}

fn broken(error: &ApiError) -> std::io::Error {
    tracing::error!(?error, "a table broke off");
    std::io::Error::other("the table could not be read to its end")
}

fn unwritten(error: &dyn std::fmt::Display) -> ApiError {
    ApiError::new(Kind::Internal, format!("the table cannot be written: {error}"))
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

/// The rows of a list, without its brackets.
fn json_rows(_: &Columns, piece: &Piece, is_first: bool) -> Result<Vec<u8>, ApiError> {
    let mut list = match piece {
        Piece::Trials(trials) => json(trials)?,
        Piece::Points(points) => json(points)?,
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

/// Parquet goes by columns, and what each holds shows when all rows are read: of rows nothing is kept but the values.
async fn parquet(mut rows: Rows, mut columns: Columns) -> Result<Response, ApiError> {
    let mut all = columns.of(&Piece::none(rows.by_point));
    while let Some(piece) = rows.next().await? {
        let extended = aside(move || {
            all.iter_mut().zip(columns.of(&piece)).for_each(|(column, more)| column.extend(more));
            (all, columns)
        });
        (all, columns) = extended.await?;
    }
    let bytes = aside(move || sweep::to_parquet(all).map_err(|error| unwritten(&error)));
    Ok(bytes.await??.into_response())
}
