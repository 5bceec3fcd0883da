//! Listing: limits, cursors and label filters that all listings share.

use axum::Json;
use axum::http::{HeaderValue, Uri, header};
use axum::response::{IntoResponse, Response};
use roost_api::page::Page;
use serde::Serialize;
use serde::de::{Deserialize, Deserializer, Error};
use utoipa::openapi::schema::{Object, ObjectBuilder, Type};

use super::problem::{ApiError, Kind};

/// Rows of a page unless asked for otherwise.
const ROWS: u32 = 50;
/// Rows of the longest page.
const MAX_ROWS: u32 = 500;

/// The number of rows to answer.
pub(crate) fn limit(asked: Option<u32>) -> Result<u32, ApiError> {
    match asked.unwrap_or(ROWS) {
        rows @ 1..=MAX_ROWS => Ok(rows),
        rows => Err(ApiError::new(Kind::InvalidQuery, format!("limit {rows} is not within 1 to {MAX_ROWS}"))),
    }
}

/// The place to go on from: a number of ours, and those are not negative.
pub(crate) fn cursor(given: Option<i64>) -> Result<Option<i64>, ApiError> {
    match given {
        Some(wrong @ ..0) => {
            Err(ApiError::new(Kind::InvalidQuery, format!("cursor {wrong} is no `next_cursor` of a page")))
        }
        given => Ok(given),
    }
}

/// `limit` of listings, in the specification.
pub(crate) fn limit_schema() -> Object {
    rows_schema(MAX_ROWS, Some(ROWS))
}

/// A number of rows, in the specification.
pub(crate) fn rows_schema(most: u32, unless_given: Option<u32>) -> Object {
    let schema = ObjectBuilder::new().schema_type(Type::Integer).minimum(Some(1)).maximum(Some(most));
    schema.default(unless_given.map(Into::into)).build()
}

/// A page whose cursor is a word of ours, which names the page after it.
pub(crate) fn page<T: Serialize>(uri: &Uri, items: Vec<T>, next: Option<impl std::fmt::Display>) -> Response {
    let page = Page { items, next_cursor: next.map(|next| next.to_string()) };
    let mut response = Json(&page).into_response();
    link_to_next(&mut response, uri, page.next_cursor.as_deref());
    response
}

/// Reads a label filter: `key=value`, or `key` alone for any value.
pub(crate) fn label<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<(String, Option<String>)>, D::Error> {
    let Some(text) = Option::<String>::deserialize(deserializer)? else { return Ok(None) };
    let (key, value) = match text.split_once('=') {
        Some((key, value)) => (key, Some(value.to_owned())),
        None => (text.as_str(), None),
    };
    if key.is_empty() {
        return Err(D::Error::custom("a label filter is `key` or `key=value`"));
    }
    Ok(Some((key.to_owned(), value)))
}

/// Rows of a table that goes by design point and replicate: where to begin, how many of them, what comes next.
pub(crate) struct Places {
    /// Rows of one point.
    per_point: u64,
    next: u64,
    end: u64,
    all: u64,
}

impl Places {
    /// The rows from a cursor on, at most `limit` of them; all without one.
    pub(crate) fn new(
        points: u32,
        per_point: u32,
        cursor: Option<&str>,
        limit: Option<u32>,
        max_rows: u32,
    ) -> Result<Self, ApiError> {
        let per_point = u64::from(per_point.max(1));
        let all = u64::from(points) * per_point;
        let place = |cursor: &str| {
            let (point, row) = cursor.split_once('.')?;
            Some((point.parse::<u32>().ok()?, row.parse::<u32>().ok()?))
        };
        let next = match cursor.map(|cursor| place(cursor).ok_or(cursor)) {
            None => 0,
            Some(Ok((point, row))) => u64::from(point) * per_point + u64::from(row).min(per_point),
            Some(Err(cursor)) => {
                let detail = format!("cursor {cursor} is no `next_cursor` of a page");
                return Err(ApiError::new(Kind::InvalidQuery, detail));
            }
        };
        let end = match limit {
            None => all,
            Some(rows) if (1..=max_rows).contains(&rows) => all.min(next + u64::from(rows)),
            Some(rows) => {
                let detail = format!("limit {rows} is not within 1 to {max_rows}");
                return Err(ApiError::new(Kind::InvalidQuery, detail));
            }
        };
        Ok(Self { per_point, next, end, all })
    }

    /// What the page after this one begins with; none after the last.
    pub(crate) fn next_cursor(&self) -> Option<String> {
        (self.end < self.all).then(|| format!("{}.{}", self.end / self.per_point, self.end % self.per_point))
    }

    /// The next rows, so many at most: point and row of the first, and their number.
    pub(crate) fn take(&mut self, rows: u32) -> Option<((u32, u32), u32)> {
        let rows = u64::from(rows).min(self.end.checked_sub(self.next)?);
        let first = (self.next / self.per_point, self.next % self.per_point);
        self.next += rows;
        // All three are no more than points, replicates and what was asked for.
        (rows > 0).then_some(((first.0 as u32, first.1 as u32), rows as u32))
    }
}

/// Names the page after this one in the `link` header: the same address with another cursor.
pub(crate) fn link_to_next(response: &mut Response, uri: &Uri, cursor: Option<&str>) {
    let Some(cursor) = cursor else { return };
    let asked = uri.query().unwrap_or_default().split('&');
    let others = asked.filter(|part| !part.is_empty() && !part.starts_with("cursor="));
    let query: Vec<_> = others.map(str::to_owned).chain([format!("cursor={cursor}")]).collect();
    let link = format!("<{}?{}>; rel=\"next\"", uri.path(), query.join("&"));
    if let Ok(link) = HeaderValue::try_from(link) {
        response.headers_mut().insert(header::LINK, link);
    }
}
