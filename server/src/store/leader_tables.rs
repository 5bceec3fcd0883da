//! Temporary tables of the session that writes to PostgreSQL, for claims.
//!
//! A transaction that stays open, such as that of a backup, keeps every version of each row since its begin. A queue is taken from its
//! front, and the index `jobs_to_claim` then has more and more entries of jobs that were claimed, before the first one that waits. Old
//! versions of a temporary table are kept by its own session alone. `queue_heads` has for each queue a place at or before its first job
//! that claims look at, and `running_jobs` has the running jobs. Triggers keep both up to date, within the same transaction.
//!
//! Rows that each claim changes have the same trouble: an equality finds their versions from the oldest on. The newest version has the
//! last entry of its key in an index, unless it took the free space of deleted rows. A range of one key, searched from its end, then finds
//! it at once.

use super::database::{Connection, Engine, query, raw_sql};
use super::eligible_jobs::{claimable, heads};
use super::{Store, StoreError};

/// Makes the tables. The next [`fill`] fills them.
const CREATE: &str = "
    CREATE TEMPORARY TABLE IF NOT EXISTS queue_heads (
        priority       BIGINT NOT NULL,
        owner          BIGINT NOT NULL,
        queue          BIGINT NOT NULL,
        queue_position BIGINT NOT NULL,
        seq            BIGINT NOT NULL
    ) WITH (fillfactor = 50);
    CREATE UNIQUE INDEX IF NOT EXISTS queue_heads_in_order ON queue_heads (priority DESC, owner, queue);
    CREATE TEMPORARY TABLE IF NOT EXISTS running_jobs (
        seq       BIGINT NOT NULL PRIMARY KEY,
        worker_id TEXT,
        alone     BIGINT NOT NULL
    );
    CREATE INDEX IF NOT EXISTS running_jobs_by_worker ON running_jobs (worker_id)";

/// The rows of the tables, from `jobs`.
const FILL: &str = concat!(
    "
    TRUNCATE queue_heads, running_jobs;",
    heads!(),
    "
    INSERT INTO queue_heads (priority, owner, queue, queue_position, seq)
    SELECT heads.priority, heads.owner, heads.queue, first.queue_position, first.seq
    FROM heads CROSS JOIN LATERAL (
        SELECT j.queue_position, j.seq FROM jobs j WHERE ",
    claimable!("j"),
    " AND j.priority = heads.priority AND j.owner = heads.owner AND j.queue = heads.queue
        ORDER BY j.queue_position, j.seq LIMIT 1) AS first;
    INSERT INTO running_jobs (seq, worker_id, alone) SELECT seq, worker_id, alone FROM jobs WHERE state = 'running'"
);

/// Moves each place to the first job that claims look at, and removes queues without one.
const ADVANCE: &str = concat!(
    "
    WITH found AS (
        SELECT head.priority, head.owner, head.queue, head.seq AS known, first.queue_position, first.seq
        FROM queue_heads head LEFT JOIN LATERAL (
            SELECT j.queue_position, j.seq FROM jobs j WHERE ",
    claimable!("j"),
    " AND j.priority = head.priority AND j.owner = head.owner AND j.queue = head.queue
                AND (j.queue_position, j.seq) >= (head.queue_position, head.seq)
            ORDER BY j.queue_position, j.seq LIMIT 1) AS first ON true),
    gone AS (
        DELETE FROM queue_heads USING found WHERE found.seq IS NULL AND queue_heads.priority = found.priority
            AND queue_heads.owner = found.owner AND queue_heads.queue = found.queue)
    UPDATE queue_heads SET queue_position = found.queue_position, seq = found.seq FROM found
    WHERE found.seq <> found.known AND queue_heads.priority = found.priority AND queue_heads.owner = found.owner
        AND queue_heads.queue = found.queue"
);

/// Number of jobs before the place of their queue or without one, and of rows of `running_jobs` that are missing or wrong.
#[cfg(test)]
pub(super) const WRONG: &str = concat!(
    "
    SELECT (SELECT count(*) FROM jobs j WHERE ",
    claimable!("j"),
    " AND NOT EXISTS (SELECT 1 FROM queue_heads head WHERE head.priority = j.priority AND head.owner = j.owner AND head.queue = j.queue
                              AND (head.queue_position, head.seq) <= (j.queue_position, j.seq)))
        + (SELECT count(*) FROM ((SELECT seq, worker_id, alone FROM running_jobs EXCEPT
                                  SELECT seq, worker_id, alone FROM jobs WHERE state = 'running') UNION ALL
                                 (SELECT seq, worker_id, alone FROM jobs WHERE state = 'running' EXCEPT
                                  SELECT seq, worker_id, alone FROM running_jobs)) AS differing)"
);

/// Makes and fills the tables of a session that begins to write.
pub(super) async fn prepare(connection: &mut Connection) -> Result<(), StoreError> {
    if connection.engine() == Engine::Sqlite {
        return Ok(());
    }
    raw_sql(CREATE).execute(&mut *connection).await?;
    fill(connection).await
}

/// Fills the tables again.
async fn fill(connection: &mut Connection) -> Result<(), StoreError> {
    query(FILL).execute(connection).await?;
    Ok(())
}

/// Brings the places of `queue_heads` up to date.
pub(super) async fn advance(tx: &mut Connection) -> Result<(), StoreError> {
    if tx.engine() == Engine::Postgres {
        query(ADVANCE).execute(tx).await?;
    }
    Ok(())
}

impl Store {
    /// Fills the temporary tables again. They then show also what an operator changed by hand, and give back the space of deleted rows.
    pub(crate) async fn refill_leader_tables(&self) -> Result<(), StoreError> {
        if self.readers.engine() == Engine::Sqlite {
            return Ok(());
        }
        self.writer.write(|tx| Box::pin(fill(tx))).await
    }
}
