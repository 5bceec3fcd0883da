//! Reading an uploaded STL file: few at a time.

use axum::body::Bytes;
use axum::extract::{FromRequest, Request};
use tokio::sync::OwnedSemaphorePermit;

use super::extract::{declared_as, whole_body};
use super::problem::{ApiError, Kind};
use crate::app::App;

/// What a file may be declared as.
const MEDIA_TYPES: [&str; 2] = [roost_api::mesh::MEDIA_TYPE, "application/octet-stream"];

/// Files that are read and stored at once: in memory each is several times its length.
pub(crate) const AT_ONCE: usize = 2;

/// A file as it arrived.
pub(crate) struct Upload {
    pub(crate) file: Bytes,
    /// Held until it is stored; the server never takes the places away.
    pub(crate) turn: Option<OwnedSemaphorePermit>,
}

impl FromRequest<App> for Upload {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &App) -> Result<Self, ApiError> {
        declared_as(request.headers(), MEDIA_TYPES, Kind::NotStl)?;
        let file = whole_body(request, app).await?;
        // Only now, so that a slow sender keeps nobody else waiting.
        let turn = app.uploads.clone().acquire_owned().await.ok();
        Ok(Self { file, turn })
    }
}
