//! Listing: limits, cursors and label filters that all listings share.

use roost_api::page::Page;
use serde::de::{Deserialize, Deserializer, Error};

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

/// A page whose cursor is a word of ours.
pub(crate) fn page<T>(items: Vec<T>, next: Option<impl std::fmt::Display>) -> Page<T> {
    Page { items, next_cursor: next.map(|next| next.to_string()) }
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
