//! The dashboard's session: an access token in a cookie that no script can read.
//!
//! Browsers send cookies automatically, so a foreign page could send requests in its user's name.
//! `SameSite=Strict` keeps the cookie out of such requests. In addition, a request that changes something
//! needs the header `x-roost-page` beside the cookie: foreign pages cannot send that header without a CORS
//! preflight, which this server refuses.
//!
//! A session that began with an identity provider has a secret of its own, which a sign-out makes invalid. Other sessions have a token of
//! `roost token`, which stays valid.
//!
//! The address in `--oidc-redirect` decides the name of the cookie, since every browser uses it. Without it, the cookie is `Secure` where a
//! proxy says that it has received https.

use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use super::audit::{self, RequestRecord};
use super::problem::{ApiError, ProblemKind};
use crate::state::App;

const COOKIE: &str = "roost_session";
/// The same where browsers reach this server over https. They take a cookie with this prefix from this host alone and over https alone, so
/// that no other host of the domain can plant a session.
const HOST_COOKIE: &str = "__Host-roost_session";
/// Header that dashboard pages send with every request other than GET.
const PAGE: &str = "x-roost-page";
/// Lifetime of the cookie. The token itself may be revoked any time.
const COOKIE_MAX_AGE_S: u64 = 30 * 24 * 3600;

/// The token of a request: from its header, or else from the session's cookie.
pub(super) fn secret<'a>(app: &App, headers: &'a HeaderMap, method: &Method) -> Option<&'a str> {
    bearer(headers).or_else(|| {
        let is_trusted = matches!(*method, Method::GET | Method::HEAD) || headers.contains_key(PAGE);
        cookie(headers, name(app)).filter(|_| is_trusted)
    })
}

/// Whether `--oidc-redirect` says that browsers reach this server over https.
pub(super) fn is_https(app: &App) -> bool {
    app.sign_in.as_ref().is_some_and(|sign_in| sign_in.settings.is_https())
}

/// The name of the cookie of all sessions, whether they began with a token or with the provider. The other name is not read.
fn name(app: &App) -> &'static str {
    if is_https(app) { HOST_COOKIE } else { COOKIE }
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

/// The state of sign-in that the dashboard shows.
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
    let caller = cookie(&headers, name(&app)).and_then(|secret| app.access.authenticate(Some(secret)).ok());
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
    Ok(set_cookie(&app, token.unwrap_or_default(), COOKIE_MAX_AGE_S, &headers))
}

/// Ends the session.
pub(super) async fn end(State(app): State<App>, request: Request) -> Result<Response, ApiError> {
    let record = RequestRecord::of(&request);
    let headers = request.into_parts().0.headers;
    if let Some(secret) = cookie(&headers, name(&app))
        && app.access.has_session(secret)
        && let Some(ended) = app.store.end_session(secret, app.clock.now()).await?
    {
        app.follow_changes().await?;
        audit::log_session("sign_out", &record, &ended.token, &ended.user, &ended.project, None);
    }
    let mut response = set_cookie(&app, "", 0, &headers);
    // A cookie of the other name, from before a change of `--oidc-redirect`, must not sign anybody in after the change is undone.
    let other = if is_https(&app) { COOKIE } else { HOST_COOKIE };
    let gone = format!("{other}=; Path=/; Max-Age=0; HttpOnly; SameSite=Strict; Secure");
    response
        .headers_mut()
        .append(header::SET_COOKIE, HeaderValue::try_from(gone).expect("letters and digits"));
    Ok(response)
}

/// The cookie of a session.
pub(super) fn session_cookie(app: &App, secret: &str, max_age_s: u64, is_secure: bool) -> String {
    let secure = if is_secure { "; Secure" } else { "" };
    let name = name(app);
    format!("{name}={secret}; Path=/; Max-Age={max_age_s}; HttpOnly; SameSite=Strict{secure}")
}

fn set_cookie(app: &App, token: &str, max_age_s: u64, headers: &HeaderMap) -> Response {
    // A proxy that terminates TLS sends this header.
    let is_forwarded = headers.get("x-forwarded-proto").is_some_and(|scheme| scheme == "https");
    match HeaderValue::try_from(session_cookie(app, token, max_age_s, is_https(app) || is_forwarded)) {
        Ok(cookie) => (StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie)]).into_response(),
        // Tokens of this server are letters and digits.
        Err(_) => ApiError::new(
            ProblemKind::Unauthorized,
            "the token has invalid characters: tokens are letters and digits",
        )
        .into_response(),
    }
}
