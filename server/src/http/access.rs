//! Access control of requests: token, scope, rate, and the site that a browser names.
//!
//! Every request needs `authorization: Bearer …` or the session of a dashboard page, except those for health,
//! documentation and the dashboard's files. [`crate::state::Access`] holds the tokens; an open server needs
//! none.
//!
//! A browser on this machine reaches loopback addresses for any page it shows. Pages of other sites may
//! therefore change nothing: the browser names the site in `sec-fetch-site` or `origin`. An open server also
//! answers to loopback names alone, because a foreign page can point its own name at a loopback address (DNS
//! rebinding).

use std::net::IpAddr;

use axum::extract::{MatchedPath, Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use roost_api::token::Scope;

use super::problem::{ApiError, ProblemKind};
use super::{audit, dashboard, session};
use crate::state::{AccessError, App, Caller};

/// The scopes of which a request needs one; none for routes that are open to everybody.
pub(super) fn scopes_of(method: &Method, path: &str) -> &'static [Scope] {
    let reads = matches!(*method, Method::GET | Method::HEAD);
    match path {
        "/healthz" | "/readyz" | "/openapi.json" => &[],
        _ if dashboard::PAGES.contains(&path) => &[],
        "/dashboard/session" if *method == Method::POST => &[Scope::Read],
        _ if path.starts_with("/docs") || path.starts_with("/dashboard") => &[],
        "/v1/version" => &[Scope::Read, Scope::Worker],
        "/v1/meshes/{digest}" | "/v1/meshes/{digest}/file" => &[Scope::Read, Scope::Worker],
        "/v1/workers/{id}/drain" | "/v1/prune" => &[Scope::Admin],
        "/v1/workers" | "/v1/claims" | "/v1/results" | "/v1/workers/{id}/heartbeat" if !reads => {
            &[Scope::Worker]
        }
        _ if path.contains("/attempts/") => &[Scope::Worker],
        "/v1/validate" | "/v1/studies/validate" => &[Scope::Read],
        _ if *method == Method::DELETE => &[Scope::Admin],
        _ if reads => &[Scope::Read],
        _ => &[Scope::Submit],
    }
}

/// Refuses requests that a page of another site made a browser send.
fn refuse_foreign_pages(app: &App, request: &Request) -> Result<(), ApiError> {
    let headers = request.headers();
    let reads = matches!(*request.method(), Method::GET | Method::HEAD);
    let is_open = app.access.is_open();
    match text(headers, "sec-fetch-site") {
        Some(site) if !reads && !matches!(site, "same-origin" | "none") => {
            return Err(cross_site(format!("sec-fetch-site: {site}")));
        }
        // Older browsers send `origin` alone. On a server with tokens, foreign pages lack the token.
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
        let foreign = names.iter().flatten().find(|name| !is_loopback(name)).copied();
        let missing = names.iter().all(Option::is_none).then_some("missing");
        if let Some(host) = foreign.or(missing) {
            let detail = format!(
                "host {host} is not allowed: a server without access tokens accepts localhost and loopback addresses only; make a token \
                 with `roost token create`, or let the proxy send `host: localhost`"
            );
            return Err(ApiError::new(ProblemKind::WrongHost, detail));
        }
    }
    Ok(())
}

fn cross_site(evidence: String) -> ApiError {
    ApiError::new(
        ProblemKind::CrossSite,
        format!("a page of another site sent this request ({evidence}): nothing changed"),
    )
}

/// Whether the user or a page of this server has sent a browser here. Older browsers do not say.
pub(super) fn is_own_navigation(headers: &HeaderMap) -> bool {
    let site = text(headers, "sec-fetch-site");
    site.is_none_or(|site| matches!(site, "same-origin" | "same-site" | "none"))
}

fn text<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    headers.get(name).map(|value| value.to_str().unwrap_or("?"))
}

/// Whether an `origin` is the server itself.
fn is_own(origin: &str, headers: &HeaderMap) -> bool {
    let authority = origin.split_once("://").map(|(_, authority)| authority);
    authority.zip(text(headers, "host")).is_some_and(|(authority, host)| authority.eq_ignore_ascii_case(host))
}

/// Whether a `host` header, with or without a port, is a loopback address or a name that always resolves to
/// one.
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
    let scopes = scopes_of(request.method(), path.as_str());
    let record = audit::RequestRecord::of(&request);
    if scopes.is_empty() {
        // A page of another site may not end a session. The provider may send the browser to the callback.
        if !matches!(*request.method(), Method::GET | Method::HEAD)
            && let Err(error) = refuse_foreign_pages(&app, &request)
        {
            let response = error.into_response();
            audit::log_refusal(&app.refusal_limit, &record, None, &response);
            return response;
        }
        return next.run(request).await;
    }
    let caller = match admit(&app, &request, scopes) {
        Ok(caller) => caller,
        Err(Refused { caller, response }) => {
            audit::log_refusal(&app.refusal_limit, &record, caller.as_ref(), &response);
            return response;
        }
    };
    request.extensions_mut().insert(caller.clone());
    let pending = audit::Pending::new(record, caller);
    let response = next.run(request).await;
    pending.answered(&response);
    response
}

/// A request that may not go on.
struct Refused {
    /// The caller, if a valid token was sent.
    caller: Option<Caller>,
    response: Response,
}

/// The caller of a request that may go on, or the answer to it.
#[allow(clippy::result_large_err, reason = "a refusal is answered at once")]
fn admit(app: &App, request: &Request, scopes: &'static [Scope]) -> Result<Caller, Refused> {
    let anonymous = |response| Refused { caller: None, response };
    refuse_foreign_pages(app, request).map_err(|error| anonymous(error.into_response()))?;
    let secret = session::secret(app, request.headers(), request.method());
    let caller = app.access.authenticate(secret).map_err(|error| anonymous(refusal(error)))?;
    match caller.check_scope(scopes).and_then(|()| app.access.count_request(&caller)) {
        Ok(()) => Ok(caller),
        Err(error) => Err(Refused { caller: Some(caller), response: refusal(error) }),
    }
}

/// The answer to a refused request, with the header that its status asks for.
fn refusal(error: AccessError) -> Response {
    let header = match error {
        AccessError::NoToken | AccessError::InvalidToken | AccessError::ExpiredToken { .. } => {
            Some((header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer")))
        }
        AccessError::TooManyRequests { wait_s, .. } => Some((header::RETRY_AFTER, wait_s.into())),
        AccessError::MissingScope { .. } => None,
    };
    let mut response = ApiError::from(error).into_response();
    response.headers_mut().extend(header);
    response
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
