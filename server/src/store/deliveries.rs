//! Deliveries of attempts: a result or a failure report. Both are fenced, and safe to repeat.

use std::sync::Arc;
use std::time::Duration;

use roost_api::RunResult;
use roost_api::ids::{JobId, WorkerId};
use roost_api::job::{AttemptOutcome, FilledBy};
use roost_api::time::Timestamp;
use roost_solver::scenario;
use serde_json::json;

use super::batcher::{Batcher, waves};
use super::columns::to_json;
use super::database::{Connection, Engine, query, query_as, query_scalar};
use super::transitions::{AttemptEnd, AttemptRef, end_attempts, fence_attempts};
use super::writer::Writer;
use super::{Store, StoreError};
use crate::clock::Now;
use crate::queue::{
    ChargedAttempt, JobChange, Provenance, Refusal, RetryPolicy, Stated, Verdict, on_failure, on_result,
    recorded_outcome,
};

/// A result as text with its digest. Long results take a while to encode, so that it happens before any transaction.
pub(crate) struct EncodedResult {
    provenance: Provenance,
    responses: String,
    digest: String,
    body: String,
    pub(super) stated: Stated,
}

impl EncodedResult {
    /// Encodes a result.
    pub(crate) fn new(result: &RunResult) -> Result<Self, StoreError> {
        let body = to_json("result", result)?;
        Ok(Self {
            provenance: Provenance {
                scenario: result.scenario_digest.clone(),
                revision: result.solver.revision,
                backend: result.solver.backend.clone(),
                device: result.solver.device.clone(),
            },
            responses: to_json("responses", &result.responses)?,
            digest: blake3::hash(body.as_bytes()).to_hex().to_string(),
            body,
            stated: Stated {
                threads: u32::try_from(result.solver.threads).unwrap_or(u32::MAX),
                wall_ms: (result.performance.wall_s * 1000.0).ceil() as i64,
            },
        })
    }
}

#[cfg(test)]
impl EncodedResult {
    /// A result of that provenance for tests.
    pub(super) fn sample(provenance: Provenance, digest: &str) -> Self {
        let (responses, body) = ("{}".to_owned(), "{}".to_owned());
        // More than one thread, so that tests see what is counted.
        let stated = Stated { threads: 3, wall_ms: i64::MAX };
        Self { provenance, responses, digest: digest.to_owned(), body, stated }
    }
}

/// Results in one batch. It bounds the time that others wait for the writer.
const MAX_BATCH: usize = 64;

/// The result of an attempt.
pub(super) struct Delivered {
    attempt: AttemptRef,
    result: EncodedResult,
    filled_by: Option<FilledBy>,
    now: Timestamp,
}

type Answer = Result<Verdict, Refusal>;

pub(super) type ResultBatcher = Batcher<Delivered, Answer>;

pub(super) fn batcher(writer: Arc<Writer>) -> ResultBatcher {
    Batcher::start(writer, MAX_BATCH, Duration::ZERO, |tx, batch| Box::pin(record_all(tx, batch)))
}

