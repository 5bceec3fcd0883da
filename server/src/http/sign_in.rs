//! Sign-in with an identity provider, in a browser. Both routes are open to everybody.
//!
//! The cookie of an attempt is `SameSite=Lax`, since the provider sends the browser back from its own site. The cookie of the session is
//! `SameSite=Strict`: a redirect from the callback would come without it, whatever page it leads to. Therefore a page of this server leads
//! to the dashboard.
//!
//! Over https, both cookies have the prefix `__Host-`: see `session`.

use axum::Router;
use axum::extract::{Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;

use super::audit::{self, RequestRecord};
use super::{access, session};
use crate::sign_in::{ATTEMPT_S, CALLBACK, SignIn, SignInError, SignedIn};
use crate::state::App;
use crate::store::NewSession;

const BEGIN: &str = "/dashboard/sign-in";

/// The cookie of an attempt.
const COOKIE: &str = "roost_sign_in";
/// The same over https.
const HOST_COOKIE: &str = "__Host-roost_sign_in";

/// Pages of this file have no script.
const POLICY: &str = "default-src 'none'; style-src 'self'; img-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The routes.
pub(super) fn router() -> Router<App> {
    Router::new().route(BEGIN, get(begin)).route(CALLBACK, get(callback))
}

/// Sends the browser to the provider.
async fn begin(State(app): State<App>, request: Request) -> Response {
    if request.method() == Method::HEAD {
        return head();
    }
    let record = RequestRecord::of(&request);
    let is_own = access::is_own_navigation(request.headers());
    let begun = async {
        let sign_in = app.sign_in.as_ref().ok_or(SignInError::NoProvider)?;
        // Another page shall not make its visitor a user here.
        if !is_own {
            return Err(SignInError::Foreign);
        }
        let (attempt, address) = sign_in.begin(app.clock.now()).await?;
        let cookie = attempt_cookie(sign_in, &attempt.cookie, ATTEMPT_S);
        Ok((StatusCode::SEE_OTHER, [(header::LOCATION, address), (header::SET_COOKIE, cookie)])
            .into_response())
    };
    let begun: Result<Response, SignInError> = begun.await;
    let mut response = begun.unwrap_or_else(|error| failed(&app, &record, &error));
    response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

/// Begins a session with the code that the provider has given to the browser.
async fn callback(State(app): State<App>, request: Request) -> Response {
    if request.method() == Method::HEAD {
        return head();
    }
    let record = RequestRecord::of(&request);
    let (parts, _) = request.into_parts();
    let completed = complete(&app, &record, &parts).await;
    // Somebody who invents an answer of the provider shall not end the attempt of this browser.
    let is_over = completed.as_ref().err().is_none_or(SignInError::ends_attempt);
    let mut response = completed.unwrap_or_else(|error| failed(&app, &record, &error));
    let headers = response.headers_mut();
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    if let Some(sign_in) = app.sign_in.as_ref().filter(|_| is_over) {
        let cookie = attempt_cookie(sign_in, "", 0);
        headers.append(header::SET_COOKIE, HeaderValue::try_from(cookie).expect("letters and digits"));
    }
    response
}

/// Programs that check links must not use an attempt up.
fn head() -> Response {
    (StatusCode::METHOD_NOT_ALLOWED, [(header::ALLOW, "GET")]).into_response()
}

async fn complete(app: &App, record: &RequestRecord, request: &Parts) -> Result<Response, SignInError> {
    let sign_in = app.sign_in.as_ref().ok_or(SignInError::NoProvider)?;
    let query: Vec<_> = form_urlencoded::parse(request.uri.query().unwrap_or_default().as_bytes()).collect();
    let parameter = |name: &str| query.iter().find(|(known, _)| known == name).map(|(_, value)| &**value);
    let cookie = session::cookie(&request.headers, attempt_name(sign_in));
    // First of all: without it, nobody makes this server call the provider.
    let attempt = sign_in.attempt(cookie, parameter("state"), app.clock.now())?;
    match parameter("error") {
        Some("access_denied") => return Err(SignInError::Cancelled),
        Some(code) => {
            let (error, description) = (code.to_owned(), parameter("error_description").map(str::to_owned));
            return Err(SignInError::Refused { error, description });
        }
        None => {}
    }
    let code = parameter("code").ok_or_else(|| SignInError::Unusable("it has no code".to_owned()))?;
    let SignedIn { who, grant } = match sign_in.complete(&attempt, code).await {
        Err(SignInError::NoRule { who, groups }) => {
            // The earlier rights of a user who has lost a group end at once.
            app.store.end_sessions(who.identity.clone(), app.clock.now()).await?;
            app.follow_changes().await?;
            return Err(SignInError::NoRule { who, groups });
        }
        completed => completed?,
    };
    let (now, session_s) = (app.clock.now(), sign_in.settings.session.as_secs());
    let session = NewSession {
        identity: who.identity.clone(),
        name: format!("sign-in at {}", sign_in.settings.provider_host()),
        user: who.user.clone(),
        project: grant.project.clone(),
        scopes: grant.scopes.clone(),
        expires_at: now.plus_ms(session_s as i64 * 1000),
    };
    let begun = app.store.begin_session(session, now).await?;
    app.follow_changes().await?;
    let project = grant.project;
    let Some((token, secret)) = begun else { return Err(SignInError::NoProject { who, project }) };
    let scopes: Vec<_> = grant.scopes.iter().map(|scope| scope.as_str()).collect();
    audit::log_session("sign_in", record, &token, &who.user, &project, Some(&scopes.join(" ")));
    let cookie = session::session_cookie(app, &secret, session_s, sign_in.settings.is_https());
    let content = "<meta http-equiv=\"refresh\" content=\"0; url=/\">";
    let mut page =
        page(StatusCode::OK, content, "Signed in", "<p><a href=\"/\">Continue to the dashboard</a></p>");
    page.headers_mut().insert(header::SET_COOKIE, HeaderValue::try_from(cookie).expect("letters and digits"));
    Ok(page)
}

fn attempt_name(sign_in: &SignIn) -> &'static str {
    if sign_in.settings.is_https() { HOST_COOKIE } else { COOKIE }
}

fn attempt_cookie(sign_in: &SignIn, value: &str, max_age_s: u32) -> String {
    let name = attempt_name(sign_in);
    // The prefix demands this path.
    let (path, secure) = if sign_in.settings.is_https() { ("/", "; Secure") } else { (BEGIN, "") };
    format!("{name}={value}; Path={path}; Max-Age={max_age_s}; HttpOnly; SameSite=Lax{secure}")
}

fn failed(app: &App, record: &RequestRecord, error: &SignInError) -> Response {
    let status = StatusCode::from_u16(error.status()).expect("a status");
    audit::log_failed_sign_in(&app.refusal_limit, record, error, status);
    let sentence = in_html(&capitalized(&error.to_string()));
    let links = "<p><a href=\"/dashboard/sign-in\">Sign in again</a> · <a href=\"/\">First page</a></p>";
    let content = format!("<p role=\"alert\">{sentence}.</p>\n<p>{}</p>\n{links}", in_html(error.advice()));
    page(status, "", "You are not signed in", &content)
}

fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn in_html(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A page with a title and content that is HTML.
fn page(status: StatusCode, head: &str, title: &str, content: &str) -> Response {
    let html = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title} – Roost</title>\n{head}\n<link rel=\"icon\" href=\"/dashboard/mark.svg\" type=\"image/svg+xml\">\n\
         <link rel=\"stylesheet\" href=\"/dashboard/style.css\">\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n{content}\n</main>\n</body>\n</html>\n"
    );
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static("text/html; charset=utf-8")),
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY)),
    ];
    (status, headers, html).into_response()
}
