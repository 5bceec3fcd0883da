//! The specification, completed: what many operations answer alike is said here, once, and not at each of them.
//!
//! Handlers name what is their own. What comes before and behind them (paths, queries and bodies that cannot be read, tokens and
//! limits, tags, the store) answers in the same way everywhere, and follows from method, path and shape of an operation.

use axum::http::{Method, StatusCode, header};
use roost_api::frames;
use utoipa::openapi::path::{Operation, ParameterIn};
use utoipa::openapi::request_body::RequestBody;
use utoipa::openapi::schema::{Object, Type};
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{Content, Header, OpenApi, Ref, RefOr, Response};

use super::problem::Kind;
use super::{access, tags};

/// What access tokens are called in the specification.
const TOKEN: &str = "token";

/// Adds to every operation what it may answer beside what its handler says, and the scopes that it takes.
pub(crate) fn complete(spec: &mut OpenApi) {
    for (path, item) in &mut spec.paths.paths {
        let methods = [Method::GET, Method::POST, Method::PUT, Method::DELETE];
        let operations = [&mut item.get, &mut item.post, &mut item.put, &mut item.delete];
        for (method, operation) in methods.iter().zip(operations) {
            if let Some(operation) = operation {
                answers(method, path, operation);
                operation.security = Some(scopes(method, path));
            }
        }
    }
    let bearer = SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer));
    spec.components.get_or_insert_default().security_schemes.insert(TOKEN.to_owned(), bearer.into());
}

fn answers(method: &Method, path: &str, operation: &mut Operation) {
    for kind in kinds(method, path, operation) {
        let responses = &mut operation.responses.responses;
        let RefOr::T(response) = responses.entry(kind.status().as_str().to_owned()).or_insert_with(problem)
        else {
            continue;
        };
        if !response.description.contains(kind.title()) {
            let before = std::mem::take(&mut response.description);
            let also = if before.is_empty() { "" } else { "; " };
            response.description = format!("{before}{also}{}", kind.title());
        }
    }
    let has_pages = operation.parameters.iter().flatten().any(|parameter| match parameter {
        RefOr::T(parameter) => parameter.parameter_in == ParameterIn::Query && parameter.name == "cursor",
        RefOr::Ref(_) => false,
    });
    if has_pages && let Some(RefOr::T(page)) = operation.responses.responses.get_mut(StatusCode::OK.as_str())
    {
        let next = Header::builder()
            .schema(Some(Object::with_type(Type::String)))
            .description(Some("The page after this one, as `<ADDRESS>; rel=\"next\"`; none after the last"));
        page.headers.insert(header::LINK.as_str().to_owned(), next.build().into());
    }
    if *method == Method::GET && tags::is_tagged(path) {
        let unchanged = Response::new("Nothing has changed since the `etag` that `if-none-match` names");
        let status = StatusCode::NOT_MODIFIED.as_str().to_owned();
        operation.responses.responses.insert(status, unchanged.into());
    }
}

fn problem() -> RefOr<Response> {
    let schema = RefOr::Ref(Ref::from_schema_name("Problem"));
    let mut response = Response::new("");
    response.content.insert(roost_api::problem::MEDIA_TYPE.to_owned(), Content::new(Some(schema)).into());
    response.into()
}

/// The problems that a request may have before its handler sees it, and that its handler may meet in the store.
fn kinds(method: &Method, path: &str, operation: &Operation) -> Vec<Kind> {
    let mut kinds = vec![Kind::Unavailable, Kind::Internal];
    if !access::needed(method, path).is_empty() {
        kinds.extend([Kind::Unauthorized, Kind::Forbidden, Kind::TooManyRequests, Kind::WrongHost]);
        if *method != Method::GET {
            kinds.push(Kind::CrossSite);
        }
    }
    for parameter in operation.parameters.iter().flatten() {
        let RefOr::T(parameter) = parameter else { continue };
        kinds.extend(match parameter.parameter_in {
            ParameterIn::Path => Some(Kind::InvalidPath),
            ParameterIn::Query => Some(Kind::InvalidQuery),
            _ if parameter.name == "Idempotency-Key" => Some(Kind::InvalidKey),
            _ => Some(Kind::InvalidQuery),
        });
    }
    if let Some(RefOr::T(body)) = &operation.request_body {
        kinds.extend([Kind::UnreadableBody, Kind::SlowBody, Kind::TooLarge]);
        match is_json(body) {
            true => kinds.extend([Kind::Syntax, Kind::NotJson, Kind::InvalidDocument]),
            false if body.content.contains_key(frames::MEDIA_TYPE) => kinds.push(Kind::NotFrames),
            false => kinds.push(Kind::NotStl),
        }
    }
    if *method != Method::GET {
        kinds.push(Kind::StorageFull);
    }
    kinds
}

fn is_json(body: &RequestBody) -> bool {
    body.content.keys().any(|media_type| media_type == "application/json")
}

/// One of these is needed once there are tokens.
fn scopes(method: &Method, path: &str) -> Vec<SecurityRequirement> {
    let scopes = access::needed(method, path).iter();
    scopes.map(|scope| SecurityRequirement::new(TOKEN, [scope.as_str()])).collect()
}