impl Store {
    /// Whether an attempt exists.
    pub(crate) async fn find_attempt(
        &self,
        job: JobId,
        attempt: u32,
    ) -> Result<Result<(), Refusal>, StoreError> {
        let row: Option<(bool,)> = query_as(
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

    /// Records a result, exactly once per job, and where its filled state came from.
    pub(crate) async fn record_result(
        &self,
        job: JobId,
        attempt: u32,
        worker: WorkerId,
        (result, filled_by): (EncodedResult, Option<FilledBy>),
        now: Timestamp,
    ) -> Result<Result<Verdict, Refusal>, StoreError> {
        let attempt = AttemptRef { job, attempt, worker };
        self.results.submit(Delivered { attempt, result, filled_by, now }).await
    }

    /// Records the failure of an attempt, with its partial result.
    #[expect(clippy::too_many_arguments, reason = "a report as it arrives, and the clock")]
    pub(crate) async fn record_failure(
        &self,
        job: JobId,
        attempt: u32,
        worker: WorkerId,
        outcome: AttemptOutcome,
        message: String,
        partial: Option<EncodedResult>,
        policy: RetryPolicy,
        now: Now,
    ) -> Result<Result<Verdict, Refusal>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let written_to = AttemptRef { job, attempt, worker };
                    let fenced = match fence_attempts(tx, &[written_to]).await?.pop() {
                        Some(Ok(fenced)) => fenced,
                        Some(Err(refusal)) => return Ok(Err(refusal)),
                        None => return Ok(Err(Refusal::NoJob)),
                    };
                    let verdict = match on_failure(&fenced.job, fenced.fence, outcome, policy, now.lease) {
                        Ok(verdict) => verdict,
                        Err(refusal) => return Ok(Err(refusal)),
                    };
                    let Verdict::Record(change) = &verdict else { return Ok(Ok(verdict)) };
                    if let Some(partial) = &partial
                        && let Err(refusal) = check(tx, &partial.provenance, fenced.provenance).await?
                    {
                        return Ok(Err(refusal));
                    }
                    let stated = partial.as_ref().map(|partial| partial.stated);
                    let document = match partial {
                        Some(partial) => {
                            insert_document(tx, &partial.digest, partial.body).await?;
                            Some(partial.digest)
                        }
                        None => None,
                    };
                    let outcome = recorded_outcome(outcome, has_checkpoint(tx, job, attempt).await?);
                    let (message, partial, at) = (Some(message.as_str()), document.as_deref(), now.wall);
                    let (filled_by, charged) = (None, fenced.charged);
                    let ending = AttemptEnd {
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
                    };
                    end_attempts(tx, &[ending]).await?;
                    Ok(Ok(verdict))
                })
            })
            .await
    }
}

/// Records results. Several results of one job are recorded in order.
async fn record_all(tx: &mut Connection, batch: &[Arc<Delivered>]) -> Result<Vec<Answer>, StoreError> {
    let mut answers: Vec<Answer> = batch.iter().map(|_| Err(Refusal::NoJob)).collect();
    for wave in waves(batch.iter().map(|delivered| delivered.attempt.job)) {
        let attempts: Vec<_> = wave.iter().map(|index| batch[*index].attempt).collect();
        let mut accepted = Vec::new();
        for (index, fenced) in wave.into_iter().zip(fence_attempts(tx, &attempts).await?) {
            let delivered = batch[index].as_ref();
            let charged = fenced.as_ref().ok().and_then(|fenced| fenced.charged);
            let verdict = fenced.and_then(|fenced| Ok((on_result(fenced.fence)?, fenced.provenance)));
            answers[index] = match verdict {
                Ok((verdict @ Verdict::Record(_), registered)) => {
                    check(tx, &delivered.result.provenance, registered).await?.map(|()| verdict)
                }
                other => other.map(|(verdict, _)| verdict),
            };
            if let Ok(Verdict::Record(change)) = &answers[index] {
                accepted.push(Accepted { delivered, charged, change: change.clone() });
            }
        }
        record(tx, &accepted).await?;
    }
    Ok(answers)
}

/// Refuses a result whose provenance differs from the registered one. A job that an earlier version queued has the digest of a
/// scenario that lacks newer fields; a worker runs and returns the upgraded scenario.
async fn check(
    tx: &mut Connection,
    stated: &Provenance,
    mut registered: Provenance,
) -> Result<Result<(), Refusal>, StoreError> {
    if stated.scenario != registered.scenario {
        let body: Option<String> = query_scalar("SELECT body FROM scenarios WHERE digest = ?")
            .bind(&registered.scenario)
            .fetch_optional(&mut *tx)
            .await?;
        if let Some(upgraded) = body.and_then(|body| scenario::parse(&body).ok()) {
            registered.scenario = upgraded.digest();
        }
    }
    Ok(stated.check(&registered))
}

