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
use sqlx::SqliteConnection;

use super::facts::{Fenced, Written, fenced};
use super::rows::{Columns, to_json};
use super::together::Collector;
use super::writer::Writer;
use super::{Store, StoreError};
use crate::queue::{BeatEffect, Refusal, on_beat};

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
#[derive(Debug)]
pub(super) struct Beats {
    worker: WorkerId,
    beats: Vec<Beat>,
    now: Timestamp,
    until: Timestamp,
}

type Answer = Result<HeartbeatReply, Refusal>;

/// Where beats wait for each other.
pub(super) type Collected = Collector<Beats, Answer>;

pub(super) fn collect(writer: Arc<Writer>) -> Collected {
    Collector::start(writer, GROUP, WINDOW, |tx, group| Box::pin(renew_all(tx, group)))
}

impl Store {
    /// Renews the leases of a worker's attempts until `until`; the rows of the reply are in the order of the beats.
    pub(crate) async fn heartbeat(
        &self,
        worker: WorkerId,
        beats: Vec<Beat>,
        now: Timestamp,
        until: Timestamp,
    ) -> Result<Answer, StoreError> {
        self.beats.ask(Beats { worker, beats, now, until }).await
    }
}

/// Renews what the workers hold; the answers are in their order.
async fn renew_all(tx: &mut SqliteConnection, group: &[Arc<Beats>]) -> Result<Vec<Answer>, StoreError> {
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
async fn seen(
    tx: &mut SqliteConnection,
    group: &[Arc<Beats>],
) -> Result<HashMap<WorkerId, bool>, StoreError> {
    let workers: Vec<_> = group.iter().map(|beats| json!({"id": beats.worker, "at": beats.now.0})).collect();
    // Also to an earlier time: that of a clock which was set back.
    let sql = "UPDATE workers SET last_seen_at = seen.value ->> 'at' FROM json_each(?) AS seen
               WHERE workers.id = seen.value ->> 'id' RETURNING workers.id, draining";
    let rows = sqlx::query(sql).bind(to_json("workers", &workers)?).fetch_all(&mut *tx).await?;
    rows.iter().map(|row| Ok((row.parsed("id")?, row.column("draining")?))).collect()
}

/// What every beat of the group does, one after the other.
async fn effects(tx: &mut SqliteConnection, group: &[Arc<Beats>]) -> Result<Vec<BeatEffect>, StoreError> {
    let all = group.iter().flat_map(|beats| beats.beats.iter().map(move |beat| (beats, beat)));
    let (written, until): (Vec<_>, Vec<_>) = all
        .map(|(beats, beat)| {
            (Written { job: beat.job_id, attempt: beat.attempt, worker: beats.worker }, beats.until)
        })
        .unzip();
    let fenced = fenced(tx, &written).await?;
    let effect = |(fenced, until): (Result<Fenced, Refusal>, Timestamp)| match fenced {
        Ok(fenced) => on_beat(&fenced.job, fenced.standing, until),
        Err(_) => BeatEffect::Abandon,
    };
    Ok(fenced.into_iter().zip(until).map(effect).collect())
}

fn directive(beat: Beat, effect: BeatEffect) -> AttemptDirective {
    let (directive, lease_expires_at) = match effect {
        BeatEffect::Renew { until, cancel: false } => (Directive::Continue, Some(until)),
        BeatEffect::Renew { cancel: true, .. } => (Directive::Cancel, None),
        BeatEffect::Abandon => (Directive::Abandon, None),
    };
    AttemptDirective {
        job_id: beat.job_id,
        attempt: beat.attempt,
        directive,
        lease_expires_at,
        resend_samples: false,
    }
}
