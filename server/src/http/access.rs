//! Who may do what: tokens, their scopes and their rate.
//!
//! The server is open only while no token has ever existed and its address is a loopback address. Otherwise every request needs
//! `authorization: Bearer …` or the session of a dashboard page, except those for health, documentation and the dashboard's files. A server
//! without a valid token then answers 401: losing the last token closes the server, it never opens it.
//!
//! A browser on this machine reaches loopback addresses for any page it shows. Pages of other sites may change nothing: the browser names
//! the site in `sec-fetch-site` or `origin`. An open server also answers to loopback names alone, because a foreign page can point its own
//! name at a loopback address (DNS rebinding).

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError, RwLock};

use axum::extract::{MatchedPath, Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use governor::clock::Clock as _;
use roost_api::token::Scope;

use super::problem::{ApiError, Kind};
use super::{audit, dashboard, session};
use crate::app::App;
use crate::store::Token;

/// Who asks, and what that token allows; empty while everything is open.
#[derive(Clone, Debug, Default)]
pub(crate) struct Caller(pub(crate) Arc<str>, pub(crate) Vec<Scope>);

impl Caller {
    /// For the audit log.
    pub(super) fn name(&self) -> &str {
        if self.0.is_empty() { "open" } else { &self.0 }
    }

    /// Refuses with 403 what takes one of these scopes, where the token has none of them. Without tokens everybody may do everything.
    fn may(&self, needed: &[Scope]) -> Result<(), ApiError> {
        let Self(token, scopes) = self;
        if token.is_empty() || needed.iter().any(|needed| scopes.iter().any(|scope| scope.covers(*needed))) {
            return Ok(());
        }
        let scopes: Vec<_> = needed.iter().map(|scope| scope.as_str()).collect();
        let detail = format!("this takes a token with the scope {}", scopes.join(" or "));
        Err(ApiError::new(Kind::Forbidden, detail))
    }
}

/// Whom the server admits.
#[derive(Clone, Debug)]
enum Admission {
    /// No token has ever existed and the address is a loopback address: everybody may do everything.
    Everybody,
    /// The bearers of these tokens; nobody when the list is empty.
    Bearers(Arc<[Token]>),
}

/// Tokens in effect, and how often each has asked.
pub(crate) struct Access {
    admission: RwLock<Admission>,
    /// Every token that was seen, and whether it was revoked: what the audit log has said.
    seen: Mutex<HashMap<String, bool>>,
    refusals: audit::Refusals,
    rate: Option<governor::DefaultKeyedRateLimiter<Arc<str>>>,
    per_second: u32,
}

impl Access {
    /// With all tokens that exist, revoked ones included. `max_requests_per_s` counts for each token; 0 is no limit.
    pub(crate) fn new(max_requests_per_s: u32, is_loopback: bool, tokens: Vec<Token>) -> Self {
        let quota = std::num::NonZeroU32::new(max_requests_per_s).map(governor::Quota::per_second);
        let seen = tokens.iter().map(|token| (token.id.clone(), token.is_revoked)).collect();
        let admission = if tokens.is_empty() && is_loopback {
            Admission::Everybody
        } else {
            Admission::Bearers(valid(tokens))
        };
        let access = Self {
            admission: RwLock::new(admission),
            seen: Mutex::new(seen),
            refusals: audit::Refusals::default(),
            rate: quota.map(governor::RateLimiter::keyed),
            per_second: max_requests_per_s,
        };
        access.say_if_closed();
        access
    }

    /// Follows what `roost token` has changed. A server that has known a token never opens again.
    pub(crate) fn update(&self, tokens: Vec<Token>) {
        let before = self.admission();
        if tokens.is_empty() && matches!(before, Admission::Everybody) {
            return;
        }
        self.log_changes(&tokens);
        let had_tokens = !matches!(&before, Admission::Bearers(tokens) if tokens.is_empty());
        *self.admission.write().unwrap_or_else(PoisonError::into_inner) = Admission::Bearers(valid(tokens));
        if had_tokens {
            self.say_if_closed();
        }
    }

    fn admission(&self) -> Admission {
        self.admission.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn say_if_closed(&self) {
        if matches!(self.admission(), Admission::Bearers(tokens) if tokens.is_empty()) {
            tracing::error!(
                "no access token is valid: every request is answered 401; `roost token create` makes a token"
            );
        }
    }

    fn log_changes(&self, tokens: &[Token]) {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        for token in tokens {
            let before = seen.insert(token.id.clone(), token.is_revoked);
            if before.is_none() {
                audit::token_changed("token_create", token);
            }
            if token.is_revoked && before != Some(true) {
                audit::token_changed("token_revoke", token);
            }
        }
    }

    /// Whether everybody may do everything.
    pub(crate) fn is_open(&self) -> bool {
        matches!(self.admission(), Admission::Everybody)
    }

    /// Whether a caller that was admitted before would be admitted now.
    pub(super) fn knows(&self, caller: &Caller) -> bool {
        match self.admission() {
            Admission::Everybody => true,
            Admission::Bearers(tokens) => tokens.iter().any(|token| *token.id == *caller.0),
        }
    }

    /// The caller that a secret stands for.
    ///
    /// # Errors
    ///
    /// 401 without a valid token.
    pub(super) fn admit(&self, secret: Option<&str>) -> Result<Caller, ApiError> {
        let Admission::Bearers(tokens) = self.admission() else { return Ok(Caller::default()) };
        let missing = || {
            let detail = "send the header `authorization: Bearer TOKEN`, or give the `roost` command `--token-file` or ROOST_TOKEN; `roost token create` makes one";
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
        Ok(Caller(token.id.as_str().into(), token.scopes.clone()))
    }

    /// Seconds to wait, when this caller has asked too often.
    fn too_often(&self, caller: &Caller) -> Option<u64> {
        let rate = self.rate.as_ref()?;
        let refused = rate.check_key(&caller.0).err()?;
        Some(refused.wait_time_from(governor::clock::DefaultClock::default().now()).as_secs() + 1)
    }
}

fn valid(tokens: Vec<Token>) -> Arc<[Token]> {
    tokens.into_iter().filter(|token| !token.is_revoked).collect()
}

/// The scopes of which one is needed; none where everybody may ask.
pub(super) fn needed(method: &Method, path: &str) -> &'static [Scope] {
    let reads = matches!(*method, Method::GET | Method::HEAD);
    match path {
        "/healthz" | "/readyz" | "/openapi.json" => &[],
        _ if dashboard::PAGES.contains(&path) => &[],
        "/dashboard/session" if *method == Method::POST => &[Scope::Read],
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
    let headers = request.headers();
    let reads = matches!(*request.method(), Method::GET | Method::HEAD);
    let is_open = app.access.is_open();
    match text(headers, "sec-fetch-site") {
        Some(site) if !reads && !matches!(site, "same-origin" | "none") => {
            return Err(cross_site(format!("sec-fetch-site: {site}")));
        }
        // Older browsers send `origin` alone. Callers with a token are told from foreign pages by the token.
        None if is_open => {
            if let Some(origin) = text(headers, "origin").filter(|origin| !is_own(origin, headers)) {
                return Err(cross_site(format!("origin: {origin}")));
            }
        }
        _ => {}
    }
    if is_open {
        // A request in absolute form names the server itself.
        let names = [text(headers, "host"), request.uri().authority().map(Authority::as_str)];
        let strange = names.iter().flatten().find(|name| !is_loopback(name)).copied();
        let missing = names.iter().all(Option::is_none).then_some("missing");
        if let Some(host) = strange.or(missing) {
            let detail = format!(
                "host {host}: without access tokens the server answers to localhost and loopback addresses only; make a token with \
                 `roost token create`, or have the proxy send `host: localhost`"
            );
            return Err(ApiError::new(Kind::WrongHost, detail));
        }
    }
    Ok(())
}

fn cross_site(sign: String) -> ApiError {
    ApiError::new(Kind::CrossSite, format!("a page of another site asked for this ({sign}): nothing changed"))
}

fn text<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    headers.get(name).map(|value| value.to_str().unwrap_or("?"))
}

/// Whether an `origin` is the server that the request was sent to.
fn is_own(origin: &str, headers: &HeaderMap) -> bool {
    let authority = origin.split_once("://").map(|(_, authority)| authority);
    authority.zip(text(headers, "host")).is_some_and(|(authority, host)| authority.eq_ignore_ascii_case(host))
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
    let asked = audit::Asked::of(&request);
    let caller = match admitted(&app, &request, scopes) {
        Ok(caller) => caller,
        Err(Refused { caller, response }) => {
            audit::refused(&app.access.refusals, &asked, caller.as_ref(), &response);
            return response;
        }
    };
    request.extensions_mut().insert(caller.clone());
    let pending = audit::Pending::new(asked, caller);
    let response = next.run(request).await;
    pending.answered(&response);
    response
}

/// A request that may not go on.
struct Refused {
    /// Who asked, if a valid token was sent.
    caller: Option<Caller>,
    response: Response,
}

/// The caller of a request that may go on, or the answer to it.
#[allow(clippy::result_large_err, reason = "a refusal is answered at once")]
fn admitted(app: &App, request: &Request, scopes: &[Scope]) -> Result<Caller, Refused> {
    refuse_strange_pages(app, request)
        .map_err(|error| Refused { caller: None, response: error.into_response() })?;
    let secret = session::secret(request.headers(), request.method());
    let caller = app.access.admit(secret).map_err(|error| {
        let mut response = error.into_response();
        response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        Refused { caller: None, response }
    })?;
    if let Err(error) = caller.may(scopes) {
        return Err(Refused { caller: Some(caller), response: error.into_response() });
    }
    let Some(wait_s) = app.access.too_often(&caller) else { return Ok(caller) };
    let detail = format!(
        "more than {} requests a second with this token (max_requests_per_s, which the operator can set)",
        app.access.per_second
    );
    let mut response = ApiError::new(Kind::TooManyRequests, detail).into_response();
    response.headers_mut().insert(header::RETRY_AFTER, wait_s.into());
    Err(Refused { caller: Some(caller), response })
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