/// A result that is recorded.
struct Accepted<'a> {
    delivered: &'a Delivered,
    charged: Option<ChargedAttempt>,
    change: JobChange,
}

/// Stores accepted results of different jobs.
async fn record(tx: &mut Connection, accepted: &[Accepted<'_>]) -> Result<(), StoreError> {
    if accepted.is_empty() {
        return Ok(());
    }
    // All texts in one blob: as JSON strings, every quote would be escaped and unescaped again.
    let mut bodies = Vec::with_capacity(accepted.iter().map(|it| it.delivered.result.body.len()).sum());
    let (mut rows, mut endings) = (Vec::new(), Vec::new());
    for Accepted { delivered, charged, change } in accepted {
        let Delivered { attempt: AttemptRef { job, attempt, .. }, result, filled_by, now } = delivered;
        let (job, attempt, charged, at) = (*job, *attempt, *charged, *now);
        rows.push(json!({
            "job": job, "attempt": attempt, "digest": result.provenance.scenario,
            "revision": result.provenance.revision, "backend": result.provenance.backend, "responses": result.responses, "document": result.digest, "at": at.0,
            "from": bodies.len() + 1, "bytes": result.body.len(),
        }));
        bodies.extend_from_slice(result.body.as_bytes());
        let outcome = AttemptOutcome::Succeeded;
        let (message, partial, filled_by, stated) = (None, None, *filled_by, Some(result.stated));
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
    let rows = to_json("results", &rows)?;
    let sql = match tx.engine() {
        Engine::Sqlite => RECORD,
        Engine::Postgres => RECORD_IN_POSTGRES,
    };
    query(sql).bind(bodies).bind(&rows).bind(&rows).execute(&mut *tx).await?;
    end_attempts(tx, &endings).await
}

/// Stores documents and results. The body of a document is cut from a blob.
macro_rules! record {
    ($body:literal) => {
        concat!(
            "
    INSERT INTO documents (digest, body)
    SELECT r.value ->> 'document', ",
            $body,
            "
    FROM json_each(?) AS r WHERE true ON CONFLICT (digest) DO NOTHING;
    INSERT INTO results (job_id, attempt, scenario_digest, solver_revision, backend, responses, document_digest, recorded_at)
    SELECT r.value ->> 'job', CAST(r.value ->> 'attempt' AS BIGINT), r.value ->> 'digest', CAST(r.value ->> 'revision' AS BIGINT),
           r.value ->> 'backend', r.value ->> 'responses', r.value ->> 'document', CAST(r.value ->> 'at' AS BIGINT)
    FROM json_each(?) AS r"
        )
    };
}

/// For SQLite, whose `substr` of a blob counts bytes, not characters.
pub(super) const RECORD: &str = record!("CAST(substr(?, r.value ->> 'from', r.value ->> 'bytes') AS TEXT)");

/// For PostgreSQL, where a function of the schema does this.
const RECORD_IN_POSTGRES: &str =
    record!("utf8(?, CAST(r.value ->> 'from' AS BIGINT), CAST(r.value ->> 'bytes' AS BIGINT))");

/// Whether the newest checkpoint of a job is of this attempt.
async fn has_checkpoint(tx: &mut Connection, job: JobId, attempt: u32) -> Result<bool, StoreError> {
    let sql = "SELECT EXISTS (SELECT 1 FROM checkpoints WHERE job_id = ? AND attempt = ?)";
    Ok(query_scalar(sql).bind(job.to_string()).bind(attempt).fetch_one(&mut *tx).await?)
}

/// Stores a document under its digest.
async fn insert_document(tx: &mut Connection, digest: &str, body: String) -> Result<(), StoreError> {
    query("INSERT INTO documents (digest, body) VALUES (?, ?) ON CONFLICT (digest) DO NOTHING")
        .bind(digest)
        .bind(body)
        .execute(&mut *tx)
        .await?;
    Ok(())
}
