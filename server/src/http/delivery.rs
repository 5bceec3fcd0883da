//! Reading what attempts deliver: documents of attempts that exist, few long ones at a time or many short ones.

use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::header::CONTENT_LENGTH;
use roost_api::ids::JobId;
use serde::Serialize;
use serde::de::DeserializeOwned;
use tokio::sync::OwnedSemaphorePermit;

use super::aside::{is_short, unless_short};
use super::extract::{Segments, json_bytes, parsed};
use super::problem::ApiError;
use crate::app::App;
use crate::document::read_document;

/// Deliveries of the greatest length that are parsed and recorded at once: in memory each is several times its body.
const AT_ONCE: usize = 2;

/// Places for deliveries, one a KiB: many short ones share a commit, a few long ones fill the memory that they may have.
pub(crate) fn places(max_result_bytes: usize) -> usize {
    AT_ONCE * kib(max_result_bytes) as usize
}

fn kib(bytes: usize) -> u32 {
    u32::try_from(bytes.div_ceil(1024).max(1)).unwrap_or(u32::MAX)
}

/// A delivery to an attempt that exists.
pub(crate) struct Delivery<T> {
    pub(crate) job: JobId,
    pub(crate) attempt: u32,
    pub(crate) body: T,
    /// Length of the body as it was sent.
    pub(crate) bytes: usize,
    /// Its places, held until it is recorded; the server never takes them away.
    pub(crate) turn: Option<OwnedSemaphorePermit>,
}

impl<T: DeserializeOwned + Serialize + Send + 'static> FromRequest<App> for Delivery<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &App) -> Result<Self, ApiError> {
        let (mut parts, body) = request.into_parts();
        let Segments((job, attempt)) = Segments::from_request_parts(&mut parts, app).await?;
        // Nobody sends megabytes to learn that there is no such attempt; what is short is looked up when it is recorded.
        let length = parts.headers.get(CONTENT_LENGTH).and_then(|value| value.to_str().ok()?.parse().ok());
        if !length.is_some_and(is_short) {
            app.store.find_attempt(job, attempt).await??;
        }
        let bytes = json_bytes(Request::from_parts(parts, body), app).await?;
        // Only now, so that a slow sender keeps nobody else waiting.
        let turn = app.deliveries.clone().acquire_many_owned(kib(bytes.len())).await.ok();
        let length = bytes.len();
        let body = unless_short(length, move || {
            // Without a detour where there is nothing to complain of.
            let sound =
                bytes.trim_ascii_start().starts_with(b"{").then(|| serde_json::from_slice(&bytes).ok());
            match sound.flatten() {
                Some(body) => Ok(body),
                None => read_document(parsed(&bytes)?).map_err(ApiError::faults),
            }
        });
        match body.await? {
            Ok(body) => Ok(Self { job, attempt, body, bytes: length, turn }),
            Err(fault) => {
                // What is wrong with it matters only where it belongs.
                app.store.find_attempt(job, attempt).await??;
                Err(fault)
            }
        }
    }
}
