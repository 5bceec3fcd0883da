//! Deliveries of attempts: the result, or why there is none. Both are fenced, and safe to repeat.

use roost_api::RunResult;
use roost_api::ids::{JobId, WorkerId};
use roost_api::job::AttemptOutcome;
use roost_api::time::Timestamp;
use sqlx::SqliteConnection;

use super::facts::{Ending, end, fenced};
use super::rows::to_json;
use super::{Store, StoreError};
use crate::clock::Now;
use crate::queue::{Refusal, RetryPolicy, Verdict, on_failure, on_result};

/// A result written out and hashed, which for a long one takes a while: done before any transaction.
pub(crate) struct StoredResult {
    scenario_digest: String,
    solver_revision: u32,
    backend: String,
    responses: String,
    digest: String,
    body: String,
}

impl StoredResult {
    /// Writes a result out.
    pub(crate) fn new(result: &RunResult) -> Result<Self, StoreError> {
        let body = to_json("result", result)?;
        Ok(Self {
            scenario_digest: result.scenario_digest.clone(),
            solver_revision: result.solver.revision,
            backend: result.solver.backend.clone(),
            responses: to_json("responses", &result.responses)?,
            digest: blake3::hash(body.as_bytes()).to_hex().to_string(),
            body,
        })
    }
}

#[cfg(test)]
impl StoredResult {
    /// Something that stands for a result of that scenario.
    pub(super) fn stand_in(scenario_digest: &str, mark: &str) -> Self {
        Self {
            scenario_digest: scenario_digest.to_owned(),
            solver_revision: roost_solver::SOLVER_REVISION,
            backend: "cpu".to_owned(),
            responses: "{}".to_owned(),
            digest: mark.to_owned(),
            body: "{}".to_owned(),
        }
    }
}

impl Store {
    /// Whether there is such an attempt.
    pub(crate) async fn find_attempt(
        &self,
        job: JobId,
        attempt: u32,
    ) -> Result<Result<(), Refusal>, StoreError> {
        let row: Option<(bool,)> = sqlx::query_as(
            "SELECT EXISTS (SELECT 1 FROM attempts WHERE job_id = jobs.id AND number = ?)
             FROM jobs WHERE id = ?",
        )
        .bind(attempt)
        .bind(job.to_string())
        .fetch_optional(&self.readers)
        .await?;
        Ok(match row {
            None => Err(Refusal::NoJob),
            Some((false,)) => Err(Refusal::NoAttempt),
            Some((true,)) => Ok(()),
        })
    }

    /// Records a result, exactly once per job.
    pub(crate) async fn record_result(
        &self,
        job_id: JobId,
        attempt: u32,
        worker: WorkerId,
        result: StoredResult,
        now: Timestamp,
    ) -> Result<Result<Verdict, Refusal>, StoreError> {
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
                    sqlx::query(
                        "INSERT INTO documents (digest, body) VALUES (?, ?) ON CONFLICT (digest) DO NOTHING;
                         INSERT INTO results (job_id, attempt, digest, solver_revision, backend, responses,
                                              document, recorded_at)
                         VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                    )
                    .bind(&result.digest)
                    .bind(result.body)
                    .bind(job_id.to_string())
                    .bind(attempt)
                    .bind(&fenced.digest)
                    .bind(result.solver_revision)
                    .bind(&result.backend)
                    .bind(&result.responses)
                    .bind(&result.digest)
                    .bind(now.0)
                    .execute(&mut *tx)
                    .await?;
                    let outcome = AttemptOutcome::Succeeded;
                    let ending =
                        Ending { job: job_id, attempt, outcome, change, message: None, partial: None };
                    end(tx, ending, now).await?;
                    Ok(Ok(verdict))
                })
            })
            .await
    }

    /// Records why an attempt has no result, with what it came to.
    #[expect(clippy::too_many_arguments, reason = "a report as it arrives, and the clock")]
    pub(crate) async fn record_failure(
        &self,
        job_id: JobId,
        attempt: u32,
        worker: WorkerId,
        outcome: AttemptOutcome,
        message: String,
        partial: Option<StoredResult>,
        policy: RetryPolicy,
        now: Now,
    ) -> Result<Result<Verdict, Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let fenced = match fenced(tx, job_id, attempt, worker).await? {
                        Ok(fenced) => fenced,
                        Err(refusal) => return Ok(Err(refusal)),
                    };
                    let verdict = match on_failure(&fenced.job, fenced.standing, outcome, policy, now.lease) {
                        Ok(verdict) => verdict,
                        Err(refusal) => return Ok(Err(refusal)),
                    };
                    let Verdict::Record(change) = &verdict else { return Ok(Ok(verdict)) };
                    if partial.as_ref().is_some_and(|partial| partial.scenario_digest != fenced.digest) {
                        return Ok(Err(Refusal::OtherScenario));
                    }
                    let document = match partial {
                        Some(partial) => {
                            insert_document(tx, &partial.digest, partial.body).await?;
                            Some(partial.digest)
                        }
                        None => None,
                    };
                    let (message, partial) = (Some(message.as_str()), document.as_deref());
                    end(tx, Ending { job: job_id, attempt, outcome, change, message, partial }, now.wall)
                        .await?;
                    Ok(Ok(verdict))
                })
            })
            .await
    }
}

/// Stores a document under its digest.
async fn insert_document(tx: &mut SqliteConnection, digest: &str, body: String) -> Result<(), StoreError> {
    sqlx::query("INSERT INTO documents (digest, body) VALUES (?, ?) ON CONFLICT (digest) DO NOTHING")
        .bind(digest)
        .bind(body)
        .execute(&mut *tx)
        .await?;
    Ok(())
}
