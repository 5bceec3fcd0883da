//! Result documents.

use roost_api::ids::JobId;
use roost_api::job::JobState;

use super::columns::Columns;
use super::database::query;
use super::{Store, StoreError};

/// The result of a job.
pub(crate) struct StoredResult {
    /// State of the job.
    pub state: JobState,
    /// Its result, or the partial result of its newest attempt, as JSON text.
    pub document: Option<String>,
}

impl Store {
    /// The result of a job; of one that failed or was cancelled, the partial result of its newest attempt.
    pub(crate) async fn result(&self, id: JobId) -> Result<Option<StoredResult>, StoreError> {
        let row = query(
            "SELECT j.state, d.body FROM jobs j
             LEFT JOIN results r ON r.job_id = j.id
             LEFT JOIN attempts a ON a.job_id = j.id AND a.number = j.attempt
                                  AND j.state IN ('failed', 'cancelled')
             LEFT JOIN documents d ON d.digest = coalesce(r.document_digest, a.partial_digest)
             WHERE j.id = ?",
        )
        .bind(id.to_string())
        .fetch_optional(&self.readers)
        .await?;
        let Some(row) = row else { return Ok(None) };
        Ok(Some(StoredResult { state: row.parsed("state")?, document: row.column("body")? }))
    }
}
