//! `etag` of answers that clients poll, and `304` for unchanged ones.
//!
//! An etag is made from version numbers, each one index lookup, and never from the body: polling an unchanged
//! object reads no body. It is made before the body is read, so that the next poll sees a change in between.

use axum::RequestExt;
use axum::extract::{MatchedPath, Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::collections::HashMap;

use super::problem::ApiError;
use crate::state::App;
use crate::store::Subject;

/// Maximum age of the reason why a queued job waits, in an answer that counts as unchanged.
const WAITING_AGE_MS: i64 = 5000;

/// The subject of a route; none for routes without an etag or with an etag of their own.
fn subject(path: &str, segments: &HashMap<String, String>) -> Option<Subject> {
    let rest = path.strip_prefix("/v1/")?;
    match rest {
        "jobs" | "sweeps" => Some(Subject::Everything),
        "studies" => Some(Subject::Studies),
        "workers" => Some(Subject::Workers),
        "meshes" => Some(Subject::Meshes),
        _ if ["/events", "/frames", "/checkpoint", "/fill", "/forecast"]
            .iter()
            .any(|end| rest.ends_with(end)) =>
        {
            None
        }
        _ if rest.starts_with("jobs/{id}") => segments.get("id")?.parse().ok().map(Subject::Job),
        _ if rest.starts_with("studies/{id}") => segments.get("id")?.parse().ok().map(Subject::Study),
        _ if rest.starts_with("sweeps/{id}") => segments.get("id")?.parse().ok().map(Subject::Sweep),
        _ => None,
    }
}

/// Whether answers of a route have such an etag.
pub(super) fn has_etag(path: &str) -> bool {
    let some = HashMap::from([("id".to_owned(), uuid::Uuid::nil().to_string())]);
    subject(path, &some).is_some()
}

/// Middleware: answers 304 if the client has the newest version, and adds the etag to other answers.
pub(crate) async fn add_etag(State(app): State<App>, mut request: Request, next: Next) -> Response {
    if request.method() != Method::GET {
        return next.run(request).await;
    }
    let Some(path) = request.extensions().get::<MatchedPath>().cloned() else {
        return next.run(request).await;
    };
    let segments = request.extract_parts::<Path<HashMap<String, String>>>().await;
    let segments = segments.map(|Path(segments)| segments).unwrap_or_default();
    let Some(subject) = subject(path.as_str(), &segments) else { return next.run(request).await };
    let etag = match etag_of(&app, subject).await {
        Ok(Some(etag)) => etag,
        // The object does not exist: the handler answers 404.
        Ok(None) => return next.run(request).await,
        Err(error) => return error.into_response(),
    };
    if matches_etag(request.headers(), &etag) {
        return (StatusCode::NOT_MODIFIED, [(header::ETAG, etag)]).into_response();
    }
    let mut response = next.run(request).await;
    if response.status() == StatusCode::OK {
        response.headers_mut().insert(header::ETAG, etag);
        // Clients shall revalidate each time.
        response.headers_mut().entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-cache"));
    }
    response
}

async fn etag_of(app: &App, subject: Subject) -> Result<Option<HeaderValue>, ApiError> {
    let Some(stored) = app.store.version(subject).await? else { return Ok(None) };
    let (start, progress) = (app.clock.started().0, app.progress.version(subject));
    // The reason why a job waits depends on other jobs, on workers and on time.
    let is_queued = matches!(subject, Subject::Job(_)) && stored.ends_with(".1");
    let period = if is_queued { app.clock.now().0 / WAITING_AGE_MS } else { 0 };
    // Progress counts restart with the server.
    let etag = format!("\"{stored}.{progress}.{period:x}.{start:x}\"");
    Ok(Some(HeaderValue::try_from(etag).expect("digits, signs and points")))
}

/// Whether `if-none-match` contains this etag.
pub(super) fn matches_etag(headers: &HeaderMap, etag: &HeaderValue) -> bool {
    let etag = etag.to_str().unwrap_or_default();
    let named = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    named
        .flat_map(|value| value.split(','))
        .map(str::trim)
        .any(|one| one == "*" || one.strip_prefix("W/").unwrap_or(one) == etag)
}
