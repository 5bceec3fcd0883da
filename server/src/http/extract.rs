//! Reading requests: body, path and query, every failure a problem document.

use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use roost_solver::scenario::{ScenarioError, read_json};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use tower_http::timeout::TimeoutError;

use super::aside::unless_short;
use super::problem::{ApiError, Kind};
use crate::document::read_document;

/// A JSON body, not yet given a shape.
pub(crate) struct Document(pub(crate) Value);

/// A JSON body of a known shape.
pub(crate) struct Body<T>(pub(crate) T);

/// The variable segments of the path.
pub(crate) struct Segments<T>(pub(crate) T);

/// The query string.
pub(crate) struct Params<T>(pub(crate) T);

/// The size limit of the bodies of a route, which its layer also enforces: kept to be named in the answer.
#[derive(Clone, Copy)]
pub(crate) struct BodyLimit(pub(crate) usize);

impl<S: Send + Sync> FromRequest<S> for Document {
    type Rejection = ApiError;

    async fn from_request(request: Request, state: &S) -> Result<Self, ApiError> {
        let bytes = json_bytes(request, state).await?;
        unless_short(bytes.len(), move || parsed(&bytes)).await?.map(Self)
    }
}

impl<S: Send + Sync, T: DeserializeOwned + Serialize + Send + 'static> FromRequest<S> for Body<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, state: &S) -> Result<Self, ApiError> {
        let bytes = json_bytes(request, state).await?;
        let length = bytes.len();
        let read = move || read_document(parsed(&bytes)?).map(Self).map_err(ApiError::faults);
        unless_short(length, read).await?
    }
}

/// The bytes of a body that is declared as JSON.
pub(super) async fn json_bytes<S: Send + Sync>(request: Request, state: &S) -> Result<Bytes, ApiError> {
    if !says_json(request.headers()) {
        return Err(ApiError::new(Kind::NotJson, "send the header `content-type: application/json`"));
    }
    whole_body(request, state).await
}

/// The bytes of a body, up to the limit of the route.
pub(super) async fn whole_body<S: Send + Sync>(request: Request, state: &S) -> Result<Bytes, ApiError> {
    let limit = request.extensions().get::<BodyLimit>().map_or(0, |limit| limit.0);
    Bytes::from_request(request, state).await.map_err(|error| unread(&error, limit))
}

/// The JSON value that the bytes spell, or where they do not.
pub(super) fn parsed(bytes: &[u8]) -> Result<Value, ApiError> {
    let text = str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
        ApiError::new(Kind::Syntax, format!("the body is not UTF-8 (line {line})"))
    })?;
    read_json(text).map_err(|error| match error {
        ScenarioError::Syntax { .. } => ApiError::new(Kind::Syntax, error.to_string()),
        ScenarioError::Faults(faults) => ApiError::faults(faults),
    })
}

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for Segments<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        match Path::from_request_parts(parts, state).await {
            Ok(Path(value)) => Ok(Self(value)),
            Err(rejection) => Err(ApiError::new(Kind::InvalidPath, rejection.body_text())),
        }
    }
}

impl<S: Send + Sync, T: DeserializeOwned> FromRequestParts<S> for Params<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        match Query::from_request_parts(parts, state).await {
            Ok(Query(value)) => Ok(Self(value)),
            Err(rejection) => Err(ApiError::new(Kind::InvalidQuery, rejection.body_text())),
        }
    }
}

/// Whether the body is declared as JSON. A page in a browser cannot send that elsewhere without asking first, which
/// keeps strange pages from submitting to a server on this machine.
fn says_json(headers: &HeaderMap) -> bool {
    let media_type = media_type(headers);
    media_type == "application/json"
        || (media_type.starts_with("application/") && media_type.ends_with("+json"))
}

/// Refuses a body that is declared as neither the one nor the other. Like JSON, a page in a browser cannot send what is asked for
/// elsewhere without asking first.
pub(super) fn declared_as(headers: &HeaderMap, wanted: [&str; 2], refusal: Kind) -> Result<(), ApiError> {
    if wanted.contains(&media_type(headers).as_str()) {
        return Ok(());
    }
    let detail = format!("send the header `content-type: {}`, or `{}`", wanted[0], wanted[1]);
    Err(ApiError::new(refusal, detail))
}

/// What the body is declared as, in small letters; empty when it is not.
fn media_type(headers: &HeaderMap) -> String {
    let declared = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    declared.unwrap_or_default().split(';').next().unwrap_or_default().trim().to_ascii_lowercase()
}

fn unread(rejection: &BytesRejection, limit: usize) -> ApiError {
    if rejection.status() == Kind::TooLarge.status() {
        let detail = format!("the body is larger than {limit} bytes; the operator can set this limit");
        return ApiError::new(Kind::TooLarge, detail);
    }
    broken_off(rejection)
}

/// What a body is answered with that did not arrive whole.
pub(super) fn broken_off(error: &(dyn std::error::Error + 'static)) -> ApiError {
    let mut causes = std::iter::successors(Some(error), |error| error.source());
    if causes.any(|cause| cause.is::<TimeoutError>()) {
        return ApiError::new(Kind::SlowBody, "nothing of the body arrived for too long: send it again");
    }
    ApiError::new(Kind::UnreadableBody, error.to_string())
}
