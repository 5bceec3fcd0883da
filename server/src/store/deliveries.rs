//! Deliveries of attempts: the result, or why there is none. Both are fenced, and safe to repeat.

use roost_api::RunResult;
use roost_api::ids::{JobId, WorkerId};
use roost_api::job::AttemptOutcome;
use roost_api::time::Timestamp;
use serde_json::Map;
use sqlx::SqliteConnection;

use super::facts::{change_job, end_attempt, fenced};
use super::rows::to_json;
use super::{Store, StoreError};
use crate::queue::{AttemptLimits, Refusal, Verdict, on_failure, on_result};

impl Store {
    /// Records a result, exactly once per job.
    pub(crate) async fn record_result(
        &self,
        job_id: JobId,
        attempt: u32,
        worker: WorkerId,
        result: RunResult,
        now: Timestamp,
    ) -> Result<Result<Verdict, Refusal>, StoreError> {
        let body = to_json("result", &result)?;
        let responses = to_json("responses", &result.responses)?;
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let fenced = match fenced(tx, job_id, attempt, worker).await? {
                        Ok(fenced) => fenced,
                        Err(refusal) => return Ok(Err(refusal)),
                    };
                    let verdict = match on_result(fenced.standing) {
                        Ok(verdict) => verdict,
                        Err(refusal) => return Ok(Err(refusal)),
                    };
                    let Verdict::Record(change) = &verdict else { return Ok(Ok(verdict)) };
                    if result.scenario_digest != fenced.digest {
                        return Ok(Err(Refusal::OtherScenario));
                    }
                    let document = insert_document(tx, body).await?;
                    sqlx::query(
                        "INSERT INTO results (job_id, attempt, digest, physics_revision, backend, responses,
                                              document, recorded_at)
                         VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                    )
                    .bind(job_id.to_string())
                    .bind(attempt)
                    .bind(&fenced.digest)
                    .bind(result.solver.physics_revision)
                    .bind(&result.solver.backend)
                    .bind(responses)
                    .bind(document)
                    .bind(now.0)
                    .execute(&mut *tx)
                    .await?;
                    end_attempt(tx, job_id, attempt, AttemptOutcome::Succeeded, None, None, now).await?;
                    change_job(tx, job_id, change, None, now).await?;
                    Ok(Ok(verdict))
                })
            })
            .await
    }

    /// Records why an attempt has no result. A partial result keeps its series; what a cancelled run had
    /// come to is no response.
    #[expect(clippy::too_many_arguments, reason = "a report as it arrives, and the clock")]
    pub(crate) async fn record_failure(
        &self,
        job_id: JobId,
        attempt: u32,
        worker: WorkerId,
        outcome: AttemptOutcome,
        message: String,
        partial: Option<RunResult>,
        limits: AttemptLimits,
        now: Timestamp,
    ) -> Result<Result<Verdict, Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let fenced = match fenced(tx, job_id, attempt, worker).await? {
                        Ok(fenced) => fenced,
                        Err(refusal) => return Ok(Err(refusal)),
                    };
                    let verdict = match on_failure(&fenced.job, fenced.standing, outcome, limits) {
                        Ok(verdict) => verdict,
                        Err(refusal) => return Ok(Err(refusal)),
                    };
                    let Verdict::Record(change) = &verdict else { return Ok(Ok(verdict)) };
                    if partial.as_ref().is_some_and(|partial| partial.scenario_digest != fenced.digest) {
                        return Ok(Err(Refusal::OtherScenario));
                    }
                    let document = match partial {
                        Some(mut partial) => {
                            if outcome == AttemptOutcome::Cancelled {
                                partial.responses = Map::new();
                            }
                            Some(insert_document(tx, to_json("result", &partial)?).await?)
                        }
                        None => None,
                    };
                    let partial = document.as_deref();
                    end_attempt(tx, job_id, attempt, outcome, Some(&message), partial, now).await?;
                    change_job(tx, job_id, change, Some(&message), now).await?;
                    Ok(Ok(verdict))
                })
            })
            .await
    }
}

/// Stores a document under its digest.
async fn insert_document(tx: &mut SqliteConnection, body: String) -> Result<String, StoreError> {
    let digest = blake3::hash(body.as_bytes()).to_hex().to_string();
    sqlx::query("INSERT INTO documents (digest, body) VALUES (?, ?) ON CONFLICT (digest) DO NOTHING")
        .bind(&digest)
        .bind(body)
        .execute(&mut *tx)
        .await?;
    Ok(digest)
}
