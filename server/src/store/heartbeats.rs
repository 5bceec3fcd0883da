//! Heartbeats: one a worker, a row an attempt.

use roost_api::ids::{JobId, WorkerId};
use roost_api::lease::{AttemptDirective, Directive, HeartbeatReply};
use roost_api::time::Timestamp;
use sqlx::SqliteConnection;

use super::facts::fenced;
use super::{Store, StoreError};
use crate::queue::{BeatEffect, Refusal, on_beat};

/// A sign of life of one attempt.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beat {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt.
    pub attempt: u32,
}

impl Store {
    /// Renews the leases of a worker's attempts until `until`; the rows of the reply are in the order of the beats.
    pub(crate) async fn heartbeat(
        &self,
        worker: WorkerId,
        beats: Vec<Beat>,
        now: Timestamp,
        until: Timestamp,
    ) -> Result<Result<HeartbeatReply, Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let drain: Option<bool> = sqlx::query_scalar(
                        "UPDATE workers SET last_seen_at = ? WHERE id = ? RETURNING draining",
                    )
                    .bind(now.0)
                    .bind(worker.to_string())
                    .fetch_optional(&mut *tx)
                    .await?;
                    let Some(drain) = drain else { return Ok(Err(Refusal::NoWorker)) };
                    let mut attempts = Vec::with_capacity(beats.len());
                    for beat in beats {
                        attempts.push(renew(tx, worker, beat, until).await?);
                    }
                    Ok(Ok(HeartbeatReply { attempts, drain }))
                })
            })
            .await
    }
}

async fn renew(
    tx: &mut SqliteConnection,
    worker: WorkerId,
    beat: Beat,
    until: Timestamp,
) -> Result<AttemptDirective, StoreError> {
    let Beat { job_id, attempt } = beat;
    let effect = match fenced(tx, job_id, attempt, worker).await? {
        Ok(fenced) => on_beat(&fenced.job, fenced.standing, until),
        Err(_) => BeatEffect::Abandon,
    };
    let (directive, lease_expires_at) = match effect {
        BeatEffect::Renew { until, cancel: false } => (Directive::Continue, Some(until)),
        BeatEffect::Renew { cancel: true, .. } => (Directive::Cancel, None),
        BeatEffect::Abandon => (Directive::Abandon, None),
    };
    if let BeatEffect::Renew { until, .. } = effect {
        // What was back in the queue, with a pause or to run alone, was never lost.
        sqlx::query(
            "UPDATE jobs SET alone = CASE state WHEN 'queued' THEN 0 ELSE alone END,
                             state = 'running', not_before = NULL, worker_id = ?, lease_expires_at = ?
             WHERE id = ?",
        )
        .bind(worker.to_string())
        .bind(until.0)
        .bind(job_id.to_string())
        .execute(&mut *tx)
        .await?;
        // An attempt that counted as lost is found again.
        sqlx::query(
            "UPDATE attempts SET outcome = NULL, message = NULL, ended_at = NULL
             WHERE job_id = ? AND number = ? AND outcome IS NOT NULL",
        )
        .bind(job_id.to_string())
        .bind(attempt)
        .execute(&mut *tx)
        .await?;
    }
    Ok(AttemptDirective { job_id, attempt, directive, lease_expires_at })
}
