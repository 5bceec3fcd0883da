//! Frames of a job: a worker uploads them, a browser downloads the ranges that it needs.

use axum::Json;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use http_range_header::{RangeUnsatisfiableError, parse_range_header};
use roost_api::frames::{MAGIC, MEDIA_TYPE};
use roost_api::ids::{JobId, WorkerId};
use roost_api::job::JobState;
use roost_api::problem::Problem;
use serde::Deserialize;
use utoipa::IntoParams;

use super::attempts::Receipt;
use super::etags::matches_etag;
use super::extract::{Params, Segments, check_media_type, incomplete_body};
use super::problem::{ApiError, ProblemKind};
use crate::state::App;
use crate::store::{StageError, StoredFrames};

/// Media types of an upload.
const MEDIA_TYPES: [&str; 2] = [MEDIA_TYPE, "application/octet-stream"];

/// Maximum number of frames: the largest integer that JSON preserves in every language.
const MAX_COUNT: u64 = (1 << 53) - 1;

/// Maximum length of `stopped`, in characters.
const MAX_REASON_CHARS: usize = 500;

/// Query of an upload of frames.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct FramesQuery {
    /// The worker that uploads them.
    #[param(value_type = uuid::Uuid)]
    worker_id: WorkerId,
    /// Number of frames in the stream, 1 to 2^53 - 1.
    #[param(minimum = 1, maximum = 9_007_199_254_740_991u64)]
    count: u64,
    /// Why recording stopped before the end of the run.
    stopped: Option<String>,
}

