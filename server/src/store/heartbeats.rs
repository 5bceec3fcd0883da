//! Heartbeats: one a worker, a row an attempt, and those of many workers in one go.
//!
//! Thousands of workers beat every other second. What arrives within some milliseconds is looked up, decided on and written
//! together, so that a beat costs the database next to nothing; an answer may be late by that much.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use roost_api::ids::{JobId, WorkerId};
use roost_api::lease::{AttemptDirective, Directive, HeartbeatReply};
use roost_api::time::Timestamp;
use serde_json::{Value, json};
use sqlx::{AssertSqlSafe, SqliteConnection};
use tokio::sync::{mpsc, oneshot};
use tokio::time::Instant;

use super::facts::{JOB_FACTS, job_facts};
use super::rows::{Columns, to_json};
use super::writer::Writer;
use super::{Store, StoreError};
use crate::queue::{AttemptFacts, BeatEffect, Refusal, on_beat, standing};

/// One group is worked in this time, and what arrives meanwhile makes the next.
///
/// Not in stories of the simulation, where beats come one by one and nobody waits with them.
const WINDOW: Duration = Duration::from_millis(if cfg!(test) { 0 } else { 20 });
/// Workers whose beats are worked together.
const GROUP: usize = 256;

/// A sign of life of one attempt.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beat {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt.
    pub attempt: u32,
}

/// The beats of one worker.
#[derive(Clone, Debug)]
struct Beats {
    worker: WorkerId,
    beats: Vec<Beat>,
    now: Timestamp,
    until: Timestamp,
}

type Answer = Result<Result<HeartbeatReply, Refusal>, StoreError>;

/// Where beats wait for each other. Its task ends with it.
pub(super) struct Collector(mpsc::Sender<(Beats, oneshot::Sender<Answer>)>);

impl Collector {
    pub(super) fn start(writer: Arc<Writer>) -> Self {
        let (sender, mut waiting) = mpsc::channel(4096);
        tokio::spawn(async move {
            let mut group = Vec::new();
            let mut earliest = Instant::now();
            while waiting.recv_many(&mut group, GROUP).await > 0 {
                if group.len() < GROUP {
                    tokio::time::sleep_until(earliest).await;
                    while group.len() < GROUP
                        && let Ok(next) = waiting.try_recv()
                    {
                        group.push(next);
                    }
                }
                earliest = Instant::now() + WINDOW;
                work(&writer, std::mem::take(&mut group)).await;
            }
        });
        Self(sender)
    }
}

/// Works a group, and answers everybody.
async fn work(writer: &Writer, group: Vec<(Beats, oneshot::Sender<Answer>)>) {
    let (beats, senders): (Vec<_>, Vec<_>) = group.into_iter().unzip();
    let worked = writer.write(move |tx| Box::pin(async move { renew_all(tx, &beats).await })).await;
    match worked {
        // Nobody may be listening any more.
        Ok(answers) => {
            senders.into_iter().zip(answers).for_each(|(sender, answer)| drop(sender.send(Ok(answer))))
        }
        Err(error) => {
            let error = Arc::new(error);
            senders.into_iter().for_each(|sender| drop(sender.send(Err(StoreError::Shared(error.clone())))));
        }
    }
}

impl Store {
    /// Renews the leases of a worker's attempts until `until`; the rows of the reply are in the order of the beats.
    pub(crate) async fn heartbeat(
        &self,
        worker: WorkerId,
        beats: Vec<Beat>,
        now: Timestamp,
        until: Timestamp,
    ) -> Answer {
        let (sender, receiver) = oneshot::channel();
        let asked = self.beats.0.send((Beats { worker, beats, now, until }, sender)).await;
        asked.map_err(|_| StoreError::WriterGone)?;
        receiver.await.map_err(|_| StoreError::WriterGone)?
    }
}

