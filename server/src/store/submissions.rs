//! Submissions under an idempotency key.

use roost_api::time::Timestamp;
use uuid::Uuid;

use super::columns::Columns;
use super::{Store, StoreError};

/// Who submits what under which key.
#[derive(Clone, Debug)]
pub(crate) struct Submission {
    /// The token, or nothing.
    pub owner: String,
    /// As the client chose it.
    pub key: String,
    /// Hash of all that makes the request.
    pub fingerprint: String,
}

/// The answer that was given before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct StoredResponse {
    pub status: u16,
    pub location: Option<String>,
    pub body: String,
}

/// What is known of a submission.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum SubmissionState {
    /// Not answered yet: what it makes has this identifier.
    Reserved(Uuid),
    /// Answered.
    Answered(StoredResponse),
    /// The key was used for something else.
    Other,
}

impl Store {
    /// Looks a submission up, or notes it.
    pub(crate) async fn submission(
        &self,
        submission: Submission,
        now: Timestamp,
    ) -> Result<SubmissionState, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let sql = "INSERT INTO submissions (token_id, key, fingerprint, resource_id, created_at)
                               VALUES (?, ?, ?, ?, ?)
                               ON CONFLICT (token_id, key) DO UPDATE SET key = excluded.key
                               RETURNING fingerprint, resource_id, status, location, body";
                    let row = sqlx::query(sql)
                        .bind(submission.owner)
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

    /// Keeps the answer to a submission.
    pub(crate) async fn answer_submission(
        &self,
        submission: Submission,
        answered: StoredResponse,
    ) -> Result<(), StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let sql = "UPDATE submissions SET status = ?, location = ?, body = ?
                               WHERE token_id = ? AND key = ? AND fingerprint = ? AND status IS NULL";
                    sqlx::query(sql)
                        .bind(answered.status)
                        .bind(answered.location)
                        .bind(answered.body)
                        .bind(submission.owner)
                        .bind(submission.key)
                        .bind(submission.fingerprint)
                        .execute(&mut *tx)
                        .await?;
                    Ok(())
                })
            })
            .await
    }

    /// Forgets a submission that was refused: its key may be used again.
    pub(crate) async fn drop_submission(&self, submission: Submission) -> Result<(), StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let sql = "DELETE FROM submissions WHERE token_id = ? AND key = ? AND status IS NULL";
                    sqlx::query(sql).bind(submission.owner).bind(submission.key).execute(&mut *tx).await?;
                    Ok(())
                })
            })
            .await
    }
}
