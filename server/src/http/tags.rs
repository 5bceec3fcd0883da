//! Tags of what is polled: `etag` on every GET of something that changes, `304` when it has not.
//!
//! A tag is made from versions, a step down an index each, and never from the body: a poll of what has not changed reads none of
//! it. The tag is taken before the body is read, so that a change in between shows at the next poll.

use axum::RequestExt;
use axum::extract::{MatchedPath, Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::collections::HashMap;

use super::problem::ApiError;
use crate::app::App;
use crate::store::Subject;

/// What a route shows; none for what is not polled or has a tag of its own.
fn subject(path: &str, segments: &HashMap<String, String>) -> Option<Subject> {
    let rest = path.strip_prefix("/v1/")?;
    match rest {
        "jobs" | "sweeps" => Some(Subject::Everything),
        "workers" => Some(Subject::Workers),
        "meshes" => Some(Subject::Meshes),
        _ if rest.ends_with("/events") || rest.ends_with("/frames") => None,
        _ if rest.starts_with("jobs/{id}") => segments.get("id")?.parse().ok().map(Subject::Job),
        _ if rest.starts_with("sweeps/{id}") => segments.get("id")?.parse().ok().map(Subject::Sweep),
        _ => None,
    }
}

/// Whether what this route answers has a tag.
pub(super) fn is_tagged(path: &str) -> bool {
    let some = HashMap::from([("id".to_owned(), uuid::Uuid::nil().to_string())]);
    subject(path, &some).is_some()
}

/// Answers 304 to who has seen the newest, and tags what is answered otherwise.
pub(crate) async fn tagged(State(app): State<App>, mut request: Request, next: Next) -> Response {
    if request.method() != Method::GET {
        return next.run(request).await;
    }
    let Some(path) = request.extensions().get::<MatchedPath>().cloned() else {
        return next.run(request).await;
    };
    let segments = request.extract_parts::<Path<HashMap<String, String>>>().await;
    let segments = segments.map(|Path(segments)| segments).unwrap_or_default();
    let Some(subject) = subject(path.as_str(), &segments) else { return next.run(request).await };
    let tag = match tag(&app, subject).await {
        Ok(Some(tag)) => tag,
        // It is not there, or no longer: that is what the answer says.
        Ok(None) => return next.run(request).await,
        Err(error) => return error.into_response(),
    };
    if has_seen(request.headers(), &tag) {
        return (StatusCode::NOT_MODIFIED, [(header::ETAG, tag)]).into_response();
    }
    let mut response = next.run(request).await;
    if response.status() == StatusCode::OK {
        response.headers_mut().insert(header::ETAG, tag);
        // Ask again each time; the answer may be short.
        response.headers_mut().entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-cache"));
    }
    response
}

async fn tag(app: &App, subject: Subject) -> Result<Option<HeaderValue>, ApiError> {
    let Some(stored) = app.store.version(subject).await? else { return Ok(None) };
    let (start, progress) = (app.clock.started().0, app.progress.version(subject));
    // Progress is counted anew from every start.
    let tag = format!("\"{stored}.{progress}.{start:x}\"");
    Ok(Some(HeaderValue::try_from(tag).expect("digits, signs and points")))
}

/// Whether `if-none-match` names this tag.
pub(super) fn has_seen(headers: &HeaderMap, tag: &HeaderValue) -> bool {
    let tag = tag.to_str().unwrap_or_default();
    let named = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    named
        .flat_map(|value| value.split(','))
        .map(str::trim)
        .any(|one| one == "*" || one.strip_prefix("W/").unwrap_or(one) == tag)
}
