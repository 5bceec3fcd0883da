//! `Idempotency-Key`: a repeated submission creates nothing new and gets the first answer again.
//!
//! The identifier of the new object is reserved in a transaction of its own before the object is created.
//! After a crash, or while the first request is still running, a repeat uses the same identifier, and the
//! store creates nothing twice.

use axum::body::{Body, Bytes};
use axum::extract::{FromRequestParts, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::convert::Infallible;
use uuid::Uuid;

use super::extract::whole_body;
use super::problem::{ApiError, ProblemKind};
use crate::state::{App, Caller};
use crate::store::{IdempotentRequest, StoredResponse, SubmissionState};

const KEY: HeaderName = HeaderName::from_static("idempotency-key");
const REPLAYED: HeaderName = HeaderName::from_static("idempotency-replayed");
/// Maximum length of an answer, in bytes. Answers to submissions are shorter.
const MAX_ANSWER_BYTES: usize = 1024 * 1024;

/// The identifier that was reserved for the object of this request, if any.
#[derive(Clone, Copy)]
pub(crate) struct Reserved(Option<Uuid>);

impl Reserved {
    /// The reserved identifier, or a new one.
    pub(crate) fn id(self) -> Uuid {
        self.0.unwrap_or_else(Uuid::now_v7)
    }

    /// The reserved identifier; none for a request without a key.
    pub(crate) fn known(self) -> Option<Uuid> {
        self.0
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Reserved {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        Ok(parts.extensions.get::<Self>().copied().unwrap_or(Self(None)))
    }
}

/// Middleware of submissions: finds the stored answer of a repeated key, or stores the new answer.
pub(crate) async fn once(State(app): State<App>, request: Request, next: Next) -> Response {
    match answer_once(&app, request, next).await {
        Ok(response) => response,
        Err(error) => error.into_response(),
    }
}

async fn answer_once(app: &App, request: Request, next: Next) -> Result<Response, ApiError> {
    let Some(key) = key(request.headers())? else { return Ok(next.run(request).await) };
    let owner = request.extensions().get::<Caller>().map_or("", |caller| &caller.token).to_owned();
    let (parts, body) = request.into_parts();
    let bytes = whole_body(Request::from_parts(parts.clone(), body), app).await?;
    let submission = IdempotentRequest { token_id: owner, key, fingerprint: fingerprint(&parts, &bytes) };
    let reserved = match app.store.submission(submission.clone(), app.clock.now()).await? {
        SubmissionState::Reserved(id) => id,
        SubmissionState::Answered(answered) => return Ok(stored_answer(answered)),
        SubmissionState::Other => {
            let detail = "this Idempotency-Key was used for another request: send a new key";
            return Err(ApiError::new(ProblemKind::KeyReused, detail));
        }
    };
    let mut request = Request::from_parts(parts, Body::from(bytes));
    request.extensions_mut().insert(Reserved(Some(reserved)));
    let response = next.run(request).await;
    if !response.status().is_success() {
        // Nothing was created: the corrected request may use the same key.
        if response.status().is_client_error() {
            app.store.drop_submission(submission).await?;
        }
        return Ok(response);
    }
    let (parts, body) = response.into_parts();
    let text = axum::body::to_bytes(body, MAX_ANSWER_BYTES).await;
    let text = text.map_err(|error| ApiError::new(ProblemKind::Internal, error.to_string()))?;
    let location = parts.headers.get(header::LOCATION).and_then(|value| value.to_str().ok());
    let answered = StoredResponse {
        status: parts.status.as_u16(),
        location: location.map(str::to_owned),
        body: String::from_utf8_lossy(&text).into_owned(),
    };
    app.store.answer_submission(submission, answered).await?;
    Ok(Response::from_parts(parts, Body::from(text)))
}

fn key(headers: &HeaderMap) -> Result<Option<String>, ApiError> {
    let Some(value) = headers.get(KEY) else { return Ok(None) };
    match value.to_str() {
        Ok(key) if (1..=255).contains(&key.len()) => Ok(Some(key.to_owned())),
        _ => {
            let detail =
                "an Idempotency-Key must have 1 to 255 visible ASCII characters: send a UUID, for example";
            Err(ApiError::new(ProblemKind::InvalidKey, detail))
        }
    }
}

fn fingerprint(parts: &Parts, body: &Bytes) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(parts.method.as_str().as_bytes()).update(b" ");
    hasher.update(parts.uri.path_and_query().map_or("", |path| path.as_str()).as_bytes()).update(b"\n");
    hasher.update(body).finalize().to_hex().to_string()
}

fn stored_answer(answered: StoredResponse) -> Response {
    let status = StatusCode::from_u16(answered.status).unwrap_or(StatusCode::OK);
    let mut response = (status, [(header::CONTENT_TYPE, "application/json")], answered.body).into_response();
    let headers = response.headers_mut();
    headers.insert(REPLAYED, HeaderValue::from_static("true"));
    if let Some(location) = answered.location.and_then(|location| HeaderValue::try_from(location).ok()) {
        headers.insert(header::LOCATION, location);
    }
    response
}
