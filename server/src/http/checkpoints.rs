//! Checkpoints of running jobs: a worker uploads them in parts, and the next worker downloads the newest.

use axum::Json;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use roost_api::checkpoint::{CheckpointReceipt, MEDIA_TYPE};
use roost_api::ids::{JobId, WorkerId};
use roost_api::problem::Problem;
use serde::Deserialize;
use utoipa::IntoParams;

use super::extract::{Params, Segments};
use super::parts::{Part, Received};
use super::problem::{ApiError, ProblemKind};
use crate::state::App;

/// Query of a part of an upload.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct UploadQuery {
    /// The worker that uploads it.
    #[param(value_type = uuid::Uuid)]
    worker_id: WorkerId,
    /// Simulated time of the checkpoint since the beginning of the run, in seconds.
    #[param(minimum = 0)]
    simulated_s: f64,
    /// Size of the whole checkpoint, in bytes.
    #[param(minimum = 1)]
    bytes: u64,
    /// BLAKE3 hash of the whole checkpoint: 64 hexadecimal digits in lower case.
    #[param(pattern = "^[0-9a-f]{64}$")]
    digest: String,
    /// Bytes before this part.
    #[serde(default)]
    offset: u64,
}

/// Uploads a part of a checkpoint of an attempt. Send the part that begins at `received` of the last answer, until all parts have arrived.
/// The checkpoint then replaces the stored one of the job.
#[utoipa::path(put, path = "/v1/jobs/{id}/attempts/{n}/checkpoint", tag = "workers", operation_id = "upload_checkpoint",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt"), UploadQuery),
    request_body(description = "The bytes from `offset` on, of the whole checkpoint or of a part",
                 content(("application/vnd.roost.checkpoint"), ("application/octet-stream"))),
    responses((status = 200, description = "The bytes that the server has, and whether the checkpoint is recorded",
               body = CheckpointReceipt),
              (status = 404, description = "No such job or attempt", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The attempt is stale: nothing changed", body = Problem,
               content_type = "application/problem+json"),
              (status = 413, description = "The checkpoint exceeds the size limit", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "The bytes differ from `bytes` or `digest`", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn upload(
    State(app): State<App>,
    Segments((job, attempt)): Segments<(JobId, u32)>,
    Params(query): Params<UploadQuery>,
    request: Request,
) -> Result<Json<CheckpointReceipt>, ApiError> {
    if !query.simulated_s.is_finite() || query.simulated_s < 0.0 {
        let detail = format!("simulated_s {} is out of range: allowed is a number from 0", query.simulated_s);
        return Err(ApiError::new(ProblemKind::InvalidQuery, detail));
    }
    let UploadQuery { worker_id: worker, simulated_s, bytes, digest, offset } = query;
    let part = Part { job, attempt, worker, bytes, digest, offset };
    match part.receive(&app, &app.checkpoint_uploads, "checkpoint", request).await? {
        Received::Some(received) => Ok(Json(CheckpointReceipt { received, recorded: false })),
        Received::All(whole) => {
            let recorded = app.store.record_checkpoint(job, attempt, worker, whole, simulated_s).await??;
            app.progress.touch(job);
            Ok(Json(CheckpointReceipt { received: bytes, recorded }))
        }
    }
}

/// Downloads the checkpoint that an attempt recorded, while it is the newest of the job.
#[utoipa::path(get, path = "/v1/jobs/{id}/attempts/{n}/checkpoint", tag = "workers",
    operation_id = "download_checkpoint",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt that recorded it")),
    responses((status = 200, description = "The checkpoint", content(("application/vnd.roost.checkpoint"))),
              (status = 404, description = "No such job, or no such checkpoint", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn download(
    State(app): State<App>,
    Segments((job, attempt)): Segments<(JobId, u32)>,
) -> Result<Response, ApiError> {
    let none = || {
        let detail =
            "this attempt has no stored checkpoint: only the newest of a job that has not ended is kept";
        ApiError::new(ProblemKind::NotFound, detail)
    };
    let stored = app.store.checkpoint(job, attempt).await??.ok_or_else(none)?;
    let bytes = app.store.read_object(&stored.digest, 0..stored.bytes).await?.ok_or_else(none)?;
    Ok(whole(Body::from_stream(bytes), stored.bytes))
}

/// The answer with a whole checkpoint or fill.
pub(super) fn whole(body: Body, bytes: u64) -> Response {
    let mut response = body.into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE));
    headers.insert(header::CONTENT_LENGTH, bytes.into());
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    response
}

/// Query of a discarded checkpoint.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct DiscardQuery {
    /// The worker of the attempt.
    #[param(value_type = uuid::Uuid)]
    worker_id: WorkerId,
}

/// Deletes the checkpoint of earlier attempts: this attempt cannot use it, and begins at zero. Repeating it is safe.
#[utoipa::path(delete, path = "/v1/jobs/{id}/attempts/{n}/checkpoint", tag = "workers",
    operation_id = "discard_checkpoint",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt that begins at zero"), DiscardQuery),
    responses((status = 204, description = "Deleted by this request or by an earlier one"),
              (status = 404, description = "No such job or attempt", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The attempt is stale: nothing changed", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn discard(
    State(app): State<App>,
    Segments((job, attempt)): Segments<(JobId, u32)>,
    Params(query): Params<DiscardQuery>,
) -> Result<StatusCode, ApiError> {
    app.store.discard_checkpoint(job, attempt, query.worker_id).await??;
    tracing::warn!(%job, attempt, "the worker cannot use the checkpoint of this job: the job begins at zero");
    app.progress.touch(job);
    Ok(StatusCode::NO_CONTENT)
}
