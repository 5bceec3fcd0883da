//! Extractors of body, path and query. Every failure is a problem document.

use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use roost_solver::scenario::{ScenarioError, read_json};
use serde::de::DeserializeOwned;
use serde_json::Value;
use tower_http::timeout::TimeoutError;

use super::blocking::run_blocking_if_long;
use super::problem::{ApiError, ProblemKind};
use crate::document::{DocumentType, read_document};

/// A JSON body of any shape.
pub(crate) struct Document(pub(crate) Value);

/// A JSON body of a known shape.
pub(crate) struct Body<T>(pub(crate) T);

/// The variable segments of the path.
pub(crate) struct Segments<T>(pub(crate) T);

/// The query string.
pub(crate) struct Params<T>(pub(crate) T);

/// The size limit of request bodies of a route, for the error text. A layer enforces it.
#[derive(Clone, Copy)]
pub(crate) struct BodyLimit(pub(crate) usize);

impl<S: Send + Sync> FromRequest<S> for Document {
    type Rejection = ApiError;

    async fn from_request(request: Request, state: &S) -> Result<Self, ApiError> {
        let bytes = json_bytes(request, state).await?;
        run_blocking_if_long(bytes.len(), move || parsed(&bytes)).await?.map(Self)
    }
}

impl<S: Send + Sync, T: DocumentType> FromRequest<S> for Body<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, state: &S) -> Result<Self, ApiError> {
        let bytes = json_bytes(request, state).await?;
        let length = bytes.len();
        let read = move || read_document(parsed(&bytes)?).map(Self).map_err(ApiError::faults);
        run_blocking_if_long(length, read).await?
    }
}

/// The body of a request that declares JSON.
pub(super) async fn json_bytes<S: Send + Sync>(request: Request, state: &S) -> Result<Bytes, ApiError> {
    if !declares_json(request.headers()) {
        return Err(ApiError::new(
            ProblemKind::NotJson,
            "the body must be JSON: send the header `content-type: application/json`",
        ));
    }
    whole_body(request, state).await
}

/// The body of a request, up to the limit of the route.
pub(super) async fn whole_body<S: Send + Sync>(request: Request, state: &S) -> Result<Bytes, ApiError> {
    let limit = request.extensions().get::<BodyLimit>().map_or(0, |limit| limit.0);
    Bytes::from_request(request, state).await.map_err(|error| unreadable(&error, limit))
}

/// Parses JSON. An error states the line.
pub(super) fn parsed(bytes: &[u8]) -> Result<Value, ApiError> {
    let text = str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
        ApiError::new(ProblemKind::Syntax, format!("line {line} of the body is not UTF-8: send UTF-8"))
    })?;
    read_json(text).map_err(|error| match error {
        ScenarioError::Syntax { .. } => ApiError::new(ProblemKind::Syntax, error.to_string()),
        ScenarioError::Faults(faults) => ApiError::faults(faults),
    })
}

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for Segments<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        match Path::from_request_parts(parts, state).await {
            Ok(Path(value)) => Ok(Self(value)),
            Err(rejection) => Err(ApiError::new(ProblemKind::InvalidPath, rejection.body_text())),
        }
    }
}

impl<S: Send + Sync, T: DeserializeOwned> FromRequestParts<S> for Params<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        match Query::from_request_parts(parts, state).await {
            Ok(Query(value)) => Ok(Self(value)),
            Err(rejection) => Err(ApiError::new(ProblemKind::InvalidQuery, rejection.body_text())),
        }
    }
}

/// Whether the body is declared as JSON. A foreign page cannot send this media type without a CORS preflight,
/// so it cannot submit to a server on the same machine.
fn declares_json(headers: &HeaderMap) -> bool {
    let media_type = media_type(headers);
    media_type == "application/json"
        || (media_type.starts_with("application/") && media_type.ends_with("+json"))
}

/// Refuses a body that is declared as none of these media types. A foreign page cannot send them without a
/// CORS preflight.
pub(super) fn check_media_type(
    headers: &HeaderMap,
    wanted: [&str; 2],
    refusal: ProblemKind,
) -> Result<(), ApiError> {
    if wanted.contains(&media_type(headers).as_str()) {
        return Ok(());
    }
    let detail = format!("the `content-type` is wrong: send `{}` or `{}`", wanted[0], wanted[1]);
    Err(ApiError::new(refusal, detail))
}

/// The declared media type in lower case; empty if none is declared.
fn media_type(headers: &HeaderMap) -> String {
    let declared = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    declared.unwrap_or_default().split(';').next().unwrap_or_default().trim().to_ascii_lowercase()
}

fn unreadable(rejection: &BytesRejection, limit: usize) -> ApiError {
    if rejection.status() == ProblemKind::TooLarge.status() {
        let detail = format!(
            "the body is larger than {limit} bytes: send less, or ask the operator to raise the limit"
        );
        return ApiError::new(ProblemKind::TooLarge, detail);
    }
    incomplete_body(rejection)
}

/// The answer to a body that did not arrive completely.
pub(super) fn incomplete_body(error: &(dyn std::error::Error + 'static)) -> ApiError {
    let mut causes = std::iter::successors(Some(error), |error| error.source());
    if causes.any(|cause| cause.is::<TimeoutError>()) {
        return ApiError::new(ProblemKind::SlowBody, "the body paused for too long: send it again");
    }
    ApiError::new(ProblemKind::UnreadableBody, error.to_string())
}
