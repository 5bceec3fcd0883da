//! The dashboard's session: an access token in a cookie that no script can read.
//!
//! Browsers send cookies automatically, so a foreign page could send requests in its user's name.
//! `SameSite=Strict` keeps the cookie out of such requests. In addition, a request that changes something
//! needs the header `x-roost-page` beside the cookie: foreign pages cannot send that header without a CORS
//! preflight, which this server refuses.

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};

use super::problem::{ApiError, ProblemKind};
use crate::state::App;

const COOKIE: &str = "roost_session";
/// Header that dashboard pages send with every request other than GET.
const PAGE: &str = "x-roost-page";
/// Lifetime of the cookie. The token itself may be revoked any time.
const COOKIE_MAX_AGE_S: u32 = 30 * 24 * 3600;

/// The token of a request: from its header, or else from the session's cookie.
pub(super) fn secret<'a>(headers: &'a HeaderMap, method: &Method) -> Option<&'a str> {
    bearer(headers).or_else(|| {
        let is_trusted = matches!(*method, Method::GET | Method::HEAD) || headers.contains_key(PAGE);
        cookie(headers).filter(|_| is_trusted)
    })
}

/// The name of an authentication scheme ignores case (RFC 9110, section 11.1).
fn bearer(headers: &HeaderMap) -> Option<&str> {
    let (scheme, token) = headers.get(header::AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim())
}

fn cookie(headers: &HeaderMap) -> Option<&str> {
    let sent = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    sent.flat_map(|value| value.split(';'))
        .find_map(|pair| pair.trim().strip_prefix(COOKIE)?.strip_prefix('='))
}

/// Starts a session with the token of the `authorization` header.
pub(super) async fn begin(State(app): State<App>, headers: HeaderMap) -> Result<Response, ApiError> {
    let token = bearer(&headers);
    // The guard has checked the scope.
    app.access.authenticate(token)?;
    Ok(set_cookie(token.unwrap_or_default(), COOKIE_MAX_AGE_S, &headers))
}

/// Ends the session.
pub(super) async fn end(headers: HeaderMap) -> Response {
    set_cookie("", 0, &headers)
}

fn set_cookie(token: &str, max_age_s: u32, headers: &HeaderMap) -> Response {
    // A proxy that terminates TLS sends this header.
    let is_https = headers.get("x-forwarded-proto").is_some_and(|scheme| scheme == "https");
    let secure = if is_https { "; Secure" } else { "" };
    let cookie = format!("{COOKIE}={token}; Path=/; Max-Age={max_age_s}; HttpOnly; SameSite=Strict{secure}");
    match HeaderValue::try_from(cookie) {
        Ok(cookie) => (StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie)]).into_response(),
        // Tokens of this server are letters and digits.
        Err(_) => ApiError::new(
            ProblemKind::Unauthorized,
            "the token has invalid characters: tokens are letters and digits",
        )
        .into_response(),
    }
}