/// Uploads the frames of an attempt, before its result. Repeating it is safe.
#[utoipa::path(put, path = "/v1/jobs/{id}/attempts/{n}/frames", tag = "workers", operation_id = "upload_frames",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt"), FramesQuery),
    request_body(description = "A stream `roost.frames/1`",
                 content(("application/vnd.roost.frames"), ("application/octet-stream"))),
    responses((status = 200, description = "Stored by this request or by an earlier one", body = Receipt),
              (status = 404, description = "No such job or attempt", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The attempt is stale: nothing changed", body = Problem,
               content_type = "application/problem+json"),
              (status = 413, description = "The frames exceed the size limit", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "The body is not a stream of frames", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn upload(
    State(app): State<App>,
    Segments((job, attempt)): Segments<(JobId, u32)>,
    Params(query): Params<FramesQuery>,
    request: Request,
) -> Result<Json<Receipt>, ApiError> {
    if !(1..=MAX_COUNT).contains(&query.count) {
        let detail = format!("count {} is out of range: allowed is 1 to {MAX_COUNT}", query.count);
        return Err(ApiError::new(ProblemKind::InvalidQuery, detail));
    }
    check_media_type(request.headers(), MEDIA_TYPES, ProblemKind::NotFrames)?;
    // Refuse a stale attempt before its megabytes are sent.
    app.store.may_write(job, attempt, query.worker_id).await??;
    let limit = app.config.max_frames_bytes;
    let too_large = || {
        let detail = format!(
            "the frames are larger than {limit} bytes (max_frames_bytes, which the operator can set): record fewer"
        );
        ApiError::new(ProblemKind::TooLarge, detail)
    };
    let declared =
        request.headers().get(header::CONTENT_LENGTH).and_then(|value| value.to_str().ok()?.parse().ok());
    if declared.is_some_and(|bytes: u64| bytes > limit) {
        return Err(too_large());
    }
    let staged = app.store.stage(request.into_body().into_data_stream(), limit).await;
    let staged = staged.map_err(|unstaged| match unstaged {
        StageError::Broken(error) => incomplete_body(&error),
        StageError::TooLong => too_large(),
        StageError::Store(error) => error.into(),
    })?;
    if staged.head != MAGIC {
        app.store.discard(staged).await;
        return Err(ApiError::new(
            ProblemKind::WrongResult,
            "the body is not a stream `roost.frames/1`: its first bytes differ",
        ));
    }
    let stopped = query.stopped.map(|why| why.chars().take(MAX_REASON_CHARS).collect());
    let about = (query.count, stopped);
    let recorded = app.store.record_frames(job, attempt, query.worker_id, staged, about, app.clock.now());
    Ok(Json(Receipt { recorded: recorded.await?? }))
}

/// Downloads the frames of a job, or a range of them: the stream `roost.frames/1` of its newest attempt.
#[utoipa::path(get, path = "/v1/jobs/{id}/frames", tag = "results", operation_id = "job_frames",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("Range" = Option<String>, Header, description = "Only this range, such as `bytes=0-999`")),
    responses((status = 200, description = "The whole stream", content(("application/vnd.roost.frames"))),
              (status = 206, description = "The requested range", content(("application/vnd.roost.frames"))),
              (status = 304, description = "Unchanged: `if-none-match` has its `etag`"),
              (status = 404, description = "No such job, or no frames (yet)", body = Problem,
               content_type = "application/problem+json"),
              (status = 416, description = "The range is outside the stream", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn frames(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
    request: HeaderMap,
) -> Result<Response, ApiError> {
    let none = || {
        let detail = "the job has no frames: it was submitted without frame_interval_s, or has not run yet";
        ApiError::new(ProblemKind::NotFound, detail)
    };
    let StoredFrames { object, bytes, state } = app.store.frames(id).await??.ok_or_else(none)?;
    let etag = HeaderValue::try_from(format!("\"{object}\"")).map_err(|_| none())?;
    // A job that has not succeeded may run again and record other frames.
    let caching =
        if state == JobState::Succeeded { "private, max-age=31536000, immutable" } else { "no-cache" };
    let about = [
        (header::ETAG, etag.clone()),
        (header::CACHE_CONTROL, HeaderValue::from_static(caching)),
        (header::ACCEPT_RANGES, HeaderValue::from_static("bytes")),
    ];
    if matches_etag(&request, &etag) {
        return Ok((StatusCode::NOT_MODIFIED, about).into_response());
    }
    let range = match requested_range(&request, &etag, bytes) {
        Ok(range) => range,
        Err(Unsatisfiable) => {
            let detail = format!("`range` is outside the {bytes} bytes of the stream");
            let mut response = ApiError::new(ProblemKind::NoSuchRange, detail).into_response();
            let all = HeaderValue::try_from(format!("bytes */{bytes}")).map_err(|_| none())?;
            response.headers_mut().insert(header::CONTENT_RANGE, all);
            return Ok(response);
        }
    };
    let (first, last) = range.unwrap_or((0, bytes - 1));
    let Some(stream) = app.store.read_object(&object, first..last + 1).await? else {
        tracing::error!(job = %id, object, "the object of recorded frames is missing");
        return Err(ApiError::new(
            ProblemKind::NotFound,
            "the stored frames of this job are missing: the server's log states the object",
        ));
    };
    let mut response = (about, Body::from_stream(stream)).into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE));
    headers.insert(header::CONTENT_LENGTH, (last + 1 - first).into());
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    if range.is_some() {
        let range = HeaderValue::try_from(format!("bytes {first}-{last}/{bytes}")).map_err(|_| none())?;
        headers.insert(header::CONTENT_RANGE, range);
        *response.status_mut() = StatusCode::PARTIAL_CONTENT;
    }
    Ok(response)
}

/// The range is outside the content.
struct Unsatisfiable;

/// First and last byte of a requested range. None is the whole stream, as for several ranges or a malformed
/// header.
fn requested_range(
    request: &HeaderMap,
    etag: &HeaderValue,
    bytes: u64,
) -> Result<Option<(u64, u64)>, Unsatisfiable> {
    let is_stale = request.get(header::IF_RANGE).is_some_and(|expected| expected != etag);
    let range = request.get(header::RANGE).and_then(|value| value.to_str().ok()).filter(|_| !is_stale);
    let Some(Ok(ranges)) = range.map(parse_range_header) else { return Ok(None) };
    match ranges.validate(bytes).as_deref() {
        Ok([one]) => Ok(Some((*one.start(), *one.end()))),
        Ok(_) => Ok(None),
        // A suffix longer than the content is the whole content.
        Err(RangeUnsatisfiableError::FileSuffixOutOfBounds) => Ok(None),
        Err(_) => Err(Unsatisfiable),
    }
}
