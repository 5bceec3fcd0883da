//! The body of a delivery: a document of one attempt that exists, or of several attempts. A memory budget limits concurrent deliveries.

use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::header::CONTENT_LENGTH;
use roost_api::ids::JobId;
use tokio::sync::OwnedSemaphorePermit;

use super::blocking::{is_short, run_blocking_if_long};
use super::extract::{Segments, json_bytes, parsed};
use super::problem::ApiError;
use crate::document::{DocumentType, read_document, read_valid};
use crate::state::App;

/// Maximum of deliveries of the maximum length that are parsed and recorded at once: in memory each takes
/// several times its body.
const MAX_LONG_DELIVERIES: usize = 2;

/// Memory budget of deliveries, in KiB of their bodies: many short ones share a commit, a few long ones fill
/// the budget.
pub(crate) fn budget_kib(max_result_bytes: usize) -> usize {
    MAX_LONG_DELIVERIES * kib(max_result_bytes) as usize
}

fn kib(bytes: usize) -> u32 {
    u32::try_from(bytes.div_ceil(1024).max(1)).unwrap_or(u32::MAX)
}

/// The body of a delivery.
pub(crate) struct DeliveryBody<T> {
    pub(crate) document: T,
    /// Length of the body.
    pub(crate) bytes: usize,
    /// Its part of the memory budget, held until it is recorded.
    pub(crate) budget: Option<OwnedSemaphorePermit>,
}

/// A delivery to an attempt that exists.
pub(crate) struct Delivery<T> {
    pub(crate) job: JobId,
    pub(crate) attempt: u32,
    pub(crate) body: DeliveryBody<T>,
}

impl<T: DocumentType> FromRequest<App> for DeliveryBody<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &App) -> Result<Self, ApiError> {
        let text = json_bytes(request, app).await?;
        let bytes = text.len();
        // Acquired after reading, so that a slow sender blocks nobody.
        let budget = app.delivery_budget.clone().acquire_many_owned(kib(bytes)).await.ok();
        let read = move || {
            // Only an invalid document is parsed again, to find all of its faults.
            match read_valid(&text) {
                Some(document) => Ok(document),
                None => read_document(parsed(&text)?).map_err(ApiError::faults),
            }
        };
        Ok(Self { document: run_blocking_if_long(bytes, read).await??, bytes, budget })
    }
}

impl<T: DocumentType> FromRequest<App> for Delivery<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &App) -> Result<Self, ApiError> {
        let (mut parts, body) = request.into_parts();
        let Segments((job, attempt)) = Segments::from_request_parts(&mut parts, app).await?;
        // Refuse a long delivery to an unknown attempt before its megabytes are sent. A short one is checked
        // when it is recorded.
        let length = parts.headers.get(CONTENT_LENGTH).and_then(|value| value.to_str().ok()?.parse().ok());
        if !length.is_some_and(is_short) {
            app.store.find_attempt(job, attempt).await??;
        }
        match DeliveryBody::from_request(Request::from_parts(parts, body), app).await {
            Ok(body) => Ok(Self { job, attempt, body }),
            Err(fault) if fault.is_of_document() => {
                // For an unknown attempt, 404 comes before the faults of the document.
                app.store.find_attempt(job, attempt).await??;
                Err(fault)
            }
            Err(fault) => Err(fault),
        }
    }
}
