//! Fills that jobs share: the attempt that computes one uploads it in parts, and others download it.

use axum::Json;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::Response;
use roost_api::checkpoint::CheckpointReceipt;
use roost_api::ids::{JobId, WorkerId};
use roost_api::problem::Problem;
use serde::Deserialize;
use utoipa::IntoParams;

use super::checkpoints::whole;
use super::extract::{Params, Segments};
use super::parts::{Part, Received, is_digest, read_to_end};
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
    /// Size of the whole fill, in bytes.
    #[param(minimum = 1)]
    bytes: u64,
    /// BLAKE3 hash of the whole fill: 64 hexadecimal digits in lower case.
    #[param(pattern = "^[0-9a-f]{64}$")]
    digest: String,
    /// Bytes before this part.
    #[serde(default)]
    offset: u64,
}

/// Uploads a part of the fill of a running attempt. Send the part that begins at `received` of the last answer, until all parts have
/// arrived. Jobs that wait for the fill can then be claimed. A fill that the server has is not replaced.
#[utoipa::path(put, path = "/v1/jobs/{id}/attempts/{n}/fill", tag = "workers", operation_id = "upload_fill",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt"), UploadQuery),
    request_body(description = "The bytes from `offset` on, of the whole fill or of a part",
                 content(("application/vnd.roost.checkpoint"), ("application/octet-stream"))),
    responses((status = 200, description = "The bytes that the server has, and whether the fill is recorded",
               body = CheckpointReceipt),
              (status = 404, description = "No such job or attempt", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The attempt is stale: nothing changed", body = Problem,
               content_type = "application/problem+json"),
              (status = 413, description = "The fill exceeds the size limit", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "The bytes differ from `bytes` or `digest`", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn upload(
    State(app): State<App>,
    Segments((job, attempt)): Segments<(JobId, u32)>,
    Params(query): Params<UploadQuery>,
    request: Request,
) -> Result<Json<CheckpointReceipt>, ApiError> {
    let UploadQuery { worker_id: worker, bytes, digest, offset } = query;
    app.store.may_write(job, attempt, worker).await??;
    if app.store.fill(job, attempt).await?.is_some() {
        read_to_end(request, bytes.saturating_sub(offset)).await;
        return Ok(Json(CheckpointReceipt { received: bytes, recorded: false }));
    }
    let part = Part { job, attempt, worker, bytes, digest, offset };
    let whole = match part.receive(&app, &app.fill_uploads, "fill", request).await? {
        Received::Some(received) => return Ok(Json(CheckpointReceipt { received, recorded: false })),
        Received::All(whole) => whole,
    };
    let (limit, now) = (app.config.fill_limit_bytes, app.clock.now());
    let recorded = app.store.record_fill(job, attempt, worker, whole, limit, now).await??;
    app.work.notify_waiters();
    Ok(Json(CheckpointReceipt { received: bytes, recorded }))
}

/// Downloads the stored fill that an attempt may start from.
#[utoipa::path(get, path = "/v1/jobs/{id}/attempts/{n}/fill", tag = "workers", operation_id = "download_fill",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt")),
    responses((status = 200, description = "The fill", content(("application/vnd.roost.checkpoint"))),
              (status = 404, description = "No such job or attempt, or no stored fill", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn download(
    State(app): State<App>,
    Segments((job, attempt)): Segments<(JobId, u32)>,
) -> Result<Response, ApiError> {
    app.store.find_attempt(job, attempt).await??;
    let none = || {
        let detail = "no fill for this attempt is stored: fills that nobody uses are deleted";
        ApiError::new(ProblemKind::NotFound, detail)
    };
    let stored = app.store.fill(job, attempt).await?.ok_or_else(none)?;
    let bytes = app.store.read_object(&stored.digest, 0..stored.bytes).await?.ok_or_else(none)?;
    Ok(whole(Body::from_stream(bytes), stored.bytes))
}

/// Query of a withdrawn fill.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct WithdrawQuery {
    /// The worker of the attempt.
    #[param(value_type = uuid::Uuid)]
    worker_id: WorkerId,
    /// BLAKE3 hash of a stored fill that the attempt cannot use: 64 hexadecimal digits in lower case.
    #[param(pattern = "^[0-9a-f]{64}$")]
    digest: Option<String>,
}

/// Withdraws a fill: the attempt will not upload the fill that it computes, or cannot use the stored one. No job waits for it any more, and
/// the next upload stores it again. Repeating it is safe.
#[utoipa::path(delete, path = "/v1/jobs/{id}/attempts/{n}/fill", tag = "workers", operation_id = "withdraw_fill",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt"), WithdrawQuery),
    responses((status = 204, description = "Withdrawn by this request or by an earlier one"),
              (status = 404, description = "No such job or attempt", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The attempt is stale: nothing changed", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn withdraw(
    State(app): State<App>,
    Segments((job, attempt)): Segments<(JobId, u32)>,
    Params(query): Params<WithdrawQuery>,
) -> Result<StatusCode, ApiError> {
    let WithdrawQuery { worker_id, digest } = query;
    if digest.as_deref().is_some_and(|digest| !is_digest(digest)) {
        let detail = "digest is not a BLAKE3 hash: send 64 hexadecimal digits in lower case";
        return Err(ApiError::new(ProblemKind::InvalidQuery, detail));
    }
    if app.store.withdraw_fill(job, attempt, worker_id, digest, app.clock.now()).await?? {
        tracing::warn!(%job, attempt, "a fill was withdrawn: jobs fill for themselves until the next upload");
        app.work.notify_waiters();
    }
    Ok(StatusCode::NO_CONTENT)
}
