//! Checkpoints of running jobs: a worker uploads them in parts, and the next worker downloads the newest.

use axum::Json;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use roost_api::checkpoint::{CheckpointReceipt, MEDIA_TYPE};
use roost_api::ids::{JobId, WorkerId};
use roost_api::problem::Problem;
use serde::Deserialize;
use utoipa::IntoParams;

use super::extract::{Params, Segments, check_media_type, incomplete_body};
use super::problem::{ApiError, ProblemKind};
use crate::state::{App, UploadKey};
use crate::store::StageError;

/// Media types of an upload.
const MEDIA_TYPES: [&str; 2] = [MEDIA_TYPE, "application/octet-stream"];

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

impl UploadQuery {
    fn check(&self) -> Result<(), ApiError> {
        let is_digest = self.digest.len() == 64
            && self.digest.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        let detail = if !self.simulated_s.is_finite() || self.simulated_s < 0.0 {
            format!("simulated_s {} is out of range: allowed is a number from 0", self.simulated_s)
        } else if self.bytes == 0 {
            "bytes 0 is out of range: allowed is a whole number from 1".to_owned()
        } else if !is_digest {
            "digest is not a BLAKE3 hash: send 64 hexadecimal digits in lower case".to_owned()
        } else if self.offset >= self.bytes {
            format!("offset {} is out of range: allowed is a number below bytes, {}", self.offset, self.bytes)
        } else {
            return Ok(());
        };
        Err(ApiError::new(ProblemKind::InvalidQuery, detail))
    }
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
    query.check()?;
    check_media_type(request.headers(), MEDIA_TYPES, ProblemKind::NotCheckpoint)?;
    // Refuse a stale attempt before its megabytes are sent.
    app.store.may_write(job, attempt, query.worker_id).await??;
    let limit = app.config.max_checkpoint_bytes;
    if query.bytes > limit {
        let detail = format!(
            "the checkpoint of {} bytes is larger than {limit} bytes (checkpoint-limit-mib, which the operator can set)",
            query.bytes
        );
        return Err(ApiError::new(ProblemKind::TooLarge, detail));
    }
    let key = UploadKey { job, attempt, digest: query.digest };
    let received = app.checkpoint_uploads.received(&key);
    let mut body = request.into_body().into_data_stream();
    let length = query.bytes - query.offset;
    if received != query.offset {
        // A client reads the answer after it has sent the body.
        let mut rest = length;
        while let Some(Ok(chunk)) = body.next().await
            && let Some(less) = rest.checked_sub(chunk.len() as u64)
        {
            rest = less;
        }
        return Ok(Json(CheckpointReceipt { received, recorded: false }));
    }
    let part = app.store.stage(body, length).await.map_err(|unstaged| match unstaged {
        StageError::Broken(error) => incomplete_body(&error),
        StageError::TooLong => {
            let detail = format!("the body is longer than bytes − offset, {length} bytes: nothing is stored");
            ApiError::new(ProblemKind::WrongResult, detail)
        }
        StageError::Store(error) => error.into(),
    })?;
    let added = app.checkpoint_uploads.add(&key, query.offset, part, query.bytes);
    for part in added.unused {
        app.store.discard(part).await;
    }
    let Some(parts) = added.complete else {
        return Ok(Json(CheckpointReceipt { received: added.received, recorded: false }));
    };
    let whole = app.store.join(parts).await?;
    if whole.digest != key.digest {
        let detail =
            format!("the bytes have the digest {}, not {}: upload them again", whole.digest, key.digest);
        app.store.discard(whole).await;
        return Err(ApiError::new(ProblemKind::WrongResult, detail));
    }
    let recorded = app.store.record_checkpoint(job, attempt, query.worker_id, whole, query.simulated_s);
    let recorded = recorded.await??;
    app.progress.touch(job);
    Ok(Json(CheckpointReceipt { received: added.received, recorded }))
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
    let mut response = Body::from_stream(bytes).into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE));
    headers.insert(header::CONTENT_LENGTH, stored.bytes.into());
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    Ok(response)
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
