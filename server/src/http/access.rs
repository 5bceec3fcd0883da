//! Who may do what: tokens, their scopes and their rate.
//!
//! Without any token in the data directory everything is open, and the server listens on loopback addresses only. With one,
//! every request but those for health, documentation and the files of the dashboard needs `authorization: Bearer …`, or the session of a page.

use std::sync::Arc;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use governor::clock::Clock as _;
use roost_api::token::Scope;

use super::problem::{ApiError, Kind};
use super::{dashboard, session};
use crate::app::App;
use crate::store::Token;

/// Who asks; empty while everything is open.
#[derive(Clone, Debug, Default)]
pub(crate) struct Caller(pub(crate) Arc<str>);

/// Tokens in effect, and how often each has asked.
pub(crate) struct Access {
    tokens: std::sync::RwLock<Arc<Vec<Token>>>,
    rate: Option<governor::DefaultKeyedRateLimiter<Arc<str>>>,
    per_second: u32,
}

impl Access {
    /// With so many requests a second for each token; 0 is no limit.
    pub(crate) fn new(per_second: u32, tokens: Vec<Token>) -> Self {
        let quota = std::num::NonZeroU32::new(per_second).map(governor::Quota::per_second);
        Self {
            tokens: std::sync::RwLock::new(Arc::new(tokens)),
            rate: quota.map(governor::RateLimiter::keyed),
            per_second,
        }
    }

    /// Takes what `roost token` has changed into account.
    pub(crate) fn update(&self, tokens: Vec<Token>) {
        *self.tokens.write().unwrap_or_else(std::sync::PoisonError::into_inner) = Arc::new(tokens);
    }

    fn tokens(&self) -> Arc<Vec<Token>> {
        self.tokens.read().unwrap_or_else(std::sync::PoisonError::into_inner).clone()
    }

    /// Who may ask for what takes this scope, or why not.
    pub(super) fn admit(&self, secret: Option<&str>, needed: &[Scope]) -> Result<Caller, ApiError> {
        let tokens = self.tokens();
        if tokens.is_empty() {
            return Ok(Caller::default());
        }
        let missing = || {
            let detail = "send the header `authorization: Bearer TOKEN`; `roost token create` makes one";
            ApiError::new(Kind::Unauthorized, detail)
        };
        let hash = blake3::hash(secret.ok_or_else(missing)?.as_bytes());
        // Hashes of blake3 are compared in constant time, and all are.
        let mut found = None;
        for token in tokens.iter() {
            if token.hash == hash {
                found = Some(token);
            }
        }
        let token = found.ok_or_else(|| {
            ApiError::new(Kind::Unauthorized, "the token is not known here, or was revoked")
        })?;
        if !needed.iter().any(|needed| token.scopes.iter().any(|scope| scope.covers(*needed))) {
            let scopes: Vec<_> = needed.iter().map(|scope| scope.as_str()).collect();
            let detail = format!("this takes a token with the scope {}", scopes.join(" or "));
            return Err(ApiError::new(Kind::Forbidden, detail));
        }
        Ok(Caller(token.id.as_str().into()))
    }

    /// Seconds to wait, when this caller has asked too often.
    fn too_often(&self, caller: &Caller) -> Option<u64> {
        let rate = self.rate.as_ref()?;
        let refused = rate.check_key(&caller.0).err()?;
        Some(refused.wait_time_from(governor::clock::DefaultClock::default().now()).as_secs() + 1)
    }
}

/// The scopes of which one is needed; none where everybody may ask.
pub(super) fn needed(method: &Method, path: &str) -> &'static [Scope] {
    let reads = matches!(*method, Method::GET | Method::HEAD);
    match path {
        "/healthz" | "/readyz" | "/openapi.json" => &[],
        _ if dashboard::PAGES.contains(&path) => &[],
        _ if path.starts_with("/docs") || path.starts_with("/dashboard") => &[],
        "/v1/version" => &[Scope::Read, Scope::Worker],
        "/v1/meshes/{digest}" | "/v1/meshes/{digest}/file" => &[Scope::Read, Scope::Worker],
        "/v1/workers/{id}/drain" | "/v1/prune" => &[Scope::Admin],
        "/v1/workers" | "/v1/claims" | "/v1/workers/{id}/heartbeat" if !reads => &[Scope::Worker],
        _ if path.contains("/attempts/") => &[Scope::Worker],
        "/v1/validate" => &[Scope::Read],
        _ if *method == Method::DELETE => &[Scope::Admin],
        _ if reads => &[Scope::Read],
        _ => &[Scope::Submit],
    }
}

/// Lets a request pass, or answers 401, 403 or 429.
pub(crate) async fn guard(State(app): State<App>, mut request: Request, next: Next) -> Response {
    let Some(path) = request.extensions().get::<MatchedPath>() else { return next.run(request).await };
    let scopes = needed(request.method(), path.as_str());
    if scopes.is_empty() {
        return next.run(request).await;
    }
    let secret = session::secret(request.headers(), request.method());
    let caller = match app.access.admit(secret, scopes) {
        Ok(caller) => caller,
        Err(error) => {
            let mut response = error.into_response();
            response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
            return response;
        }
    };
    if let Some(wait_s) = app.access.too_often(&caller) {
        let detail = format!(
            "more than {} requests a second with this token (max_requests_per_s, which the operator can set)",
            app.access.per_second
        );
        let mut response = ApiError::new(Kind::TooManyRequests, detail).into_response();
        response.headers_mut().insert(header::RETRY_AFTER, wait_s.into());
        return response;
    }
    request.extensions_mut().insert(caller);
    next.run(request).await
}
