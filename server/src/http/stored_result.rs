//! Series of stored result documents, whose numbers are passed on as text.
//!
//! A document was checked when it was delivered. Parsing its numbers only to write them again would take most
//! of the time of a request.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use super::problem::{ApiError, ProblemKind};

/// One series of a document.
#[derive(Deserialize, Serialize)]
pub(super) struct StoredSeries<'a> {
    #[serde(borrow)]
    pub(super) name: Cow<'a, str>,
    #[serde(borrow)]
    pub(super) unit: Cow<'a, str>,
    #[serde(borrow)]
    pub(super) t_s: &'a RawValue,
    #[serde(borrow)]
    pub(super) values: &'a RawValue,
}

/// The series of a document.
pub(super) fn series_of(document: &str) -> Result<Vec<StoredSeries<'_>>, ApiError> {
    #[derive(Deserialize)]
    struct OnlySeries<'a> {
        #[serde(borrow)]
        series: Vec<StoredSeries<'a>>,
    }
    let stored: OnlySeries<'_> = serde_json::from_str(document).map_err(|error| unreadable(&error))?;
    Ok(stored.series)
}

/// Parses the times or the values of a series.
pub(super) fn numbers(text: &RawValue) -> Result<Vec<f64>, ApiError> {
    serde_json::from_str(text.get()).map_err(|error| unreadable(&error))
}

fn unreadable(error: &serde_json::Error) -> ApiError {
    ApiError::new(ProblemKind::Internal, format!("the stored result cannot be read: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_passed_on_as_they_are_stored() {
        let document = r#"{"schema": "x", "series": [{"name": "a\"b", "unit": "kg", "t_s": [0, 2e-2], "values": [1.50,2]}]}"#;
        let all = series_of(document).unwrap();
        let [series] = all.as_slice() else { panic!("{} series", all.len()) };
        assert_eq!((series.name.as_ref(), series.unit.as_ref()), ("a\"b", "kg"));
        assert_eq!((series.t_s.get(), series.values.get()), ("[0, 2e-2]", "[1.50,2]"));
        assert_eq!(numbers(series.t_s).unwrap(), [0.0, 0.02]);
    }
}
