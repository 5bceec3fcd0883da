//! The dashboard's session: an access token in a cookie that no script can read.
//!
//! Browsers send cookies automatically, so a foreign page could send requests in its user's name.
//! `SameSite=Strict` keeps the cookie out of such requests. In addition, a request that changes something
//! needs the header `x-roost-page` beside the cookie: foreign pages cannot send that header without a CORS
//! preflight, which this server refuses.
//!
//! A session that began with an identity provider has a secret of its own, which a sign-out makes invalid. Other sessions have a token of
//! `roost token`, which stays valid.

use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use super::audit::{self, RequestRecord};
use super::problem::{ApiError, ProblemKind};
use crate::state::App;

const COOKIE: &str = "roost_session";
/// Header that dashboard pages send with every request other than GET.
const PAGE: &str = "x-roost-page";
/// Lifetime of the cookie. The token itself may be revoked any time.
const COOKIE_MAX_AGE_S: u64 = 30 * 24 * 3600;

/// The token of a request: from its header, or else from the session's cookie.
pub(super) fn secret<'a>(headers: &'a HeaderMap, method: &Method) -> Option<&'a str> {
    bearer(headers).or_else(|| {
        let is_trusted = matches!(*method, Method::GET | Method::HEAD) || headers.contains_key(PAGE);
        cookie(headers, COOKIE).filter(|_| is_trusted)
    })
}

/// The name of an authentication scheme ignores case (RFC 9110, section 11.1).
fn bearer(headers: &HeaderMap) -> Option<&str> {
    let (scheme, token) = headers.get(header::AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim())
}

/// The value of a cookie.
pub(super) fn cookie<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    let sent = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    sent.flat_map(|value| value.split(';')).find_map(|pair| pair.trim().strip_prefix(name)?.strip_prefix('='))
}

/// What the dashboard shows of sign-in.
#[derive(Serialize)]
pub(super) struct Shown {
    /// Host of the identity provider, if there is one.
    provider: Option<String>,
    session: Option<Session>,
}

/// A valid session.
#[derive(Serialize)]
struct Session {
    user: String,
    project: String,
}

/// Shows the session of a browser, and how to begin one.
pub(super) async fn show(State(app): State<App>, headers: HeaderMap) -> Response {
    let provider = app.sign_in.as_ref().map(|sign_in| sign_in.settings.provider_host());
    let caller = cookie(&headers, COOKIE).and_then(|secret| app.access.authenticate(Some(secret)).ok());
    let session = caller.filter(|caller| !caller.is_unrestricted());
    let session =
        session.map(|caller| Session { user: caller.user.to_string(), project: caller.project.to_string() });
    ([(header::CACHE_CONTROL, "no-store")], Json(Shown { provider, session })).into_response()
}

/// Starts a session with the token of the `authorization` header.
pub(super) async fn begin(State(app): State<App>, headers: HeaderMap) -> Result<Response, ApiError> {
    let token = bearer(&headers);
    // The guard has checked the scope.
    app.access.authenticate(token)?;
    Ok(set_cookie(token.unwrap_or_default(), COOKIE_MAX_AGE_S, &headers))
}

/// Ends the session.
pub(super) async fn end(State(app): State<App>, request: Request) -> Result<Response, ApiError> {
    let record = RequestRecord::of(&request);
    let headers = request.into_parts().0.headers;
    if let Some(secret) = cookie(&headers, COOKIE)
        && let Some(ended) = app.store.end_session(secret, app.clock.now()).await?
    {
        app.follow_changes().await?;
        audit::log_session("sign_out", &record, &ended.token, &ended.user, &ended.project);
    }
    Ok(set_cookie("", 0, &headers))
}

/// The cookie of a session.
pub(super) fn session_cookie(secret: &str, max_age_s: u64, is_https: bool) -> String {
    let secure = if is_https { "; Secure" } else { "" };
    format!("{COOKIE}={secret}; Path=/; Max-Age={max_age_s}; HttpOnly; SameSite=Strict{secure}")
}

fn set_cookie(token: &str, max_age_s: u64, headers: &HeaderMap) -> Response {
    // A proxy that terminates TLS sends this header.
    let is_https = headers.get("x-forwarded-proto").is_some_and(|scheme| scheme == "https");
    match HeaderValue::try_from(session_cookie(token, max_age_s, is_https)) {
        Ok(cookie) => (StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie)]).into_response(),
        // Tokens of this server are letters and digits.
        Err(_) => ApiError::new(
            ProblemKind::Unauthorized,
            "the token has invalid characters: tokens are letters and digits",
        )
        .into_response(),
    }
}
