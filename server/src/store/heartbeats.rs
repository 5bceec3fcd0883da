//! Heartbeats: one a worker, a row an attempt.

use roost_api::ids::{JobId, WorkerId};
use roost_api::lease::{AttemptDirective, Directive};
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
    /// Renews the leases of a worker's attempts until `until`; the directives are in the order of the beats.
    pub(crate) async fn heartbeat(
        &self,
        worker: WorkerId,
        beats: Vec<Beat>,
        now: Timestamp,
        until: Timestamp,
    ) -> Result<Result<Vec<AttemptDirective>, Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let known = sqlx::query("UPDATE workers SET last_seen_at = ? WHERE id = ?")
                        .bind(now.0)
                        .bind(worker.to_string())
                        .execute(&mut *tx)
                        .await?;
                    if known.rows_affected() == 0 {
                        return Ok(Err(Refusal::NoWorker));
                    }
                    let mut directives = Vec::with_capacity(beats.len());
                    for beat in beats {
                        directives.push(renew(tx, worker, beat, until).await?);
                    }
                    Ok(Ok(directives))
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
        sqlx::query(
            "UPDATE jobs SET state = 'running', worker_id = ?, lease_expires_at = ?
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
