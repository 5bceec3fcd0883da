//! The result table of a sweep, written in chunks: a large table is never in memory as a whole, except for
//! the values of a Parquet file. `workbooks` writes it for Excel.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderValue, Uri, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use roost_api::ids::SweepId;
use roost_api::problem::Problem;
use roost_api::sweep::SweepView;
use serde::{Deserialize, Serialize};

use super::blocking::run_blocking;
use super::extract::{Params, Segments};
use super::page::{RowRange, link_to_next};
use super::posteriors;
use super::problem::ApiError;
use super::sweeps::view;
use super::table_columns::{Chunk, TableColumns, unwritten};
use super::table_query::{By, MAX_ROWS, TableFormat, TableQuery};
use super::table_rows::TableRows;
use super::workbooks;
use crate::queue::Refusal;
use crate::state::App;
use crate::store::Subject;
use crate::sweep;

/// Shows the result table of a sweep: a row per trial, or per design point with mean, deviation and 95 % interval.
#[utoipa::path(get, path = "/v1/sweeps/{id}/results", tag = "results", operation_id = "sweep_results",
    params(("id" = uuid::Uuid, Path, description = "The sweep"), TableQuery),
    responses((status = 200, description = "The table: `SweepResults`, or `SweepPoints` for `by=point`",
               content((Object = "application/json"), (String = "text/csv"),
                       (String = "application/vnd.apache.parquet"),
                       (String = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"))),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn table(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    uri: Uri,
    Params(query): Params<TableQuery>,
) -> Result<Response, ApiError> {
    query.check()?;
    let sweep = view(&app, id).await?;
    let (format, by_point) = (query.format, query.by == By::Point || query.format == TableFormat::Xlsx);
    let cursor = query.cursor.as_deref();
    let range = match by_point {
        true => RowRange::new(sweep.points, 1, cursor, query.limit, MAX_ROWS)?,
        false => RowRange::of_trials(&sweep, cursor, query.limit, MAX_ROWS)?,
    };
    let next_cursor = range.next_cursor();
    let selected = query.selected();
    // JSON rows contain the names.
    let mut responses = match (format, &selected) {
        (TableFormat::Json, _) => Vec::new(),
        (_, None) => responses(&app, id).await?.to_vec(),
        (_, Some(names)) => {
            // Only columns of points depend on the types of responses.
            let known = if by_point { responses(&app, id).await? } else { Arc::default() };
            let of = |name: &String| known.iter().find(|response| response.name == *name).cloned();
            names
                .iter()
                .map(|name| {
                    of(name)
                        .unwrap_or_else(|| sweep::SweepResponse { name: name.clone(), ..Default::default() })
                })
                .collect()
        }
    };
    let (drawn, is_drawn) = (sweep.runs_per_sample, sweep.runs_per_sample.is_some());
    let has_trials = !by_point || format == TableFormat::Xlsx;
    let posterior = if is_drawn && has_trials { posteriors::of_sweep(&app, id).await? } else { None };
    let experiment = if query.has_units() { experiment(&app, id).await? } else { None };
    if format == TableFormat::Xlsx && selected.is_none() {
        sweep::headline_first(&mut responses, experiment.as_deref());
    }
    let columns = TableColumns {
        factors: sweep.factors.clone(),
        parameters: posterior.iter().flat_map(|samples| samples.parameters()).cloned().collect(),
        responses,
        selected,
        is_drawn,
        has_short_names: query.has_short_names(),
        experiment,
    };
    let replicates = sweep.replicates;
    let rows = TableRows { app, id, by_point, replicates, runs_per_sample: drawn, posterior, range };
    let mut response = match format {
        TableFormat::Json => stream_table(
            json_head(&sweep, by_point)?,
            json_tail(next_cursor.as_deref()),
            rows,
            columns,
            json_rows,
        ),
        TableFormat::Csv => {
            let header = columns.csv_head(by_point, query.units)?;
            stream_table(header, Vec::new(), rows, columns, |columns, chunk, _| columns.csv(chunk))
        }
        TableFormat::Parquet => parquet(rows, columns).await?,
        TableFormat::Xlsx => workbooks::write(&sweep, rows, columns).await?,
    };
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(format.media_type()));
    link_to_next(&mut response, &uri, next_cursor.as_deref());
    Ok(response)
}

/// The experiment of a sweep. Calibrations have several.
async fn experiment(app: &App, id: SweepId) -> Result<Option<String>, ApiError> {
    #[derive(Deserialize)]
    struct Base {
        experiment: Option<String>,
    }
    #[derive(Deserialize)]
    struct Spec {
        base: Option<Base>,
    }
    let text = app.store.sweep_spec(id).await?.ok_or(Refusal::NoSweep)?;
    Ok(serde_json::from_str(&text).ok().and_then(|spec: Spec| spec.base?.experiment))
}

/// The responses that results of a sweep have. Finding them reads every result, so they are cached per version.
async fn responses(app: &App, id: SweepId) -> Result<Arc<Vec<sweep::SweepResponse>>, ApiError> {
    let version = app.store.version(Subject::Sweep(id)).await?.ok_or(Refusal::NoSweep)?;
    if let Some(known) = app.sweep_responses.get(id, &version) {
        return Ok(known);
    }
    let found = Arc::new(app.store.responses(id).await?);
    app.sweep_responses.insert(id, version, found.clone());
    Ok(found)
}

/// Writes a chunk; the last argument is whether it is the first.
type Write = fn(&TableColumns, &Chunk, bool) -> Result<Vec<u8>, ApiError>;

/// Streams a table: head, chunks, tail. If reading fails in between, the answer ends early.
fn stream_table(
    head: Vec<u8>,
    tail: Vec<u8>,
    rows: TableRows,
    columns: TableColumns,
    write: Write,
) -> Response {
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
fn json_rows(_: &TableColumns, chunk: &Chunk, is_first: bool) -> Result<Vec<u8>, ApiError> {
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
async fn parquet(mut rows: TableRows, mut columns: TableColumns) -> Result<Response, ApiError> {
    let mut all = columns.of(&Chunk::none(rows.by_point));
    while let Some(chunk) = rows.next().await? {
        let extended = run_blocking(move || {
            all.iter_mut().zip(columns.of(&chunk)).for_each(|(column, more)| column.extend(more));
            (all, columns)
        });
        (all, columns) = extended.await?;
    }
    let names = columns.names(&all);
    let units = names.iter().cloned().zip(columns.units(&all));
    let units: BTreeMap<String, String> = units.filter(|(_, unit)| !unit.is_empty()).collect();
    let all = all.into_iter().zip(names).map(|(column, name)| column.renamed(name)).collect();
    let bytes = run_blocking(move || sweep::to_parquet(all, &units).map_err(|error| unwritten(&error)));
    Ok(bytes.await??.into_response())
}
