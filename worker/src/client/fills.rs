//! Fills that jobs share.

use reqwest::Method;
use reqwest::header::CONTENT_TYPE;
use roost_api::checkpoint::{CheckpointReceipt, MEDIA_TYPE};
use roost_api::ids::{JobId, WorkerId};

use super::{Client, ClientResult, EncodedCheckpoint, FILE_TIMEOUT};

impl Client {
    /// Uploads at most `max_bytes` of a fill from `offset` on; repeating it is safe.
    pub async fn upload_fill(
        &self,
        (job, attempt): (JobId, u32),
        worker: WorkerId,
        fill: &EncodedCheckpoint,
        (offset, max_bytes): (u64, usize),
    ) -> ClientResult<CheckpointReceipt> {
        let request = self.request(Method::PUT, &route(job, attempt)).query(&[
            ("worker_id", worker.to_string()),
            ("bytes", fill.bytes.len().to_string()),
            ("digest", fill.digest.clone()),
            ("offset", offset.to_string()),
        ]);
        let part = fill.part(offset, max_bytes);
        self.fetch(request.header(CONTENT_TYPE, MEDIA_TYPE).body(part).timeout(FILE_TIMEOUT)).await
    }

    /// The stored fill of an attempt; the caller checks its digest.
    pub async fn download_fill(&self, job: JobId, attempt: u32) -> ClientResult<Vec<u8>> {
        self.bytes(self.request(Method::GET, &route(job, attempt))).await
    }

    /// Withdraws the fill that an attempt computes, or the stored one of a digest, which it cannot use; repeating it is safe.
    pub async fn withdraw_fill(
        &self,
        (job, attempt): (JobId, u32),
        worker: WorkerId,
        digest: Option<&str>,
    ) -> ClientResult<()> {
        let request = self.request(Method::DELETE, &route(job, attempt));
        let worker = worker.to_string();
        let digest = digest.map(|digest| ("digest", digest));
        let query: Vec<_> = [("worker_id", worker.as_str())].into_iter().chain(digest).collect();
        self.send(request.query(&query)).await.map(drop)
    }
}

fn route(job: JobId, attempt: u32) -> String {
    format!("jobs/{job}/attempts/{attempt}/fill")
}
