//! Expiry of leases, deadlines and pauses, and new leases after a restart or an outage of PostgreSQL.

use std::collections::HashSet;
use std::time::Instant;

use roost_api::ids::JobId;
use roost_api::job::AttemptOutcome;
use roost_api::time::Timestamp;

use super::columns::{Columns, to_json};
use super::database::{AssertSqlSafe, Connection, Engine, Row, query, query_scalar};
use super::transitions::{
    AttemptEnd, CHARGED_COLUMNS, JOB_COLUMNS, charged_attempt, end_attempts, job_snapshot,
};
use super::writer::STALL;
use super::{Store, StoreError};
use crate::clock::Now;
use crate::queue::{JobChange, RetryPolicy, on_deadline, on_lease_expired};

/// The attempts and pauses that expired.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Expired {
    /// Ended attempts, with the change of their jobs.
    pub changes: Vec<(JobId, JobChange)>,
    /// The first `lost` of them lost their lease; the others passed their deadline.
    pub lost: usize,
    /// Jobs whose pause is over.
    pub resumed: u64,
}

/// The first end of a lease or deadline.
pub(super) const FIRST_END: &str = "
    SELECT min(CASE WHEN deadline < lease_expires_at THEN deadline ELSE lease_expires_at END) FROM jobs WHERE state = 'running'";

/// The first end of a pause. Without knowledge of the table, PostgreSQL would look at all jobs for those before a time.
pub(super) const FIRST_PAUSE_END: &str = "SELECT min(not_before) FROM jobs WHERE not_before IS NOT NULL";

impl Store {
    /// The first end of a lease or deadline, on the clock of leases. Uses a reader, and looks at all running jobs.
    pub(crate) async fn first_end(&self) -> Result<Option<Timestamp>, StoreError> {
        let first: Option<i64> = query_scalar(FIRST_END).fetch_one(&self.readers).await?;
        Ok(first.map(Timestamp))
    }

    /// Whether a pause before a retry is over. Uses a reader.
    pub(crate) async fn has_ended_pause(&self, now: Now) -> Result<bool, StoreError> {
        let first: Option<i64> = query_scalar(FIRST_PAUSE_END).fetch_one(&self.readers).await?;
        Ok(first.is_some_and(|end| end <= now.lease.0))
    }

    /// Ends expired leases and pauses, and attempts past their deadline. After an outage nothing ends until leases are renewed, since no
    /// heartbeat could be stored.
    pub(crate) async fn expire(&self, policy: RetryPolicy, now: Now) -> Result<Expired, StoreError> {
        let (outages, asked) = (self.writer.outages(), Instant::now());
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    // The heartbeats waited too.
                    if tx.engine() == Engine::Postgres && asked.elapsed() > STALL {
                        outages.note();
                    }
                    if outages.unmended().is_some() {
                        return Ok(Expired::default());
                    }
                    let mut changes = expire_leases(tx, policy, now).await?;
                    let lost = changes.len();
                    changes.extend(end_overdue(tx, now).await?);
                    let resumed = query("UPDATE jobs SET not_before = NULL WHERE not_before <= ?")
                        .bind(now.lease.0)
                        .execute(&mut *tx)
                        .await?;
                    Ok(Expired { changes, lost, resumed: resumed.rows_affected() })
                })
            })
            .await
    }

    /// After an outage of PostgreSQL, renews the lease of every running attempt until `until`, and delays earlier deadlines to then.
    /// Returns the number of running attempts.
    pub(crate) async fn renew_after_outage(&self, until: Timestamp) -> Result<Option<u64>, StoreError> {
        let outages = self.writer.outages();
        let Some(noted) = outages.unmended() else { return Ok(None) };
        let renewed = self.writer.write(move |tx| {
            Box::pin(async move {
                let sql = "UPDATE jobs SET lease_expires_at = ?1, deadline = CASE WHEN deadline < ?1 THEN ?1 ELSE deadline END
                           WHERE state = 'running'";
                Ok(query(sql).bind(until.0).execute(tx).await?.rows_affected())
            })
        });
        let renewed = renewed.await?;
        outages.mend(noted);
        Ok(Some(renewed))
    }

    /// The running jobs of a list.
    pub(crate) async fn running_of(&self, jobs: &[JobId]) -> Result<HashSet<JobId>, StoreError> {
        let ids: Vec<_> = jobs.iter().map(ToString::to_string).collect();
        let rows =
            query("SELECT id FROM jobs WHERE id IN (SELECT atom FROM json_each(?)) AND state = 'running'")
                .bind(to_json("ids", &ids)?)
                .fetch_all(&self.readers)
                .await?;
        rows.iter().map(|row| row.parsed("id")).collect()
    }

    /// Renews the lease of every running attempt, so that a restart of the server ends none, and ends all pauses, since the clock of
    /// leases restarts. Returns the number of running attempts.
    pub(crate) async fn renew_all_leases(&self, until: Timestamp) -> Result<u64, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    query("UPDATE jobs SET not_before = NULL WHERE not_before IS NOT NULL")
                        .execute(&mut *tx)
                        .await?;
                    let extended = query(
                        "UPDATE jobs SET lease_expires_at = ?1,
                                         deadline = ?1 + CAST(max_wall_s * 1000 AS BIGINT) WHERE state = 'running'",
                    )
                    .bind(until.0)
                    .execute(&mut *tx)
                    .await?;
                    Ok(extended.rows_affected())
                })
            })
            .await
    }
}

