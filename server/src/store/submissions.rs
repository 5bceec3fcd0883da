//! Submissions with an idempotency key.

use roost_api::time::Timestamp;
use uuid::Uuid;

use super::columns::Columns;
use super::database::query;
use super::{Store, StoreError};

/// A request with an idempotency key.
#[derive(Clone, Debug)]
pub(crate) struct IdempotentRequest {
    /// Identifier of the token; empty without one.
    pub token_id: String,
    /// The key that the client chose.
    pub key: String,
    /// Hash of method, path and body.
    pub fingerprint: String,
}

/// The stored response to a submission.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct StoredResponse {
    pub status: u16,
    pub location: Option<String>,
    pub body: String,
}

/// The state of a submission.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum SubmissionState {
    /// Not answered yet. Its job or sweep has this identifier.
    Reserved(Uuid),
    /// Answered.
    Answered(StoredResponse),
    /// The key was used for another request.
    Other,
}

impl Store {
    /// Looks up a submission, or stores a new one.
    pub(crate) async fn submission(
        &self,
        submission: IdempotentRequest,
        now: Timestamp,
    ) -> Result<SubmissionState, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let sql = "INSERT INTO submissions (token_id, key, fingerprint, resource_id, created_at)
                               VALUES (?, ?, ?, ?, ?)
                               ON CONFLICT (token_id, key) DO UPDATE SET key = excluded.key
                               RETURNING fingerprint, resource_id, status, location, body";
                    let row = query(sql)
                        .bind(submission.token_id)
                        .bind(submission.key)
                        .bind(&submission.fingerprint)
                        .bind(Uuid::now_v7().to_string())
                        .bind(now.0)
                        .fetch_one(&mut *tx)
                        .await?;
                    if row.column::<String>("fingerprint")? != submission.fingerprint {
                        return Ok(SubmissionState::Other);
                    }
                    Ok(match row.number_opt("status")? {
                        None => SubmissionState::Reserved(row.parsed("resource_id")?),
                        Some(status) => SubmissionState::Answered(StoredResponse {
                            status,
                            location: row.column("location")?,
                            body: row.column("body")?,
                        }),
                    })
                })
            })
            .await
    }

    /// Stores the response to a submission.
    pub(crate) async fn answer_submission(
        &self,
        submission: IdempotentRequest,
        answered: StoredResponse,
    ) -> Result<(), StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let sql = "UPDATE submissions SET status = ?, location = ?, body = ?
                               WHERE token_id = ? AND key = ? AND fingerprint = ? AND status IS NULL";
                    query(sql)
                        .bind(answered.status)
                        .bind(answered.location)
                        .bind(answered.body)
                        .bind(submission.token_id)
                        .bind(submission.key)
                        .bind(submission.fingerprint)
                        .execute(&mut *tx)
                        .await?;
                    Ok(())
                })
            })
            .await
    }

    /// Deletes a refused submission, so that its key may be used again.
    pub(crate) async fn drop_submission(&self, submission: IdempotentRequest) -> Result<(), StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let sql = "DELETE FROM submissions WHERE token_id = ? AND key = ? AND status IS NULL";
                    query(sql).bind(submission.token_id).bind(submission.key).execute(&mut *tx).await?;
                    Ok(())
                })
            })
            .await
    }
}
