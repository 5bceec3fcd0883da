//! Checkpoints of attempts.

use reqwest::header::CONTENT_TYPE;
use reqwest::{Method, RequestBuilder};
use roost_api::checkpoint::{CheckpointReceipt, MEDIA_TYPE};
use roost_api::ids::{JobId, WorkerId};

use super::{Client, ClientError, ClientResult, FILE_TIMEOUT};

/// A checkpoint for an upload.
#[derive(Clone, Debug)]
pub struct EncodedCheckpoint {
    /// Simulated time since the beginning of the run, in seconds.
    pub simulated_s: f64,
    /// BLAKE3 hash of its bytes, in hexadecimal.
    pub digest: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

impl EncodedCheckpoint {
    /// A checkpoint at a simulated time.
    pub fn new(simulated_s: f64, bytes: Vec<u8>) -> Self {
        Self { simulated_s, digest: digest(&bytes), bytes }
    }

    /// At most `max_bytes` from `offset` on.
    pub(super) fn part(&self, offset: u64, max_bytes: usize) -> Vec<u8> {
        let from = usize::try_from(offset).unwrap_or(usize::MAX).min(self.bytes.len());
        self.bytes[from..self.bytes.len().min(from.saturating_add(max_bytes))].to_vec()
    }
}

/// BLAKE3 hash in hexadecimal.
pub(crate) fn digest(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

impl Client {
    /// Uploads at most `max_bytes` of a checkpoint from `offset` on; repeating it is safe.
    pub async fn upload_checkpoint(
        &self,
        (job, attempt): (JobId, u32),
        worker: WorkerId,
        checkpoint: &EncodedCheckpoint,
        (offset, max_bytes): (u64, usize),
    ) -> ClientResult<CheckpointReceipt> {
        let EncodedCheckpoint { simulated_s, digest, bytes } = checkpoint;
        let part = checkpoint.part(offset, max_bytes);
        let request = self.request(Method::PUT, &route(job, attempt)).query(&[
            ("worker_id", worker.to_string()),
            ("simulated_s", simulated_s.to_string()),
            ("bytes", bytes.len().to_string()),
            ("digest", digest.clone()),
            ("offset", offset.to_string()),
        ]);
        self.fetch(request.header(CONTENT_TYPE, MEDIA_TYPE).body(part).timeout(FILE_TIMEOUT)).await
    }

    /// The checkpoint that an attempt recorded; the caller checks its digest.
    pub async fn download_checkpoint(&self, job: JobId, attempt: u32) -> ClientResult<Vec<u8>> {
        self.bytes(self.request(Method::GET, &route(job, attempt))).await
    }

    /// The bytes of a long answer.
    pub(super) async fn bytes(&self, request: RequestBuilder) -> ClientResult<Vec<u8>> {
        let response = self.send(request.timeout(FILE_TIMEOUT)).await?;
        let bytes = response.bytes().await.map_err(|error| ClientError::transport(self.server(), &error))?;
        Ok(bytes.into())
    }

    /// Deletes the checkpoint of earlier attempts, which this attempt cannot use; repeating it is safe.
    pub async fn discard_checkpoint(&self, job: JobId, attempt: u32, worker: WorkerId) -> ClientResult<()> {
        let request = self.request(Method::DELETE, &route(job, attempt));
        self.send(request.query(&[("worker_id", worker.to_string())])).await.map(drop)
    }
}

fn route(job: JobId, attempt: u32) -> String {
    format!("jobs/{job}/attempts/{attempt}/checkpoint")
}