/// The present attempt of a job, and its worker.
const ITS_ATTEMPT: &str = "LEFT JOIN attempts a ON a.job_id = j.id AND a.number = j.attempt LEFT JOIN workers w ON w.id = a.worker_id";

/// Ends expired leases. A job had others beside it if its worker lost another job or runs one now.
async fn expire_leases(
    tx: &mut Connection,
    policy: RetryPolicy,
    now: Now,
) -> Result<Vec<(JobId, JobChange)>, StoreError> {
    let sql = format!(
        "SELECT j.lease_expires_at, {JOB_COLUMNS}, {CHARGED_COLUMNS},
                EXISTS (SELECT 1 FROM attempts c WHERE c.worker_id = j.worker_id AND c.job_id <> j.id
                        AND c.outcome IS NULL)
             OR EXISTS (SELECT 1 FROM attempts c WHERE c.worker_id = j.worker_id AND c.job_id <> j.id
                        AND c.outcome = 'lost') AS had_others
         FROM jobs j {ITS_ATTEMPT} WHERE j.state = 'running' AND j.lease_expires_at <= ?"
    );
    let rows = query(AssertSqlSafe(sql)).bind(now.lease.0).fetch_all(&mut *tx).await?;
    let message = "the lease expired without a heartbeat";
    let decide = |row: &Row| {
        let (job, expiry) = (job_snapshot(row)?, row.moment("lease_expires_at")?);
        Ok(on_lease_expired(&job, expiry, row.column("had_others")?, policy, now.lease))
    };
    end_all(tx, &rows, decide, AttemptOutcome::Lost, message, now).await
}

/// Ends attempts past their deadline.
async fn end_overdue(tx: &mut Connection, now: Now) -> Result<Vec<(JobId, JobChange)>, StoreError> {
    let sql = format!(
        "SELECT j.deadline, {JOB_COLUMNS}, {CHARGED_COLUMNS}
         FROM jobs j {ITS_ATTEMPT} WHERE j.state = 'running' AND j.deadline <= ?"
    );
    let rows = query(AssertSqlSafe(sql)).bind(now.lease.0).fetch_all(&mut *tx).await?;
    let message = "the attempt ran past max_wall_s and its worker did not stop it";
    let decide = |row: &Row| Ok(on_deadline(&job_snapshot(row)?, row.moment("deadline")?, now.lease));
    end_all(tx, &rows, decide, AttemptOutcome::Timeout, message, now).await
}

async fn end_all(
    tx: &mut Connection,
    rows: &[Row],
    decide: impl Fn(&Row) -> Result<Option<JobChange>, StoreError>,
    outcome: AttemptOutcome,
    message: &str,
    now: Now,
) -> Result<Vec<(JobId, JobChange)>, StoreError> {
    let mut decided = Vec::new();
    for row in rows {
        if let Some(change) = decide(row)? {
            decided.push((job_snapshot(row)?, charged_attempt(row)?, change));
        }
    }
    let mut endings = Vec::new();
    for (job, charged, change) in &decided {
        let (job, attempt, charged, message, at) = (job.id, job.attempt, *charged, Some(message), now.wall);
        let (partial, filled_by, stated) = (None, None, None);
        endings.push(AttemptEnd {
            job,
            attempt,
            outcome,
            change,
            message,
            partial,
            filled_by,
            stated,
            charged,
            at,
        });
    }
    end_attempts(tx, &endings).await?;
    Ok(decided.into_iter().map(|(job, _, change)| (job.id, change)).collect())
}
