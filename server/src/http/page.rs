//! Pages of lists: limits, cursors and label filters.

use axum::Json;
use axum::http::{HeaderValue, Uri, header};
use axum::response::{IntoResponse, Response};
use roost_api::page::Page;
use roost_api::sweep::SweepView;
use serde::Serialize;
use serde::de::{Deserialize, Deserializer, Error};
use utoipa::openapi::schema::{Object, ObjectBuilder, Type};

use super::problem::{ApiError, ProblemKind};
use crate::store::TrialPlace;

/// Default number of rows of a page.
const ROWS: u32 = 50;
/// Maximum number of rows of a page.
const MAX_ROWS: u32 = 500;

/// Checks `limit`, or takes the default.
pub(crate) fn limit(requested: Option<u32>) -> Result<u32, ApiError> {
    match requested.unwrap_or(ROWS) {
        rows @ 1..=MAX_ROWS => Ok(rows),
        rows => Err(ApiError::new(
            ProblemKind::InvalidQuery,
            format!("limit {rows} is out of range: allowed is 1 to {MAX_ROWS}"),
        )),
    }
}

/// Checks `cursor`: those of this server are not negative.
pub(crate) fn cursor(requested: Option<i64>) -> Result<Option<i64>, ApiError> {
    match requested {
        Some(negative @ ..0) => Err(ApiError::new(
            ProblemKind::InvalidQuery,
            format!("cursor {negative} is invalid: send `next_cursor` of a page"),
        )),
        valid => Ok(valid),
    }
}

/// `limit` of lists in the OpenAPI document.
pub(crate) fn limit_schema() -> Object {
    rows_schema(MAX_ROWS, Some(ROWS))
}

/// A number of rows in the OpenAPI document.
pub(crate) fn rows_schema(max: u32, default: Option<u32>) -> Object {
    let schema = ObjectBuilder::new().schema_type(Type::Integer).minimum(Some(1)).maximum(Some(max));
    schema.default(default.map(Into::into)).build()
}

/// A page of items with the cursor of the next page.
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
        return Err(D::Error::custom("a label filter must be `key` or `key=value`"));
    }
    Ok(Some((key.to_owned(), value)))
}

/// A range of rows of a table in the order of design point and replicate.
pub(crate) struct RowRange {
    /// Rows per design point. A sweep whose points have different numbers of trials counts as one point with all of them.
    per_point: u64,
    is_even: bool,
    next: u64,
    end: u64,
    all: u64,
}

impl RowRange {
    /// The trials of a sweep after a cursor, at most `limit` of them if given.
    pub(crate) fn of_trials(
        sweep: &SweepView,
        cursor: Option<&str>,
        limit: Option<u32>,
        max_rows: u32,
    ) -> Result<Self, ApiError> {
        let trials = sweep.counts.total();
        if trials == u64::from(sweep.points) * u64::from(sweep.replicates) {
            return Self::new(sweep.points, sweep.replicates, cursor, limit, max_rows);
        }
        let trials = u32::try_from(trials).unwrap_or(u32::MAX);
        Ok(Self { is_even: false, ..Self::new(1, trials, cursor, limit, max_rows)? })
    }

    /// The rows after a cursor, at most `limit` of them if given.
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
                let detail = format!("cursor {cursor} is invalid: send `next_cursor` of a page");
                return Err(ApiError::new(ProblemKind::InvalidQuery, detail));
            }
        };
        let end = match limit {
            None => all,
            Some(rows) if (1..=max_rows).contains(&rows) => all.min(next + u64::from(rows)),
            Some(rows) => {
                let detail = format!("limit {rows} is out of range: allowed is 1 to {max_rows}");
                return Err(ApiError::new(ProblemKind::InvalidQuery, detail));
            }
        };
        Ok(Self { per_point, is_even: true, next, end, all })
    }

    /// The cursor of the next page; none after the last.
    pub(crate) fn next_cursor(&self) -> Option<String> {
        (self.end < self.all).then(|| format!("{}.{}", self.end / self.per_point, self.end % self.per_point))
    }

    /// Takes up to `rows` rows: the place of the first, and their number.
    pub(crate) fn take(&mut self, rows: u32) -> Option<(TrialPlace, u32)> {
        let rows = u64::from(rows).min(self.end.checked_sub(self.next)?);
        let first = (self.next / self.per_point, self.next % self.per_point);
        self.next += rows;
        // None exceeds the number of points, of replicates, or `limit`, which are u32.
        let place = match self.is_even {
            // Replicates of a study need not begin at 0: rows of the point are skipped, whatever their replicates.
            true => TrialPlace { from: (first.0 as u32, 0), skip: first.1 as u32 },
            false => TrialPlace { from: (0, 0), skip: first.1 as u32 },
        };
        (rows > 0).then_some((place, rows as u32))
    }
}

/// Adds the header `link` to the next page: the same address with another cursor.
pub(crate) fn link_to_next(response: &mut Response, uri: &Uri, cursor: Option<&str>) {
    let Some(cursor) = cursor else { return };
    let parameters = uri.query().unwrap_or_default().split('&');
    let others = parameters.filter(|part| !part.is_empty() && !part.starts_with("cursor="));
    let query: Vec<_> = others.map(str::to_owned).chain([format!("cursor={cursor}")]).collect();
    let link = format!("<{}?{}>; rel=\"next\"", uri.path(), query.join("&"));
    if let Ok(link) = HeaderValue::try_from(link) {
        response.headers_mut().insert(header::LINK, link);
    }
}

#[cfg(test)]
mod tests {
    use super::{RowRange, TrialPlace};

    #[test]
    fn a_page_within_a_point_skips_rows_whatever_their_replicates() {
        // The replicates of a study that began with earlier runs are, for instance, 6 to 9.
        let mut rows = RowRange::new(2, 4, Some("1.3"), Some(7), 100).unwrap_or_else(|_| panic!("a range"));
        assert_eq!(rows.take(16), Some((TrialPlace { from: (1, 0), skip: 3 }, 1)));
        assert_eq!((rows.take(16), rows.next_cursor()), (None, None));
    }
}
