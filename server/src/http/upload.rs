//! The body of an STL upload. Few are handled at a time, which bounds memory.

use axum::body::Bytes;
use axum::extract::{FromRequest, Request};
use tokio::sync::OwnedSemaphorePermit;

use super::extract::{check_media_type, whole_body};
use super::problem::{ApiError, ProblemKind};
use crate::state::App;

/// Media types of an upload.
const MEDIA_TYPES: [&str; 2] = [roost_api::mesh::MEDIA_TYPE, "application/octet-stream"];

/// Maximum of files that are parsed and stored at once: in memory each takes several times its length.
pub(crate) const MAX_UPLOADS: usize = 2;

/// An uploaded file.
pub(crate) struct Upload {
    pub(crate) file: Bytes,
    /// Held until the file is stored.
    pub(crate) slot: Option<OwnedSemaphorePermit>,
}

impl FromRequest<App> for Upload {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &App) -> Result<Self, ApiError> {
        check_media_type(request.headers(), MEDIA_TYPES, ProblemKind::NotStl)?;
        let file = whole_body(request, app).await?;
        // Acquired after reading, so that a slow sender blocks nobody.
        let slot = app.upload_slots.clone().acquire_owned().await.ok();
        Ok(Self { file, slot })
    }
}
