//! Heartbeats: one request per worker with an entry per attempt, in batches of many workers.
//!
//! Thousands of workers send a heartbeat every two seconds. Those that arrive within some milliseconds are looked up, decided on and
//! written together. This delays an answer by as many milliseconds, and makes the cost of a heartbeat small.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::Duration;

use roost_api::ids::{JobId, WorkerId};
use roost_api::lease::{AttemptDirective, Directive, HeartbeatReply};
use roost_api::time::Timestamp;
use serde_json::{Value, json};

use super::batcher::Batcher;
use super::columns::{Columns, to_json};
use super::database::{Connection, query};
use super::transitions::{AttemptRef, FencedAttempt, fence_attempts};
use super::writer::Writer;
use super::{Store, StoreError};
use crate::queue::{BeatEffect, Refusal, StopRequest, on_beat};

/// Minimum time from batch to batch. Zero in tests: the simulation sends heartbeats one by one.
const INTERVAL: Duration = Duration::from_millis(if cfg!(test) { 0 } else { 20 });
/// Workers in one batch.
const MAX_BATCH: usize = 256;

/// The heartbeat of one attempt.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beat {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt.
    pub attempt: u32,
}

/// The heartbeat of one worker.
#[derive(Debug)]
pub(super) struct Beats {
    worker: WorkerId,
    beats: Vec<Beat>,
    now: Timestamp,
    until: Timestamp,
}

type BeatReply = Result<HeartbeatReply, Refusal>;

pub(super) type BeatBatcher = Batcher<Beats, BeatReply>;

pub(super) fn batcher(writer: Arc<Writer>) -> BeatBatcher {
    Batcher::start(writer, MAX_BATCH, INTERVAL, |tx, batch| Box::pin(renew_all(tx, batch)))
}

impl Store {
    /// Renews the leases of a worker's attempts until `until`. The reply has the order of the beats.
    pub(crate) async fn heartbeat(
        &self,
        worker: WorkerId,
        beats: Vec<Beat>,
        now: Timestamp,
        until: Timestamp,
    ) -> Result<BeatReply, StoreError> {
        self.beats.submit(Beats { worker, beats, now, until }).await
    }
}

/// Renews the leases of a batch of workers, and answers in their order.
async fn renew_all(tx: &mut Connection, batch: &[Arc<Beats>]) -> Result<Vec<BeatReply>, StoreError> {
    let draining = mark_seen(tx, batch).await?;
    let effects = effects(tx, batch).await?;
    // By attempt: a worker may have repeated its heartbeat, and the last one counts.
    let mut renewed: BTreeMap<(JobId, u32), Value> = BTreeMap::new();
    let mut next = effects.into_iter();
    let mut answers = Vec::with_capacity(batch.len());
    for beats in batch {
        let mut attempts = Vec::with_capacity(beats.beats.len());
        for (beat, effect) in beats.beats.iter().zip(next.by_ref()) {
            // An unregistered worker holds nothing, but its entries have effects too.
            let known = draining.contains_key(&beats.worker);
            if let BeatEffect::Renew { until, .. } = effect
                && known
            {
                let row = json!({"job": beat.job_id, "attempt": beat.attempt, "worker": beats.worker, "until": until.0});
                renewed.insert((beat.job_id, beat.attempt), row);
            }
            attempts.push(directive(*beat, effect));
        }
        answers.push(match draining.get(&beats.worker) {
            Some(drain) => Ok(HeartbeatReply { attempts, drain: *drain }),
            None => Err(Refusal::NoWorker),
        });
    }
    if !renewed.is_empty() {
        let renewed = to_json("beats", &renewed.values().collect::<Vec<_>>())?;
        query(RENEW).bind(&renewed).bind(&renewed).execute(&mut *tx).await?;
    }
    Ok(answers)
}

/// Renews leases. A job that was back in the queue was never lost, nor was its attempt: its pause and `alone` go.
pub(super) const RENEW: &str = "
    UPDATE jobs SET alone = CASE state WHEN 'queued' THEN 0 ELSE alone END, state = 'running', not_before = NULL,
                    worker_id = beat.value ->> 'worker', lease_expires_at = CAST(beat.value ->> 'until' AS BIGINT)
    FROM json_each(?) AS beat WHERE jobs.id = beat.value ->> 'job';
    UPDATE attempts SET outcome = NULL, message = NULL, ended_at = NULL, core_ms = NULL
    FROM json_each(?) AS beat
    WHERE attempts.job_id = beat.value ->> 'job' AND attempts.number = CAST(beat.value ->> 'attempt' AS BIGINT)
      AND attempts.outcome IS NOT NULL";

/// Records that the workers were seen, and returns whether each registered one is draining.
async fn mark_seen(tx: &mut Connection, batch: &[Arc<Beats>]) -> Result<HashMap<WorkerId, bool>, StoreError> {
    let workers: Vec<_> = batch.iter().map(|beats| json!({"id": beats.worker, "at": beats.now.0})).collect();
    // The time may be earlier than the stored one, when the clock was set back.
    let sql =
        "UPDATE workers SET last_seen_at = CAST(seen.value ->> 'at' AS BIGINT) FROM json_each(?) AS seen
               WHERE workers.id = seen.value ->> 'id' RETURNING workers.id, draining";
    let rows = query(sql).bind(to_json("workers", &workers)?).fetch_all(&mut *tx).await?;
    rows.iter().map(|row| Ok((row.parsed("id")?, row.column("draining")?))).collect()
}

/// The effect of every beat of the batch, in order.
async fn effects(tx: &mut Connection, batch: &[Arc<Beats>]) -> Result<Vec<BeatEffect>, StoreError> {
    let all = batch.iter().flat_map(|beats| beats.beats.iter().map(move |beat| (beats, beat)));
    let (attempts, until): (Vec<_>, Vec<_>) = all
        .map(|(beats, beat)| {
            (AttemptRef { job: beat.job_id, attempt: beat.attempt, worker: beats.worker }, beats.until)
        })
        .unzip();
    let fenced = fence_attempts(tx, &attempts).await?;
    let effect = |(fenced, until): (Result<FencedAttempt, Refusal>, Timestamp)| match fenced {
        Ok(fenced) => on_beat(&fenced.job, fenced.fence, until),
        Err(_) => BeatEffect::Abandon,
    };
    Ok(fenced.into_iter().zip(until).map(effect).collect())
}

fn directive(beat: Beat, effect: BeatEffect) -> AttemptDirective {
    let (directive, lease_expires_at) = match effect {
        BeatEffect::Renew { until, stop: None } => (Directive::Continue, Some(until)),
        BeatEffect::Renew { stop: Some(StopRequest::Cancel), .. } => (Directive::Cancel, None),
        BeatEffect::Renew { stop: Some(StopRequest::Preempt), .. } => (Directive::Preempt, None),
        BeatEffect::Abandon => (Directive::Abandon, None),
    };
    AttemptDirective {
        job_id: beat.job_id,
        attempt: beat.attempt,
        directive,
        lease_expires_at,
        missing_samples: BTreeMap::new(),
        resend_samples: false,
    }
}
