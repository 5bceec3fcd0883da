//! Deliveries of attempts: the result, or why there is none. Both are fenced, and safe to repeat.

use std::sync::Arc;
use std::time::Duration;

use roost_api::RunResult;
use roost_api::ids::{JobId, WorkerId};
use roost_api::job::AttemptOutcome;
use roost_api::time::Timestamp;
use serde_json::json;
use sqlx::SqliteConnection;

use super::facts::{Ending, Written, end, fenced};
use super::rows::to_json;
use super::together::{Collector, rounds};
use super::writer::Writer;
use super::{Store, StoreError};
use crate::clock::Now;
use crate::queue::{JobChange, Origin, Refusal, RetryPolicy, Verdict, on_failure, on_result};

/// A result written out and hashed, which for a long one takes a while: done before any transaction.
pub(crate) struct StoredResult {
    origin: Origin,
    responses: String,
    digest: String,
    body: String,
}

impl StoredResult {
    /// Writes a result out.
    pub(crate) fn new(result: &RunResult) -> Result<Self, StoreError> {
        let body = to_json("result", result)?;
        Ok(Self {
            origin: Origin {
                scenario: result.scenario_digest.clone(),
                revision: result.solver.revision,
                backend: result.solver.backend.clone(),
                device: result.solver.device.clone(),
            },
            responses: to_json("responses", &result.responses)?,
            digest: blake3::hash(body.as_bytes()).to_hex().to_string(),
            body,
        })
    }
}

#[cfg(test)]
impl StoredResult {
    /// Something that stands for a result of that origin.
    pub(super) fn stand_in(origin: Origin, mark: &str) -> Self {
        Self { origin, responses: "{}".to_owned(), digest: mark.to_owned(), body: "{}".to_owned() }
    }
}

/// Results that are written together: a bound on how long others wait for the writer.
const GROUP: usize = 64;

/// The result of an attempt.
pub(super) struct Delivered {
    written: Written,
    result: StoredResult,
    now: Timestamp,
}

type Answer = Result<Verdict, Refusal>;

/// Where results wait for each other.
pub(super) type Collected = Collector<Delivered, Answer>;

pub(super) fn collect(writer: Arc<Writer>) -> Collected {
    Collector::start(writer, GROUP, Duration::ZERO, |tx, group| Box::pin(record_all(tx, group)))
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
        job: JobId,
        attempt: u32,
        worker: WorkerId,
        result: StoredResult,
        now: Timestamp,
    ) -> Result<Result<Verdict, Refusal>, StoreError> {
        self.results.ask(Delivered { written: Written { job, attempt, worker }, result, now }).await
    }

    /// Records why an attempt has no result, with what it came to.
    #[expect(clippy::too_many_arguments, reason = "a report as it arrives, and the clock")]
    pub(crate) async fn record_failure(
        &self,
        job: JobId,
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
                    let written = Written { job, attempt, worker };
                    let fenced = match fenced(tx, &[written]).await?.pop() {
                        Some(Ok(fenced)) => fenced,
                        Some(Err(refusal)) => return Ok(Err(refusal)),
                        None => return Ok(Err(Refusal::NoJob)),
                    };
                    let verdict = match on_failure(&fenced.job, fenced.standing, outcome, policy, now.lease) {
                        Ok(verdict) => verdict,
                        Err(refusal) => return Ok(Err(refusal)),
                    };
                    let Verdict::Record(change) = &verdict else { return Ok(Ok(verdict)) };
                    if let Some(Err(refusal)) =
                        partial.as_ref().map(|partial| partial.origin.check(&fenced.origin))
                    {
                        return Ok(Err(refusal));
                    }
                    let document = match partial {
                        Some(partial) => {
                            insert_document(tx, &partial.digest, partial.body).await?;
                            Some(partial.digest)
                        }
                        None => None,
                    };
                    let (message, partial, at) = (Some(message.as_str()), document.as_deref(), now.wall);
                    end(tx, &[Ending { job, attempt, outcome, change, message, partial, at }]).await?;
                    Ok(Ok(verdict))
                })
            })
            .await
    }
}

