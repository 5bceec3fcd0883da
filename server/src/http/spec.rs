//! The common parts of the OpenAPI document, added to every operation.
//!
//! Handlers document their own answers. Answers of extractors, access control, etags and the store follow
//! from method, path and parameters of an operation.

use axum::http::{Method, StatusCode, header};
use roost_api::frames;
use utoipa::openapi::path::{Operation, ParameterIn};
use utoipa::openapi::request_body::RequestBody;
use utoipa::openapi::schema::{Object, Type};
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{Content, Header, OpenApi, Ref, RefOr, Response};

use super::problem::ProblemKind;
use super::{access, etags};

/// Name of the security scheme of access tokens.
const TOKEN_SCHEME: &str = "token";

/// Adds the common answers and the needed scopes to every operation.
pub(crate) fn complete(spec: &mut OpenApi) {
    for (path, item) in &mut spec.paths.paths {
        let methods = [Method::GET, Method::POST, Method::PUT, Method::DELETE];
        let operations = [&mut item.get, &mut item.post, &mut item.put, &mut item.delete];
        for (method, operation) in methods.iter().zip(operations) {
            if let Some(operation) = operation {
                add_answers(method, path, operation);
                operation.security = Some(scopes(method, path));
            }
        }
    }
    let bearer = SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer));
    spec.components.get_or_insert_default().security_schemes.insert(TOKEN_SCHEME.to_owned(), bearer.into());
}

fn add_answers(method: &Method, path: &str, operation: &mut Operation) {
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
            .description(Some("The next page as `<ADDRESS>; rel=\"next\"`; absent on the last page"));
        page.headers.insert(header::LINK.as_str().to_owned(), next.build().into());
    }
    if *method == Method::GET && etags::has_etag(path) {
        let unchanged = Response::new("Unchanged since the `etag` in `if-none-match`");
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

/// The problems that a request can cause before its handler runs, and those of the store.
fn kinds(method: &Method, path: &str, operation: &Operation) -> Vec<ProblemKind> {
    let mut kinds = vec![ProblemKind::Unavailable, ProblemKind::Internal];
    if !access::scopes_of(method, path).is_empty() {
        kinds.extend([
            ProblemKind::Unauthorized,
            ProblemKind::Forbidden,
            ProblemKind::TooManyRequests,
            ProblemKind::WrongHost,
        ]);
        if *method != Method::GET {
            kinds.push(ProblemKind::CrossSite);
        }
    }
    for parameter in operation.parameters.iter().flatten() {
        let RefOr::T(parameter) = parameter else { continue };
        kinds.extend(match parameter.parameter_in {
            ParameterIn::Path => Some(ProblemKind::InvalidPath),
            ParameterIn::Query => Some(ProblemKind::InvalidQuery),
            _ if parameter.name == "Idempotency-Key" => Some(ProblemKind::InvalidKey),
            _ => Some(ProblemKind::InvalidQuery),
        });
    }
    if let Some(RefOr::T(body)) = &operation.request_body {
        kinds.extend([ProblemKind::UnreadableBody, ProblemKind::SlowBody, ProblemKind::TooLarge]);
        match is_json(body) {
            true => kinds.extend([ProblemKind::Syntax, ProblemKind::NotJson, ProblemKind::InvalidDocument]),
            false if body.content.contains_key(frames::MEDIA_TYPE) => kinds.push(ProblemKind::NotFrames),
            false => kinds.push(ProblemKind::NotStl),
        }
    }
    if *method != Method::GET {
        kinds.push(ProblemKind::StorageFull);
    }
    kinds
}

fn is_json(body: &RequestBody) -> bool {
    body.content.keys().any(|media_type| media_type == "application/json")
}

/// The scopes of which a request needs one, once the server has tokens.
fn scopes(method: &Method, path: &str) -> Vec<SecurityRequirement> {
    let scopes = access::scopes_of(method, path).iter();
    scopes.map(|scope| SecurityRequirement::new(TOKEN_SCHEME, [scope.as_str()])).collect()
}
