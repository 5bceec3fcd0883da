//! Frames of a job: a worker uploads them, a browser fetches as much of them as it needs.

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
use super::extract::{Params, Segments, broken_off, declared_as};
use super::problem::{ApiError, Kind};
use super::tags::has_seen;
use crate::app::App;
use crate::store::{StoredFrames, Unstaged};

/// What a stream may be declared as.
const MEDIA_TYPES: [&str; 2] = [MEDIA_TYPE, "application/octet-stream"];

/// The most frames that may be counted: a number that JSON keeps in every language.
const MAX_COUNT: u64 = (1 << 53) - 1;

/// What the reason for which frames end may be long.
const MAX_REASON: usize = 500;

/// What a worker says of the frames that it uploads.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct FramesQuery {
    /// Who uploads them.
    #[param(value_type = uuid::Uuid)]
    worker_id: WorkerId,
    /// Frames in the stream, 1 to 2^53 - 1.
    #[param(minimum = 1, maximum = 9_007_199_254_740_991u64)]
    count: u64,
    /// Why they end before the run did.
    stopped: Option<String>,
}

/// Uploads the frames of an attempt, before its result. Repeating it is safe.
#[utoipa::path(put, path = "/v1/jobs/{id}/attempts/{n}/frames", tag = "workers", operation_id = "upload_frames",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("n" = u32, Path, description = "Number of the attempt"), FramesQuery),
    request_body(description = "A stream `roost.frames/1`",
                 content(("application/vnd.roost.frames"), ("application/octet-stream"))),
    responses((status = 200, description = "Kept, now or before", body = Receipt),
              (status = 404, description = "No such job or attempt", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The attempt is stale: nothing changed", body = Problem,
               content_type = "application/problem+json"),
              (status = 413, description = "Over the limit", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "No frames", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn upload(
    State(app): State<App>,
    Segments((job, attempt)): Segments<(JobId, u32)>,
    Params(query): Params<FramesQuery>,
    request: Request,
) -> Result<Json<Receipt>, ApiError> {
    if !(1..=MAX_COUNT).contains(&query.count) {
        let detail = format!("count {} is not within 1 to {MAX_COUNT}", query.count);
        return Err(ApiError::new(Kind::InvalidQuery, detail));
    }
    declared_as(request.headers(), MEDIA_TYPES, Kind::NotFrames)?;
    // Nobody sends megabytes to learn that they are not wanted.
    app.store.may_write(job, attempt, query.worker_id).await??;
    let limit = app.config.max_frames_bytes;
    let too_large = || {
        let detail = format!(
            "the frames are larger than {limit} bytes (max_frames_bytes, which the operator can set)"
        );
        ApiError::new(Kind::TooLarge, detail)
    };
    let declared =
        request.headers().get(header::CONTENT_LENGTH).and_then(|value| value.to_str().ok()?.parse().ok());
    if declared.is_some_and(|bytes: u64| bytes > limit) {
        return Err(too_large());
    }
    let staged = app.store.stage(request.into_body().into_data_stream(), limit).await;
    let staged = staged.map_err(|unstaged| match unstaged {
        Unstaged::Broken(error) => broken_off(&error),
        Unstaged::TooLong => too_large(),
        Unstaged::Store(error) => error.into(),
    })?;
    if staged.head != MAGIC {
        app.store.discard(staged).await;
        return Err(ApiError::new(
            Kind::WrongResult,
            "this is no stream of frames: it begins with other bytes",
        ));
    }
    let stopped = query.stopped.map(|why| why.chars().take(MAX_REASON).collect());
    let about = (query.count, stopped);
    let recorded = app.store.record_frames(job, attempt, query.worker_id, staged, about, app.clock.now());
    Ok(Json(Receipt { recorded: recorded.await?? }))
}

/// The frames of a job, or a part of them: the stream `roost.frames/1` of its newest attempt.
#[utoipa::path(get, path = "/v1/jobs/{id}/frames", tag = "results", operation_id = "job_frames",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("Range" = Option<String>, Header, description = "Only these bytes, such as `bytes=0-999`")),
    responses((status = 200, description = "All of it", content(("application/vnd.roost.frames"))),
              (status = 206, description = "The bytes asked for", content(("application/vnd.roost.frames"))),
              (status = 304, description = "`if-none-match` names it: it is there already"),
              (status = 404, description = "No such job, or no frames (yet)", body = Problem,
               content_type = "application/problem+json"),
              (status = 416, description = "There are no such bytes", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn frames(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
    asked: HeaderMap,
) -> Result<Response, ApiError> {
    let none = || {
        let detail = "the job has no frames: it was not asked for any (frame_interval_s), or has not run yet";
        ApiError::new(Kind::NotFound, detail)
    };
    let StoredFrames { object, bytes, state } = app.store.frames(id).await??.ok_or_else(none)?;
    let etag = HeaderValue::try_from(format!("\"{object}\"")).map_err(|_| none())?;
    // What has not succeeded may run again, and then has others.
    let caching =
        if state == JobState::Succeeded { "private, max-age=31536000, immutable" } else { "no-cache" };
    let about = [
        (header::ETAG, etag.clone()),
        (header::CACHE_CONTROL, HeaderValue::from_static(caching)),
        (header::ACCEPT_RANGES, HeaderValue::from_static("bytes")),
    ];
    if has_seen(&asked, &etag) {
        return Ok((StatusCode::NOT_MODIFIED, about).into_response());
    }
    let part = match part(&asked, &etag, bytes) {
        Ok(part) => part,
        Err(Unsatisfiable) => {
            let detail = format!("there are {bytes} bytes, and none of those that `range` asks for");
            let mut response = ApiError::new(Kind::NoSuchRange, detail).into_response();
            let all = HeaderValue::try_from(format!("bytes */{bytes}")).map_err(|_| none())?;
            response.headers_mut().insert(header::CONTENT_RANGE, all);
            return Ok(response);
        }
    };
    let (first, last) = part.unwrap_or((0, bytes - 1));
    let Some(stream) = app.store.read_object(&object, first..last + 1).await? else {
        tracing::error!(job = %id, object, "the frames of a job are not where they were");
        return Err(ApiError::new(
            Kind::NotFound,
            "the frames of this job are lost; the server's log says more",
        ));
    };
    let mut response = (about, Body::from_stream(stream)).into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE));
    headers.insert(header::CONTENT_LENGTH, (last + 1 - first).into());
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    if part.is_some() {
        let range = HeaderValue::try_from(format!("bytes {first}-{last}/{bytes}")).map_err(|_| none())?;
        headers.insert(header::CONTENT_RANGE, range);
        *response.status_mut() = StatusCode::PARTIAL_CONTENT;
    }
    Ok(response)
}

/// A range that has nothing of the bytes there are.
struct Unsatisfiable;

/// The one range that is asked for, first and last byte; none means all, as do several at once and what cannot be read.
fn part(asked: &HeaderMap, etag: &HeaderValue, bytes: u64) -> Result<Option<(u64, u64)>, Unsatisfiable> {
    let of_another = asked.get(header::IF_RANGE).is_some_and(|seen| seen != etag);
    let range = asked.get(header::RANGE).and_then(|value| value.to_str().ok()).filter(|_| !of_another);
    let Some(Ok(ranges)) = range.map(parse_range_header) else { return Ok(None) };
    match ranges.validate(bytes).as_deref() {
        Ok([one]) => Ok(Some((*one.start(), *one.end()))),
        Ok(_) => Ok(None),
        // More than there is from the end is all of it.
        Err(RangeUnsatisfiableError::FileSuffixOutOfBounds) => Ok(None),
        Err(_) => Err(Unsatisfiable),
    }
}