/// Records results: those of one job one after the other, all others together.
async fn record_all(tx: &mut SqliteConnection, group: &[Arc<Delivered>]) -> Result<Vec<Answer>, StoreError> {
    let mut answers: Vec<Answer> = group.iter().map(|_| Err(Refusal::NoJob)).collect();
    for places in rounds(group.iter().map(|delivered| delivered.written.job)) {
        let written: Vec<_> = places.iter().map(|place| group[*place].written).collect();
        let mut accepted = Vec::new();
        for (place, fenced) in places.into_iter().zip(fenced(tx, &written).await?) {
            let delivered = group[place].as_ref();
            answers[place] = fenced.and_then(|fenced| {
                let verdict = on_result(fenced.standing)?;
                if matches!(verdict, Verdict::Record(_)) {
                    delivered.result.origin.check(&fenced.origin)?;
                }
                Ok(verdict)
            });
            if let Ok(Verdict::Record(change)) = &answers[place] {
                accepted.push((delivered, change.clone()));
            }
        }
        record(tx, &accepted).await?;
    }
    Ok(answers)
}

/// Writes results down that were accepted, each of another job.
async fn record(tx: &mut SqliteConnection, accepted: &[(&Delivered, JobChange)]) -> Result<(), StoreError> {
    if accepted.is_empty() {
        return Ok(());
    }
    // All texts in one: as strings in JSON they would be written out with every quote escaped, and read back again.
    let mut bodies =
        Vec::with_capacity(accepted.iter().map(|(delivered, _)| delivered.result.body.len()).sum());
    let (mut rows, mut endings) = (Vec::new(), Vec::new());
    for (Delivered { written: Written { job, attempt, .. }, result, now }, change) in accepted {
        let (job, attempt, at) = (*job, *attempt, *now);
        rows.push(json!({
            "job": job, "attempt": attempt, "digest": result.origin.scenario,
            "revision": result.origin.revision, "backend": result.origin.backend, "responses": result.responses, "document": result.digest, "at": at.0,
            "from": bodies.len() + 1, "bytes": result.body.len(),
        }));
        bodies.extend_from_slice(result.body.as_bytes());
        let outcome = AttemptOutcome::Succeeded;
        endings.push(Ending { job, attempt, outcome, change, message: None, partial: None, at });
    }
    let rows = to_json("results", &rows)?;
    sqlx::query(RECORD).bind(bodies).bind(&rows).bind(&rows).execute(&mut *tx).await?;
    end(tx, &endings).await
}

/// Of bytes, `substr` finds a part without counting letters.
pub(super) const RECORD: &str = "
    INSERT INTO documents (digest, body)
    SELECT r.value ->> 'document', CAST(substr(?, r.value ->> 'from', r.value ->> 'bytes') AS TEXT)
    FROM json_each(?) AS r WHERE true ON CONFLICT (digest) DO NOTHING;
    INSERT INTO results (job_id, attempt, scenario_digest, solver_revision, backend, responses, document_digest, recorded_at)
    SELECT r.value ->> 'job', r.value ->> 'attempt', r.value ->> 'digest', r.value ->> 'revision',
           r.value ->> 'backend', r.value ->> 'responses', r.value ->> 'document', r.value ->> 'at'
    FROM json_each(?) AS r";

/// Stores a document under its digest.
async fn insert_document(tx: &mut SqliteConnection, digest: &str, body: String) -> Result<(), StoreError> {
    sqlx::query("INSERT INTO documents (digest, body) VALUES (?, ?) ON CONFLICT (digest) DO NOTHING")
        .bind(digest)
        .bind(body)
        .execute(&mut *tx)
        .await?;
    Ok(())
}
