//! Meshes: upload, list, show, download.

use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use roost_api::mesh::{MEDIA_TYPE, MeshView, digest_pattern, is_digest};
use roost_api::page::Page;
use roost_api::problem::Problem;
use serde::Deserialize;
use utoipa::openapi::schema::{ObjectBuilder, Type};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{IntoParams, PartialSchema, ToSchema};

use super::blocking::run_blocking;
use super::etags::matches_etag;
use super::extract::{Params, Segments};
use super::page::{cursor, limit, limit_schema, page};
use super::problem::{ApiError, ProblemKind};
use super::upload::Upload;
use crate::mesh;
use crate::state::App;

/// A mesh digest in a path.
#[derive(Deserialize)]
#[serde(try_from = "String")]
pub(crate) struct Digest(String);

impl TryFrom<String> for Digest {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match is_digest(&text) {
            true => Ok(Self(text)),
            false => Err(format!("`{text}` is not a digest: send 64 lower-case hexadecimal digits")),
        }
    }
}

impl PartialSchema for Digest {
    fn schema() -> RefOr<Schema> {
        ObjectBuilder::new().schema_type(Type::String).pattern(Some(digest_pattern())).into()
    }
}

impl ToSchema for Digest {}

/// Uploads an STL file. A file that was uploaded before is not stored again.
#[utoipa::path(post, path = "/v1/meshes", tag = "meshes", operation_id = "upload_mesh",
    request_body(description = "The file", content(("model/stl"), ("application/octet-stream"))),
    responses((status = 201, description = "Stored", body = MeshView),
              (status = 200, description = "Already stored", body = MeshView),
              (status = 413, description = "The file exceeds the size limit", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "Not a valid STL file; `detail` states the reason", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn upload(
    State(app): State<App>,
    Upload { file, slot: _slot }: Upload,
) -> Result<(StatusCode, [(HeaderName, String); 1], Json<MeshView>), ApiError> {
    let now = app.clock.now();
    let (file, read) = run_blocking(move || {
        let read = mesh::read(&file, now);
        (file, read)
    })
    .await?;
    let mesh = read.map_err(|error| ApiError::new(ProblemKind::InvalidMesh, error.to_string()))?;
    let location = [(header::LOCATION, format!("/v1/meshes/{}", mesh.digest))];
    if let Some(before) = app.store.mesh(&mesh.digest).await? {
        return Ok((StatusCode::OK, location, Json(before)));
    }
    let is_new = app.store.insert_mesh(mesh.clone(), &file).await?;
    tracing::info!(digest = mesh.digest, bytes = mesh.bytes, triangles = mesh.triangles, "mesh uploaded");
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    Ok((status, location, Json(view(&app, &mesh.digest).await?)))
}

/// Query of a list of meshes.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct MeshQuery {
    /// `next_cursor` of the previous page.
    #[param(value_type = Option<String>)]
    cursor: Option<i64>,
    /// Maximum of rows of the page.
    #[param(schema_with = limit_schema)]
    limit: Option<u32>,
}

/// Lists meshes, newest first.
#[utoipa::path(get, path = "/v1/meshes", tag = "meshes", operation_id = "list_meshes", params(MeshQuery),
    responses((status = 200, description = "A page of meshes", body = Page<MeshView>)))]
pub(crate) async fn list(
    State(app): State<App>,
    uri: Uri,
    Params(query): Params<MeshQuery>,
) -> Result<Response, ApiError> {
    let (meshes, next) = app.store.meshes(cursor(query.cursor)?, limit(query.limit)?).await?;
    Ok(page(&uri, meshes, next))
}

/// Shows a mesh: size, triangles, and whether it is closed.
#[utoipa::path(get, path = "/v1/meshes/{digest}", tag = "meshes", operation_id = "show_mesh",
    params(("digest" = inline(Digest), Path, description = "blake3 of the file")),
    responses((status = 200, description = "The mesh", body = MeshView),
              (status = 404, description = "No such mesh", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn show(
    State(app): State<App>,
    Segments(Digest(digest)): Segments<Digest>,
) -> Result<Json<MeshView>, ApiError> {
    view(&app, &digest).await.map(Json)
}

async fn view(app: &App, digest: &str) -> Result<MeshView, ApiError> {
    let mesh = app.store.mesh(digest).await?;
    mesh.ok_or_else(|| {
        ApiError::new(
            ProblemKind::NotFound,
            format!("there is no mesh {digest}: upload it with POST /v1/meshes"),
        )
    })
}

/// Downloads the file of a mesh as it was uploaded. It never changes and may be cached for ever.
#[utoipa::path(get, path = "/v1/meshes/{digest}/file", tag = "meshes", operation_id = "mesh_file",
    params(("digest" = inline(Digest), Path, description = "blake3 of the file")),
    responses((status = 200, description = "The file", content(("model/stl"))),
              (status = 304, description = "Unchanged: `if-none-match` has its `etag`"),
              (status = 404, description = "No such mesh", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn file(
    State(app): State<App>,
    Segments(Digest(digest)): Segments<Digest>,
    request: HeaderMap,
) -> Result<Response, ApiError> {
    let mesh = view(&app, &digest).await?;
    let etag = HeaderValue::try_from(format!("\"{digest}\"")).expect("hexadecimal digits");
    let is_unchanged = matches_etag(&request, &etag);
    let caching = [
        (header::ETAG, etag),
        (header::CACHE_CONTROL, HeaderValue::from_static("private, max-age=31536000, immutable")),
    ];
    if is_unchanged {
        return Ok((StatusCode::NOT_MODIFIED, caching).into_response());
    }
    let about = [
        (header::CONTENT_TYPE, MEDIA_TYPE.to_owned()),
        (header::CONTENT_LENGTH, mesh.bytes.to_string()),
        // No browser shall interpret the bytes as a page.
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff".to_owned()),
    ];
    // Part by part, which bounds the memory of concurrent downloads.
    let parts = stream::try_unfold((app, digest, 0), |(app, digest, part)| async move {
        let data = app.store.mesh_part(&digest, part).await.inspect_err(|error| {
            tracing::error!(error = error.as_dyn(), digest, "the download of a mesh failed");
        })?;
        Ok::<_, crate::store::StoreError>(data.map(|data| (data, (app, digest, part + 1))))
    });
    Ok((caching, about, Body::from_stream(parts)).into_response())
}
