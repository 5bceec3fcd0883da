//! Events of jobs, in order.

use roost_api::event::JobEvent;
use roost_api::time::Timestamp;

use super::columns::Columns;
use super::database::{Row, query, query_as};
use super::versions::{Subject, last_event};
use super::{Store, StoreError};

/// Maximum number of events of one query.
pub(crate) const EVENTS_AT_ONCE: usize = 500;

impl Store {
    /// The events of a job or a sweep after an event, oldest first, one batch at a time.
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
        let rows =
            query(sql).bind(id).bind(after).bind(EVENTS_AT_ONCE as i64).fetch_all(&self.readers).await?;
        let event = |row| {
            let row: &Row = row;
            let event = JobEvent {
                job_id: row.parsed("job_id")?,
                state: row.parsed("state")?,
                attempt: row.number("attempt")?,
                cancelling: row.column("cancelling")?,
                paused: row.column("paused")?,
                failure_class: row.parsed_opt("failure_class")?,
                at: row.moment("at")?,
            };
            Ok((row.column("seq")?, event))
        };
        rows.iter().map(event).collect()
    }

    /// The numbers of the oldest stored event and of the newest one ever. Streams resume from the oldest at the earliest.
    pub(crate) async fn event_range(&self) -> Result<(i64, i64), StoreError> {
        // The newest event may be deleted.
        let sql = concat!(
            "SELECT coalesce((SELECT min(seq) FROM events), last.seq + 1, 0), coalesce(last.seq, 0) FROM (SELECT ",
            last_event!(),
            " AS seq) AS last"
        );
        Ok(query_as(sql).fetch_one(&self.readers).await?)
    }

    /// Deletes events and idempotency keys older than `before`.
    pub(crate) async fn forget_before(&self, before: Timestamp) -> Result<(), StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    // Numbers have the order of time, so that no index on `at` is needed.
                    let sql = "DELETE FROM events WHERE seq < (SELECT min(seq) FROM events WHERE at >= ?1)
                                 OR (SELECT max(at) FROM events) < ?1";
                    query(sql).bind(before.0).execute(&mut *tx).await?;
                    query("DELETE FROM submissions WHERE created_at < ?")
                        .bind(before.0)
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
