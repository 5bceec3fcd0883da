//! Who may do what: tokens, their scopes and their rate.
//!
//! Without any token in the data directory everything is open, and the server listens on loopback addresses only. With one,
//! every request but those for health, documentation and the files of the dashboard needs `authorization: Bearer …`, or the session of a page.
//!
//! A browser on this machine reaches loopback addresses for whatever page it shows. So pages of other sites may not change anything, as
//! the browser says whose a request is (`sec-fetch-site`); and without tokens a name that somebody else has pointed at
//! a loopback address is not answered to (DNS rebinding), which would make their page one of ours.

use std::net::IpAddr;
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

    /// Whether there are no tokens, and everything is open.
    fn is_open(&self) -> bool {
        self.tokens().is_empty()
    }

    /// Whether who was admitted once would be known still.
    pub(super) fn knows(&self, caller: &Caller) -> bool {
        let tokens = self.tokens();
        tokens.is_empty() || tokens.iter().any(|token| *token.id == *caller.0)
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

/// Refuses what a page of another site has a browser ask for.
fn refuse_strange_pages(app: &App, request: &Request) -> Result<(), ApiError> {
    let header = |name: &str| request.headers().get(name).map(|value| value.to_str().unwrap_or("?"));
    let reads = matches!(*request.method(), Method::GET | Method::HEAD);
    if let Some(site) =
        header("sec-fetch-site").filter(|site| !reads && !matches!(*site, "same-origin" | "none"))
    {
        let detail =
            format!("a page of another site asked for this (sec-fetch-site: {site}): nothing changed");
        return Err(ApiError::new(Kind::CrossSite, detail));
    }
    if let Some(host) = header("host").filter(|host| !is_loopback(host) && app.access.is_open()) {
        let detail = format!(
            "host {host}: without access tokens the server answers to localhost and loopback addresses only; make a token with \
             `roost token create`, or have the proxy send `host: localhost`"
        );
        return Err(ApiError::new(Kind::WrongHost, detail));
    }
    Ok(())
}

/// Whether a `host` header, with or without a port, is a name of this machine that nobody else can give away.
fn is_loopback(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next(),
        None => host.split(':').next(),
    };
    let name = name.unwrap_or_default().trim_end_matches('.').to_ascii_lowercase();
    name == "localhost"
        || name.ends_with(".localhost")
        || name.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// Lets a request pass, or answers 401, 403, 421 or 429.
pub(crate) async fn guard(State(app): State<App>, mut request: Request, next: Next) -> Response {
    let Some(path) = request.extensions().get::<MatchedPath>() else { return next.run(request).await };
    let scopes = needed(request.method(), path.as_str());
    if scopes.is_empty() {
        return next.run(request).await;
    }
    if let Err(error) = refuse_strange_pages(&app, &request) {
        return error.into_response();
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

#[cfg(test)]
mod tests {
    use super::is_loopback;

    #[test]
    fn only_names_of_this_machine_are_loopback() {
        for host in [
            "localhost",
            "LocalHost:7373",
            "a.localhost.",
            "127.0.0.1",
            "127.9.9.9:80",
            "[::1]:7373",
            "[::1]",
        ] {
            assert!(is_loopback(host), "{host}");
        }
        for host in [
            "",
            "localhost.example",
            "127.0.0.1.example:7373",
            "10.0.0.1",
            "[::2]:7373",
            "notlocalhost",
            "0.0.0.0",
        ] {
            assert!(!is_loopback(host), "{host}");
        }
    }
}
