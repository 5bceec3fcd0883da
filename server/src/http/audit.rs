//! The audit log of requests: one line for each change, and one for each refused access.
//!
//! A line has the target `audit`. It names the action, the token (`open` on a server without tokens) with its
//! user and project, the request by the answer's `x-request-id`, the peer, and the changed object.

use std::net::SocketAddr;

use axum::extract::{ConnectInfo, MatchedPath, Request};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::Response;
use uuid::Uuid;

use super::problem::ProblemKind;
use crate::sign_in::SignInError;
use crate::state::Caller;
use crate::state::audit::{MAX_TEXT_BYTES, RefusalLimit, shortened};

/// The answer's header that names the request.
const REQUEST_ID: &str = "x-request-id";

/// Identifier of a request: in its audit line, and in the header `x-request-id` of its answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct RequestId(Uuid);

/// Gives a request an identifier of its own. One that the client sends is ignored: it would put foreign text
/// in the log.
pub(super) async fn identify(mut request: Request, next: Next) -> Response {
    let id = RequestId(Uuid::now_v7());
    request.extensions_mut().insert(id);
    let mut response = next.run(request).await;
    let value = HeaderValue::try_from(id.0.to_string()).expect("hexadecimal digits and hyphens");
    response.headers_mut().insert(REQUEST_ID, value);
    response
}

/// The parts of a request that an audit line states.
pub(super) struct RequestRecord {
    method: Method,
    route: String,
    path: String,
    request: String,
    peer: String,
    forwarded_for: Option<String>,
}

impl RequestRecord {
    /// Copies those parts of a request.
    pub(super) fn of(request: &Request) -> Self {
        let extensions = request.extensions();
        let known = |text: Option<String>| text.unwrap_or_else(|| "unknown".to_owned());
        Self {
            method: request.method().clone(),
            route: known(extensions.get::<MatchedPath>().map(|path| path.as_str().to_owned())),
            path: shortened(request.uri().path()).to_owned(),
            request: known(extensions.get::<RequestId>().map(|id| id.0.to_string())),
            peer: known(extensions.get::<ConnectInfo<SocketAddr>>().map(|peer| peer.0.to_string())),
            forwarded_for: forwarded_for(request.headers()),
        }
    }
}

/// The peer that a proxy names. Proxies append to this header, so the end comes from the nearest one.
fn forwarded_for(headers: &HeaderMap) -> Option<String> {
    let last = headers.get_all("x-forwarded-for").iter().next_back()?;
    let text = String::from_utf8_lossy(last.as_bytes());
    Some(text[text.ceil_char_boundary(text.len().saturating_sub(MAX_TEXT_BYTES))..].to_owned())
}

/// The action of a request in the log; none for requests that change no data of users.
pub(super) fn action(method: &Method, route: &str) -> Option<&'static str> {
    let action = match (method.as_str(), route) {
        ("POST", "/v1/jobs" | "/v1/sweeps" | "/v1/sweeps/{id}/extend" | "/v1/studies") => "submit",
        ("POST", "/v1/meshes") => "upload",
        ("POST", "/v1/jobs/{id}/cancel" | "/v1/sweeps/{id}/cancel" | "/v1/studies/{id}/cancel") => "cancel",
        ("POST", "/v1/jobs/{id}/retry" | "/v1/sweeps/{id}/retry") => "retry",
        ("POST", "/v1/jobs/{id}/pause" | "/v1/sweeps/{id}/pause" | "/v1/studies/{id}/pause") => "pause",
        ("POST", "/v1/jobs/{id}/resume" | "/v1/sweeps/{id}/resume" | "/v1/studies/{id}/resume") => "resume",
        ("POST", "/v1/studies/{id}/budget" | "/v1/studies/{id}/ranges") => "change",
        ("POST", "/v1/studies/{id}/ask") => "ask",
        ("POST", "/v1/studies/{id}/tell") => "tell",
        ("DELETE", "/v1/sweeps/{id}") => "delete",
        ("POST", "/v1/prune") => "prune",
        ("POST", "/v1/workers/{id}/drain") => "drain",
        _ => return None,
    };
    Some(action)
}

/// Handlers add this to the answer of a dry run, which changed nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct DryRun;

/// An admitted request that may change something. Its line is written with the answer, or on drop when the
/// client closes the connection first: the change may go on without the client.
pub(super) struct Pending(Option<(&'static str, RequestRecord, Caller)>);

impl Pending {
    /// A request that is about to be handled.
    pub(super) fn new(record: RequestRecord, caller: Caller) -> Self {
        Self(action(&record.method, &record.route).map(|action| (action, record, caller)))
    }

    /// Logs the request with its status.
    pub(super) fn answered(mut self, response: &Response) {
        let Some((action, record, caller)) = self.0.take() else { return };
        if response.extensions().get::<DryRun>().is_some() {
            return;
        }
        let made = response.headers().get(header::LOCATION).and_then(|value| value.to_str().ok());
        tracing::info!(
            target: "audit", action, token = caller.name(), user = caller.user().map(shortened), project = caller.project(),
            request = record.request, peer = record.peer, forwarded_for = record.forwarded_for, path = record.path, status = response.status().as_u16(), made, "done"
        );
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        let Some((action, record, caller)) = self.0.take() else { return };
        tracing::info!(
            target: "audit", action, token = caller.name(), user = caller.user().map(shortened), project = caller.project(),
            request = record.request, peer = record.peer, forwarded_for = record.forwarded_for, path = record.path, "unanswered"
        );
    }
}

/// Logs the begin or end of a session of an identity provider.
pub(super) fn log_session(
    action: &'static str,
    record: &RequestRecord,
    token: &str,
    user: &str,
    project: &str,
    scopes: Option<&str>,
) {
    tracing::info!(
        target: "audit", action, token, user = shortened(user), project, scopes, request = record.request, peer = record.peer,
        forwarded_for = record.forwarded_for, path = record.path, "done"
    );
}

/// Logs a sign-in that failed.
pub(super) fn log_failed_sign_in(
    limit: &RefusalLimit,
    record: &RequestRecord,
    error: &SignInError,
    status: StatusCode,
) {
    let Some(left_out) = limit.take() else { return };
    let left_out = Some(left_out).filter(|count| *count > 0);
    let (reason, cause) = (error.to_string(), error.cause());
    let (user, identity) = error.who().map(|who| (shortened(&who.user), shortened(&who.identity))).unzip();
    tracing::warn!(
        target: "audit", action = "refuse", user, identity, request = record.request, peer = record.peer, forwarded_for = record.forwarded_for,
        method = shortened(record.method.as_str()), path = record.path, status = status.as_u16(), reason = shortened(&reason),
        cause = cause.as_deref().map(shortened), left_out, "sign-in failed"
    );
}

/// Logs a refused access, with the token if a valid one was sent.
pub(super) fn log_refusal(
    limit: &RefusalLimit,
    record: &RequestRecord,
    caller: Option<&Caller>,
    response: &Response,
) {
    let Some(left_out) = limit.take() else { return };
    let left_out = Some(left_out).filter(|count| *count > 0);
    let reason = response.extensions().get::<ProblemKind>().map(|kind| kind.title());
    tracing::warn!(
        target: "audit", action = "refuse", token = caller.map(Caller::name), user = caller.and_then(Caller::user).map(shortened),
        project = caller.map(Caller::project), request = record.request, peer = record.peer, forwarded_for = record.forwarded_for, method = shortened(record.method.as_str()), path = record.path,
        status = response.status().as_u16(), reason, left_out, "refused"
    );
}
