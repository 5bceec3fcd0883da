//! What happened to jobs, in order.

use roost_api::event::JobEvent;
use roost_api::time::Timestamp;

use super::columns::Columns;
use super::versions::Subject;
use super::{Store, StoreError};

/// Events of one look.
const BATCH: i64 = 500;

impl Store {
    /// What happened to a job or a sweep after an event, oldest first; at most some hundred at a time.
    pub(crate) async fn events(
        &self,
        subject: Subject,
        after: i64,
    ) -> Result<Vec<(i64, JobEvent)>, StoreError> {
        let (sql, id) = match subject {
            Subject::Job(id) => (OF_JOB, id.to_string()),
            Subject::Sweep(id) => (OF_SWEEP, id.to_string()),
            _ => return Ok(Vec::new()),
        };
        let rows = sqlx::query(sql).bind(id).bind(after).bind(BATCH).fetch_all(&self.readers).await?;
        let event = |row| {
            let row: &sqlx::sqlite::SqliteRow = row;
            let event = JobEvent {
                job_id: row.parsed("job_id")?,
                state: row.parsed("state")?,
                attempt: row.number("attempt")?,
                cancelling: row.column("cancelling")?,
                failure_class: row.parsed_opt("failure_class")?,
                at: row.moment("at")?,
            };
            Ok((row.column("seq")?, event))
        };
        rows.iter().map(event).collect()
    }

    /// The numbers of the oldest event that is kept and of the newest; nothing older than the first can be resumed from.
    pub(crate) async fn event_range(&self) -> Result<(i64, i64), StoreError> {
        // The number that was given last, whether or not that event is still there.
        let sql = "SELECT coalesce((SELECT min(seq) FROM events), last.seq + 1, 0), coalesce(last.seq, 0)
                   FROM (SELECT max(seq) AS seq FROM sqlite_sequence WHERE name = 'events') last";
        Ok(sqlx::query_as(sql).fetch_one(&self.readers).await?)
    }

    /// Forgets events and answered submissions from before then.
    pub(crate) async fn forget_before(&self, then: Timestamp) -> Result<(), StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    // In the order of their numbers, which is that of time: no index of moments is needed.
                    let sql = "DELETE FROM events WHERE seq < (SELECT min(seq) FROM events WHERE at >= ?1)
                                 OR (SELECT max(at) FROM events) < ?1";
                    sqlx::query(sql).bind(then.0).execute(&mut *tx).await?;
                    sqlx::query("DELETE FROM submissions WHERE created_at < ?")
                        .bind(then.0)
                        .execute(&mut *tx)
                        .await?;
                    Ok(())
                })
            })
            .await
    }
}

const OF_JOB: &str = "SELECT * FROM events WHERE job_id = ? AND seq > ? ORDER BY seq LIMIT ?";
const OF_SWEEP: &str = "SELECT * FROM events WHERE sweep_id = ? AND seq > ? ORDER BY seq LIMIT ?";
