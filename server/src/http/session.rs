//! The dashboard's session: an access token in a cookie that no script can read.
//!
//! Browsers send cookies by themselves, so that a page of somebody else could have one post in its user's name. `SameSite=Strict` keeps the
//! cookie out of such requests. Besides, a cookie counts for what changes something only beside the header `x-roost-page`: pages of
//! others cannot send it without asking this server first, which allows nobody.

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};

use super::problem::{ApiError, Kind};
use crate::app::App;

const COOKIE: &str = "roost_session";
/// What pages send with everything that is not a GET.
const PAGE: &str = "x-roost-page";
/// How long a browser keeps the cookie; the token itself may be revoked any time.
const KEPT_S: u32 = 30 * 24 * 3600;

/// The token that a request brings: in its header, or else in the session's cookie.
pub(super) fn secret<'a>(headers: &'a HeaderMap, method: &Method) -> Option<&'a str> {
    bearer(headers).or_else(|| {
        let is_ours = matches!(*method, Method::GET | Method::HEAD) || headers.contains_key(PAGE);
        cookie(headers).filter(|_| is_ours)
    })
}

/// The name of an authentication scheme has no case (RFC 9110, section 11.1).
fn bearer(headers: &HeaderMap) -> Option<&str> {
    let (scheme, token) = headers.get(header::AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim())
}

fn cookie(headers: &HeaderMap) -> Option<&str> {
    let sent = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    sent.flat_map(|value| value.split(';'))
        .find_map(|pair| pair.trim().strip_prefix(COOKIE)?.strip_prefix('='))
}

/// Begins a session with the token of the `authorization` header, which must be allowed to read.
pub(super) async fn begin(State(app): State<App>, headers: HeaderMap) -> Result<Response, ApiError> {
    let token = bearer(&headers);
    // The guard has looked at the scope.
    app.access.admit(token)?;
    Ok(set(token.unwrap_or_default(), KEPT_S, &headers))
}

/// Ends the session.
pub(super) async fn end(headers: HeaderMap) -> Response {
    set("", 0, &headers)
}

fn set(token: &str, kept_s: u32, headers: &HeaderMap) -> Response {
    // A proxy that speaks https to browsers says so.
    let is_https = headers.get("x-forwarded-proto").is_some_and(|scheme| scheme == "https");
    let secure = if is_https { "; Secure" } else { "" };
    let cookie = format!("{COOKIE}={token}; Path=/; Max-Age={kept_s}; HttpOnly; SameSite=Strict{secure}");
    match HeaderValue::try_from(cookie) {
        Ok(cookie) => (StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie)]).into_response(),
        // No token of ours: those are letters and digits.
        Err(_) => {
            ApiError::new(Kind::Unauthorized, "the token holds characters that no token has").into_response()
        }
    }
}
