//! Uploads in parts, of checkpoints and fills: the answer to a part says where the next one begins.

use axum::extract::Request;
use futures_util::StreamExt;
use roost_api::checkpoint::MEDIA_TYPE;
use roost_api::ids::{JobId, WorkerId};

use super::extract::{check_media_type, incomplete_body};
use super::problem::{ApiError, ProblemKind};
use crate::state::{App, PartialUploads, UploadKey};
use crate::store::{StageError, Staged};

/// Media types of an upload.
const MEDIA_TYPES: [&str; 2] = [MEDIA_TYPE, "application/octet-stream"];

/// A part of an upload of an attempt, as its query declares it.
pub(super) struct Part {
    pub(super) job: JobId,
    pub(super) attempt: u32,
    pub(super) worker: WorkerId,
    /// Size of the whole, in bytes.
    pub(super) bytes: u64,
    /// BLAKE3 hash of the whole.
    pub(super) digest: String,
    /// Bytes before this part.
    pub(super) offset: u64,
}

/// The bytes that the server has.
pub(super) enum Received {
    /// This number of bytes; the next part begins there.
    Some(u64),
    /// The whole.
    All(Staged),
}

/// Whether a text is a BLAKE3 hash.
pub(super) fn is_digest(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}

impl Part {
    fn check(&self) -> Result<(), ApiError> {
        let detail = if self.bytes == 0 {
            "bytes 0 is out of range: allowed is a whole number from 1".to_owned()
        } else if !is_digest(&self.digest) {
            "digest is not a BLAKE3 hash: send 64 hexadecimal digits in lower case".to_owned()
        } else if self.offset >= self.bytes {
            format!("offset {} is out of range: allowed is a number below bytes, {}", self.offset, self.bytes)
        } else {
            return Ok(());
        };
        Err(ApiError::new(ProblemKind::InvalidQuery, detail))
    }

    /// Receives the part. `what` names the whole in errors.
    pub(super) async fn receive(
        self,
        app: &App,
        uploads: &PartialUploads,
        what: &str,
        request: Request,
    ) -> Result<Received, ApiError> {
        self.check()?;
        check_media_type(request.headers(), MEDIA_TYPES, ProblemKind::NotCheckpoint)?;
        // Refuse a stale attempt before its megabytes are sent.
        app.store.may_write(self.job, self.attempt, self.worker).await??;
        let limit = app.config.max_checkpoint_bytes;
        if self.bytes > limit {
            let detail = format!(
                "the {what} of {} bytes is larger than {limit} bytes (checkpoint-limit-mib, which the operator can set)",
                self.bytes
            );
            return Err(ApiError::new(ProblemKind::TooLarge, detail));
        }
        let key = UploadKey { job: self.job, attempt: self.attempt, digest: self.digest };
        let received = uploads.received(&key);
        let length = self.bytes - self.offset;
        if received != self.offset {
            read_to_end(request, length).await;
            return Ok(Received::Some(received));
        }
        let body = request.into_body().into_data_stream();
        let part = app.store.stage(body, length).await.map_err(|unstaged| match unstaged {
            StageError::Broken(error) => incomplete_body(&error),
            StageError::TooLong => {
                let detail =
                    format!("the body is longer than bytes − offset, {length} bytes: nothing is stored");
                ApiError::new(ProblemKind::WrongResult, detail)
            }
            StageError::Store(error) => error.into(),
        })?;
        let added = uploads.add(&key, self.offset, part, self.bytes);
        for part in added.unused {
            app.store.discard(part).await;
        }
        let Some(parts) = added.complete else { return Ok(Received::Some(added.received)) };
        let whole = app.store.join(parts).await?;
        if whole.digest != key.digest {
            let detail =
                format!("the bytes have the digest {}, not {}: upload them again", whole.digest, key.digest);
            app.store.discard(whole).await;
            return Err(ApiError::new(ProblemKind::WrongResult, detail));
        }
        Ok(Received::All(whole))
    }
}

/// Reads a body that is not needed, since a client reads the answer after it has sent the body.
pub(super) async fn read_to_end(request: Request, mut rest: u64) {
    let mut body = request.into_body().into_data_stream();
    while let Some(Ok(chunk)) = body.next().await
        && let Some(less) = rest.checked_sub(chunk.len() as u64)
    {
        rest = less;
    }
}
