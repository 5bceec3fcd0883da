//! The audit log: one line for each change that somebody asked for, and one for each refused access.
//!
//! Lines have the target `audit`. A line names the action, the token (`open` on a server without tokens), the request as in the answer's
//! `x-request-id`, the peer, and what it changed. Refusals are limited to some lines a second, so that a flood of strangers cannot fill
//! the disk: the next line says how many were left out.

use std::net::SocketAddr;
use std::num::NonZeroU32;
use std::sync::atomic::{AtomicU64, Ordering};

use axum::extract::{ConnectInfo, MatchedPath, Request};
use axum::http::{HeaderMap, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::Response;
use governor::{DefaultDirectRateLimiter, Quota, RateLimiter};
use uuid::Uuid;

use super::access::Caller;
use super::problem::Kind;
use crate::store::Token;

/// Refusals that are logged in one second; a burst of as many is logged at once.
const REFUSALS_PER_S: NonZeroU32 = NonZeroU32::new(20).unwrap();

/// The longest text of a stranger that a line holds, in bytes.
const LONGEST: usize = 200;

/// The answer's header that names the request.
const REQUEST_ID: &str = "x-request-id";

/// Identifier of a request: in its audit line, and in the header `x-request-id` of its answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct RequestId(Uuid);

/// Numbers a request. A name that the caller sends is not taken over: it would be a stranger's text in the log.
pub(super) async fn numbered(mut request: Request, next: Next) -> Response {
    let id = RequestId(Uuid::now_v7());
    request.extensions_mut().insert(id);
    let mut response = next.run(request).await;
    let value = HeaderValue::try_from(id.0.to_string()).expect("hexadecimal digits and hyphens");
    response.headers_mut().insert(REQUEST_ID, value);
    response
}

/// Limits the lines about refusals.
pub(super) struct Refusals {
    rate: DefaultDirectRateLimiter,
    left_out: AtomicU64,
}

impl Default for Refusals {
    fn default() -> Self {
        Self { rate: RateLimiter::direct(Quota::per_second(REFUSALS_PER_S)), left_out: AtomicU64::new(0) }
    }
}

/// What is known of a request before it is answered.
pub(super) struct Asked {
    method: Method,
    route: String,
    path: String,
    request: String,
    peer: String,
    forwarded_for: Option<String>,
}

impl Asked {
    /// Notes what a line may need of a request.
    pub(super) fn of(request: &Request) -> Self {
        let extensions = request.extensions();
        let known = |text: Option<String>| text.unwrap_or_else(|| "unknown".to_owned());
        Self {
            method: request.method().clone(),
            route: known(extensions.get::<MatchedPath>().map(|path| path.as_str().to_owned())),
            path: shortened(request.uri().path()),
            request: known(extensions.get::<RequestId>().map(|id| id.0.to_string())),
            peer: known(extensions.get::<ConnectInfo<SocketAddr>>().map(|peer| peer.0.to_string())),
            forwarded_for: forwarded_for(request.headers()),
        }
    }
}

/// Whom a proxy names as the peer: its word, or that of a stranger. Proxies append, so the end is the part of the nearest one.
fn forwarded_for(headers: &HeaderMap) -> Option<String> {
    let last = headers.get_all("x-forwarded-for").iter().next_back()?;
    let text = String::from_utf8_lossy(last.as_bytes());
    Some(text[text.ceil_char_boundary(text.len().saturating_sub(LONGEST))..].to_owned())
}

fn shortened(text: &str) -> String {
    text[..text.floor_char_boundary(LONGEST)].to_owned()
}

/// What a request changes, in a word; none for what changes nothing that people own.
fn action(method: &Method, route: &str) -> Option<&'static str> {
    let action = match (method.as_str(), route) {
        ("POST", "/v1/jobs" | "/v1/sweeps" | "/v1/sweeps/{id}/extend") => "submit",
        ("POST", "/v1/meshes") => "upload",
        ("POST", "/v1/jobs/{id}/cancel" | "/v1/sweeps/{id}/cancel") => "cancel",
        ("POST", "/v1/jobs/{id}/retry" | "/v1/sweeps/{id}/retry") => "retry",
        ("DELETE", "/v1/sweeps/{id}") => "delete",
        ("POST", "/v1/prune") => "prune",
        ("POST", "/v1/workers/{id}/drain") => "drain",
        _ => return None,
    };
    Some(action)
}

/// The answer says only what would change: handlers put this beside it.
#[derive(Clone, Copy, Debug)]
pub(super) struct DryRun;

/// An admitted request that may change something. Its line is written when it is answered, or else when it is dropped: a client that
/// goes away before the answer does not take the line along, since its change may go on.
pub(super) struct Pending(Option<(&'static str, Asked, Caller)>);

impl Pending {
    /// Begins to watch a request.
    pub(super) fn new(asked: Asked, caller: Caller) -> Self {
        Self(action(&asked.method, &asked.route).map(|action| (action, asked, caller)))
    }

    /// Logs what the request has changed, or failed to change.
    pub(super) fn answered(mut self, response: &Response) {
        let Some((action, asked, caller)) = self.0.take() else { return };
        if response.extensions().get::<DryRun>().is_some() {
            return;
        }
        let made = response.headers().get(header::LOCATION).and_then(|value| value.to_str().ok());
        tracing::info!(
            target: "audit", action, token = caller.name(), request = asked.request, peer = asked.peer,
            forwarded_for = asked.forwarded_for, path = asked.path, status = response.status().as_u16(), made, "done"
        );
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        let Some((action, asked, caller)) = self.0.take() else { return };
        tracing::info!(
            target: "audit", action, token = caller.name(), request = asked.request, peer = asked.peer,
            forwarded_for = asked.forwarded_for, path = asked.path, "unanswered"
        );
    }
}

/// Logs a refused access, with the token where one was sent that is valid.
pub(super) fn refused(refusals: &Refusals, asked: &Asked, caller: Option<&Caller>, response: &Response) {
    if refusals.rate.check().is_err() {
        refusals.left_out.fetch_add(1, Ordering::Relaxed);
        return;
    }
    let left_out = Some(refusals.left_out.swap(0, Ordering::Relaxed)).filter(|count| *count > 0);
    let reason = response.extensions().get::<Kind>().map(|kind| kind.title());
    tracing::warn!(
        target: "audit", action = "refuse", token = caller.map(Caller::name), request = asked.request, peer = asked.peer,
        forwarded_for = asked.forwarded_for, method = shortened(asked.method.as_str()), path = asked.path,
        status = response.status().as_u16(), reason, left_out, "refused"
    );
}

/// Logs a token that `roost token` has made or revoked.
pub(super) fn token_changed(action: &'static str, token: &Token) {
    let scopes: Vec<_> = token.scopes.iter().map(|scope| scope.as_str()).collect();
    tracing::info!(
        target: "audit", action, token = token.id, name = shortened(&token.name), scopes = scopes.join(" "), "done"
    );
}