/// Renews what the workers hold; the answers are in their order.
async fn renew_all(
    tx: &mut SqliteConnection,
    group: &[Beats],
) -> Result<Vec<Result<HeartbeatReply, Refusal>>, StoreError> {
    let draining = seen(tx, group).await?;
    let effects = effects(tx, group).await?;
    let mut renewed: Vec<Value> = Vec::new();
    let mut next = effects.into_iter();
    let mut answers = Vec::with_capacity(group.len());
    for beats in group {
        let mut attempts = Vec::with_capacity(beats.beats.len());
        for (beat, effect) in beats.beats.iter().zip(next.by_ref()) {
            // Whom nobody knows holds nothing, but its rows have effects like all.
            let known = draining.contains_key(&beats.worker);
            if let BeatEffect::Renew { until, .. } = effect
                && known
            {
                renewed.push(json!({"job": beat.job_id, "attempt": beat.attempt, "worker": beats.worker, "until": until.0}));
            }
            attempts.push(directive(*beat, effect));
        }
        answers.push(match draining.get(&beats.worker) {
            Some(drain) => Ok(HeartbeatReply { attempts, drain: *drain }),
            None => Err(Refusal::NoWorker),
        });
    }
    if !renewed.is_empty() {
        let renewed = to_json("beats", &renewed)?;
        sqlx::query(RENEW).bind(&renewed).bind(&renewed).execute(&mut *tx).await?;
    }
    Ok(answers)
}

/// What was back in the queue, with a pause or to run alone, was never lost; nor was its attempt.
pub(super) const RENEW: &str = "
    UPDATE jobs SET alone = CASE state WHEN 'queued' THEN 0 ELSE alone END, state = 'running', not_before = NULL,
                    worker_id = beat.value ->> 'worker', lease_expires_at = beat.value ->> 'until'
    FROM json_each(?) AS beat WHERE jobs.id = beat.value ->> 'job';
    UPDATE attempts SET outcome = NULL, message = NULL, ended_at = NULL
    FROM json_each(?) AS beat
    WHERE attempts.job_id = beat.value ->> 'job' AND attempts.number = beat.value ->> 'attempt'
      AND attempts.outcome IS NOT NULL";

/// Notes that the workers were heard of; says of each that is known whether it drains.
async fn seen(tx: &mut SqliteConnection, group: &[Beats]) -> Result<HashMap<WorkerId, bool>, StoreError> {
    let workers: Vec<_> = group.iter().map(|beats| json!({"id": beats.worker, "at": beats.now.0})).collect();
    let sql =
        "UPDATE workers SET last_seen_at = max(last_seen_at, seen.value ->> 'at') FROM json_each(?) AS seen
               WHERE workers.id = seen.value ->> 'id' RETURNING workers.id, draining";
    let rows = sqlx::query(sql).bind(to_json("workers", &workers)?).fetch_all(&mut *tx).await?;
    rows.iter().map(|row| Ok((row.parsed("id")?, row.column("draining")?))).collect()
}

/// What every beat of the group does, one after the other.
async fn effects(tx: &mut SqliteConnection, group: &[Beats]) -> Result<Vec<BeatEffect>, StoreError> {
    let all: Vec<_> =
        group.iter().flat_map(|beats| beats.beats.iter().map(move |beat| (beats, beat))).collect();
    let mut effects = vec![BeatEffect::Abandon; all.len()];
    if all.is_empty() {
        return Ok(effects);
    }
    let asked: Vec<_> =
        all.iter().map(|(_, beat)| json!({"job": beat.job_id, "attempt": beat.attempt})).collect();
    let sql = format!(
        "SELECT beat.key AS place, {JOB_FACTS}, a.worker_id AS claimed_by, a.outcome
         FROM json_each(?) AS beat CROSS JOIN jobs j ON j.id = beat.value ->> 'job'
         CROSS JOIN attempts a ON a.job_id = j.id AND a.number = beat.value ->> 'attempt'"
    );
    let rows = sqlx::query(AssertSqlSafe(sql)).bind(to_json("beats", &asked)?).fetch_all(&mut *tx).await?;
    for row in &rows {
        let place: usize = row.number::<u32>("place")? as usize;
        let Some((beats, beat)) = all.get(place) else { continue };
        let attempt = AttemptFacts {
            number: beat.attempt,
            worker_id: row.parsed("claimed_by")?,
            outcome: row.parsed_opt("outcome")?,
        };
        let job = job_facts(row)?;
        effects[place] = on_beat(&job, standing(&job, &attempt, beats.worker), beats.until);
    }
    Ok(effects)
}

fn directive(beat: Beat, effect: BeatEffect) -> AttemptDirective {
    let (directive, lease_expires_at) = match effect {
        BeatEffect::Renew { until, cancel: false } => (Directive::Continue, Some(until)),
        BeatEffect::Renew { cancel: true, .. } => (Directive::Cancel, None),
        BeatEffect::Abandon => (Directive::Abandon, None),
    };
    AttemptDirective { job_id: beat.job_id, attempt: beat.attempt, directive, lease_expires_at }
}
