//! The results of a sweep as a workbook of Excel: sheets of points, jobs, units, and of the answer if the sweep belongs to a study.

use std::fs::File;
use std::io::Read;

use axum::body::Body;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures_util::stream;
use roost_api::sweep::SweepView;
use serde_json::json;

use super::blocking::run_blocking;
use super::problem::{ApiError, ProblemKind};
use super::studies::view_of;
use super::table_columns::{Chunk, TableColumns, unwritten};
use super::table_rows::TableRows;
use crate::study::sentences;
use crate::sweep::{self, unit_of};
use crate::workbook::{MAX_COLUMNS, MAX_ROWS, ResultWorkbook, SheetId};

/// Bytes of the file that are read at once.
const PART_BYTES: usize = 256 * 1024;

/// A workbook, and its sheets of points and of jobs.
type Book = (ResultWorkbook, SheetId, SheetId);

/// Writes a workbook to a temporary file and answers with it. Each chunk of design points goes to both sheets, so every result is read once.
pub(super) async fn write(
    sweep: &SweepView,
    mut rows: TableRows,
    columns: TableColumns,
) -> Result<Response, ApiError> {
    check_size(sweep.counts.total(), &columns)?;
    let (app, folder, drawn) = (rows.app.clone(), rows.app.config.data.clone(), rows.runs_per_sample);
    let begun = run_blocking(move || {
        let points = columns.names(&columns.of(&Chunk::none(true)));
        let jobs = columns.names(&columns.of(&Chunk::none(false)));
        let mut book = ResultWorkbook::new(&folder)?;
        let sheets = (book.add_sheet("points", &points, &[])?, book.add_sheet("jobs", &jobs, &[(0, 38)])?);
        Ok::<_, rust_xlsxwriter::XlsxError>(((book, sheets.0, sheets.1), columns))
    });
    let (mut book, mut columns): (Book, _) = begun.await?.map_err(|error| unwritten(&error))?;
    while let Some(trials) = rows.next_points().await? {
        let added = run_blocking(move || {
            let points = columns.of(&Chunk::Points(sweep::by_point(&trials, drawn)));
            book.0.add_rows(book.1, &points)?;
            book.0.add_rows(book.2, &columns.of(&Chunk::Trials(trials)))?;
            Ok::<_, rust_xlsxwriter::XlsxError>((book, columns))
        });
        (book, columns) = added.await?.map_err(|error| unwritten(&error))?;
    }
    let study = if sweep.is_study { Some(view_of(&app, sweep.id).await?) } else { None };
    let finished = run_blocking(move || {
        let mut book = book.0;
        add_units(&mut book, &columns)?;
        if let Some(study) = study {
            let sheet =
                book.add_sheet("answer", &["part", "text"].map(str::to_owned), &[(0, 14), (1, 110)])?;
            book.add_row(sheet, [&json!("question"), &json!(study.question)])?;
            let (state, answer) = study.answer.split_last().unwrap_or((&study.name, &[]));
            for (part, sentence) in sentences::parts(answer) {
                book.add_row(sheet, [&json!(part), &json!(sentence)])?;
            }
            book.add_row(sheet, [&json!("state"), &json!(state)])?;
        }
        book.finish()
    });
    let file = finished.await?.map_err(|error| unwritten(&error))?;
    stream_file(file)
}

/// Refuses more rows or columns than a sheet can have.
fn check_size(jobs: u64, columns: &TableColumns) -> Result<(), ApiError> {
    let widest = [true, false].map(|by_point| columns.of(&Chunk::none(by_point)).len()).into_iter().max();
    let detail = if jobs > MAX_ROWS {
        format!(
            "a sheet of Excel has at most {MAX_ROWS} rows below its header, and the sweep has {jobs} jobs: use format=parquet or format=csv"
        )
    } else if widest > Some(MAX_COLUMNS) {
        format!("a sheet of Excel has at most {MAX_COLUMNS} columns: select some with `responses`")
    } else {
        return Ok(());
    };
    Err(ApiError::new(ProblemKind::InvalidQuery, detail))
}

/// Adds the sheet of units: a row for each column of both tables.
fn add_units(book: &mut ResultWorkbook, columns: &TableColumns) -> Result<(), rust_xlsxwriter::XlsxError> {
    let header = ["sheet", "column", "unit", "meaning", "field"].map(str::to_owned);
    let sheet = book.add_sheet("units", &header, &[(1, 40), (3, 90), (4, 40)])?;
    for (name, by_point) in [("points", true), ("jobs", false)] {
        let table = columns.of(&Chunk::none(by_point));
        for (column, short) in table.iter().zip(columns.names(&table)) {
            let about = unit_of(column.name(), columns.experiment.as_deref());
            let field = if column.name().starts_with('/') { column.name() } else { "" };
            let cells = [name, &short, &about.unit, &about.meaning, field].map(|text| match text {
                "" => json!(null),
                text => json!(text),
            });
            book.add_row(sheet, &cells)?;
        }
    }
    Ok(())
}

/// Answers with a file from its beginning.
fn stream_file(file: File) -> Result<Response, ApiError> {
    let length = file.metadata().map_err(|error| unwritten(&error))?.len();
    let parts = stream::try_unfold(file, |mut file| async {
        let read = run_blocking(move || {
            let mut part = Vec::with_capacity(PART_BYTES);
            file.by_ref().take(PART_BYTES as u64).read_to_end(&mut part).map(|_| (part, file))
        });
        let (part, file) = read.await.map_err(|_| std::io::Error::other("the file could not be read"))??;
        Ok::<_, std::io::Error>((!part.is_empty()).then(|| (Bytes::from(part), file)))
    });
    Ok(([(header::CONTENT_LENGTH, length)], Body::from_stream(parts)).into_response())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_beyond_those_of_a_sheet_are_refused() {
        let columns = |responses: usize| TableColumns {
            factors: vec!["/equipment/gate_opening_m".to_owned()],
            parameters: Vec::new(),
            responses: (0..responses)
                .map(|number| sweep::SweepResponse {
                    name: format!("r{number}"),
                    has_numbers: true,
                    has_words: false,
                })
                .collect(),
            selected: None,
            is_drawn: false,
            has_short_names: true,
            experiment: None,
        };
        assert!(check_size(MAX_ROWS, &columns(1)).is_ok());
        assert!(check_size(MAX_ROWS + 1, &columns(1)).is_err());
        // Six columns before them, and five for each.
        assert!(check_size(1, &columns((MAX_COLUMNS - 6) / 5)).is_ok());
        assert!(check_size(1, &columns((MAX_COLUMNS - 6) / 5 + 1)).is_err());
    }
}
