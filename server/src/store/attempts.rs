//! Leases from the server's side: expiry, and the extension after a restart.

use std::collections::HashSet;

use roost_api::ids::JobId;
use roost_api::job::AttemptOutcome;
use roost_api::time::Timestamp;
use sqlx::AssertSqlSafe;

use super::facts::{JOB_FACTS, change_job, end_attempt, job_facts};
use super::rows::{Columns, to_json};
use super::{Store, StoreError};
use crate::queue::{AttemptLimits, JobChange, on_lease_expired};

impl Store {
    /// Ends every lease that has run out at `lease_now`; `now` is what people read. Returns the jobs, with what became of each.
    pub(crate) async fn expire_leases(
        &self,
        limits: AttemptLimits,
        lease_now: Timestamp,
        now: Timestamp,
    ) -> Result<Vec<(JobId, JobChange)>, StoreError> {
        // Most of the time there is none, and the writer need not hear of it.
        let any: bool = sqlx::query_scalar(
            "SELECT EXISTS (SELECT 1 FROM jobs WHERE state = 'running' AND lease_expires_at <= ?)",
        )
        .bind(lease_now.0)
        .fetch_one(&self.readers)
        .await?;
        if !any {
            return Ok(Vec::new());
        }
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let sql = format!(
                        "SELECT j.id, j.lease_expires_at, {JOB_FACTS} FROM jobs j
                         WHERE j.state = 'running' AND j.lease_expires_at <= ?"
                    );
                    let rows = sqlx::query(AssertSqlSafe(sql)).bind(lease_now.0).fetch_all(&mut *tx).await?;
                    let mut changes = Vec::new();
                    for row in rows {
                        let (id, job) = (row.parsed("id")?, job_facts(&row)?);
                        let expiry = row.moment("lease_expires_at")?;
                        let Some(change) = on_lease_expired(&job, expiry, limits, lease_now) else {
                            continue;
                        };
                        let message = "the lease expired: nothing was heard of the worker";
                        let lost = AttemptOutcome::Lost;
                        end_attempt(tx, id, job.attempt, lost, Some(message), None, now).await?;
                        change_job(tx, id, &change, Some(message), now).await?;
                        changes.push((id, change));
                    }
                    Ok(changes)
                })
            })
            .await
    }

    /// Which of these jobs run.
    pub(crate) async fn running_of(&self, jobs: &[JobId]) -> Result<HashSet<JobId>, StoreError> {
        let ids: Vec<_> = jobs.iter().map(ToString::to_string).collect();
        let rows = sqlx::query(
            "SELECT id FROM jobs WHERE id IN (SELECT value FROM json_each(?)) AND state = 'running'",
        )
        .bind(to_json("ids", &ids)?)
        .fetch_all(&self.readers)
        .await?;
        rows.iter().map(|row| row.parsed("id")).collect()
    }

    /// Gives every running attempt a fresh lease, so that a restart of the server costs no run. Returns how
    /// many there are.
    pub(crate) async fn extend_leases(&self, until: Timestamp) -> Result<u64, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let extended =
                        sqlx::query("UPDATE jobs SET lease_expires_at = ? WHERE state = 'running'")
                            .bind(until.0)
                            .execute(&mut *tx)
                            .await?;
                    Ok(extended.rows_affected())
                })
            })
            .await
    }
}
