//! Delivers the outbox to the server: short results together, everything else alone.

use std::collections::VecDeque;
use std::io;
use std::path::PathBuf;

use roost_api::lease::{AttemptResult, MAX_RESULTS, ResultsDelivery};
use tokio_util::sync::CancellationToken;
use tracing::Instrument;

use super::frames;
use super::session::Session;
use crate::backoff::Backoff;
use crate::client::ClientError;
use crate::outbox::{Content, Delivery, DeliveryOutcome};

/// Maximum length of results that go together, in bytes of their files. After a lost connection, at most this much is sent again.
const MAX_TOGETHER_BYTES: u64 = 1 << 20;

/// Stores a delivery in the outbox and wakes [`run`]. Where the disk cannot be written, sends it directly; repeats both until one succeeds.
pub(super) async fn store(session: &Session, mut delivery: Delivery) {
    let mut backoff = Backoff::default();
    loop {
        let (outbox, copy) = (session.outbox.clone(), delivery.clone());
        match on_disk(move || outbox.put(&copy)).await {
            Ok(_) => return session.outbox_changed.notify_one(),
            Err(error) => {
                tracing::error!(%error, folder = %session.config.state_dir.display(), "cannot write to the outbox");
                let key = (delivery.job_id, delivery.attempt);
                match delivery.send(&session.client).await {
                    Ok(_) => return session.attempts.remove(key),
                    Err(refusal) => {
                        if let Some(report) = delivery.clone().as_failure(&refusal) {
                            delivery = report;
                        }
                    }
                }
                backoff.pause().await;
            }
        }
    }
}

/// Delivers until the runs are over and the outbox is empty.
pub(super) async fn run(session: &Session, runs_over: &CancellationToken) {
    let mut backoff = Backoff::default();
    loop {
        // Read before the outbox: the delivery of the last run is in it by then.
        let is_last = runs_over.is_cancelled();
        match deliver_waiting(session).await {
            Ok(true) if is_last => return,
            Ok(true) => {
                backoff.reset();
                tokio::select! {
                    () = session.outbox_changed.notified() => {}
                    () = runs_over.cancelled() => {}
                }
            }
            Ok(false) => backoff.pause().await,
            Err(error) => {
                tracing::error!(%error, "cannot read the outbox");
                backoff.pause().await;
            }
        }
    }
}

/// Sends every waiting delivery once; returns whether the outbox is empty then.
pub(super) async fn deliver_waiting(session: &Session) -> io::Result<bool> {
    let outbox = session.outbox.clone();
    let mut paths = VecDeque::from(on_disk(move || outbox.waiting()).await?);
    // A pass ends its uploads after a failure: each upload has its turn to be the first.
    let first = session.uploads.failures() % paths.len().max(1);
    paths.rotate_left(first);
    let uploads = frames::Pass::default();
    let mut pass = OutboxPass { session, paths, uploads, is_empty: true, has_warned: false };
    while !pass.paths.is_empty() {
        let group = pass.next_group().await?;
        pass.send(group).await?;
    }
    Ok(pass.is_empty)
}

/// Whether a delivery goes in a request of its own: a failure report, or a result whose frames go first.
fn is_alone(delivery: &Delivery) -> bool {
    delivery.frames.is_some() || matches!(delivery.content, Content::Failure(_))
}

/// A delivery and its file in the outbox.
type Waiting = (PathBuf, Delivery);

/// One pass over the outbox.
struct OutboxPass<'s> {
    session: &'s Session,
    /// Files that this pass has yet to send.
    paths: VecDeque<PathBuf>,
    uploads: frames::Pass,
    /// Whether every delivery so far has left the outbox.
    is_empty: bool,
    has_warned: bool,
}

impl OutboxPass<'_> {
    /// The next deliveries: results that can go together, or one that goes alone. Frames are uploaded by then. The group may be empty.
    async fn next_group(&mut self) -> io::Result<Vec<Waiting>> {
        let (mut group, mut bytes) = (Vec::new(), 0);
        while group.len() < MAX_RESULTS
            && let Some(path) = self.paths.pop_front()
        {
            let length = tokio::fs::metadata(&path).await.map_or(0, |file| file.len());
            if !group.is_empty() && bytes + length > MAX_TOGETHER_BYTES {
                self.paths.push_front(path);
                break;
            }
            let (outbox, from) = (self.session.outbox.clone(), path.clone());
            let delivery = match on_disk(move || outbox.read(&from)).await {
                Ok(Some(delivery)) if group.is_empty() || !is_alone(&delivery) => delivery,
                Ok(None) => continue,
                // The others do not wait for it.
                Err(error) if group.is_empty() => {
                    tracing::error!(%error, path = %path.display(), "cannot read a delivery");
                    self.is_empty = false;
                    continue;
                }
                // The group goes first: this one goes alone, or cannot be read.
                Ok(Some(_)) | Err(_) => {
                    self.paths.push_front(path);
                    break;
                }
            };
            if !frames::upload(self.session, &delivery, &path, &mut self.uploads).await {
                self.is_empty = false;
                continue;
            }
            bytes += length;
            let is_alone = is_alone(&delivery);
            group.push((path, delivery));
            if is_alone {
                break;
            }
        }
        Ok(group)
    }

    /// Sends a group, and settles each delivery by its answer.
    async fn send(&mut self, mut group: Vec<Waiting>) -> io::Result<()> {
        if group.len() > 1 {
            let span = tracing::debug_span!("deliveries", results = group.len());
            match self.send_together(&group).instrument(span).await {
                Ok(answers) => {
                    for (waiting, answer) in group.drain(..).zip(answers) {
                        self.settle(waiting, answer).await?;
                    }
                }
                // More requests would not help now.
                Err(error) if error.is_overload() => {
                    self.keep(&error);
                    group.clear();
                }
                // One of them may be at fault, or a server or proxy may not know the route: one result must not hold back the others.
                Err(error) => tracing::debug!(%error, "results are delivered one by one"),
            }
        }
        for waiting in group {
            let delivery = &waiting.1;
            let span = tracing::debug_span!("delivery", job = %delivery.job_id, attempt = delivery.attempt);
            let answer = delivery.send(&self.session.client).instrument(span).await;
            self.settle(waiting, answer).await?;
        }
        Ok(())
    }

    /// Sends results in one request; returns the answers in their order.
    async fn send_together(
        &self,
        group: &[Waiting],
    ) -> Result<Vec<Result<DeliveryOutcome, ClientError>>, ClientError> {
        let result = |(_, delivery): &Waiting| match &delivery.content {
            Content::Result(body) => Some(AttemptResult {
                job_id: delivery.job_id,
                attempt: delivery.attempt,
                delivery: body.clone(),
            }),
            Content::Failure(_) => None,
        };
        let body = ResultsDelivery { results: group.iter().filter_map(result).collect() };
        for AttemptResult { job_id, attempt, .. } in &body.results {
            tracing::debug!(job = %job_id, attempt, "delivers a result");
        }
        let reply = self.session.client.deliver_results(&body).await?;
        let answered = reply.answers.iter().map(|answer| (answer.job_id, answer.attempt));
        if !answered.eq(body.results.iter().map(|result| (result.job_id, result.attempt))) {
            let reason = "the answers name other attempts than the request".to_owned();
            return Err(ClientError::Body { server: self.session.client.server().to_owned(), reason });
        }
        let answers = reply.answers.into_iter().zip(group).map(|(answer, (_, delivery))| {
            let refused = answer.problem.map(|problem| ClientError::Problem(Box::new(problem)));
            delivery.outcome(refused.map_or(Ok(()), Err))
        });
        Ok(answers.collect())
    }

    /// Removes a delivery from the outbox, sets it aside or leaves it there, by the server's answer.
    async fn settle(
        &mut self,
        (path, delivery): Waiting,
        answer: Result<DeliveryOutcome, ClientError>,
    ) -> io::Result<()> {
        let outbox = self.session.outbox.clone();
        match answer {
            Ok(_) => on_disk(move || outbox.remove(&path)).await?,
            Err(error) if error.is_transient() || error.is_access_refused() => {
                self.keep(&error);
                return Ok(());
            }
            Err(error) => {
                tracing::error!(job = %delivery.job_id, %error, "the server refuses a delivery, which goes to `refused`");
                if let Some(report) = delivery.clone().as_failure(&error) {
                    self.paths.push_front(on_disk(move || outbox.replace_refused(&path, &report)).await?);
                    return Ok(());
                }
                on_disk(move || outbox.set_aside(&path)).await?;
            }
        }
        let key = (delivery.job_id, delivery.attempt);
        self.session.uploads.forget(key);
        self.session.attempts.remove(key);
        Ok(())
    }

    /// Notes that a delivery stays in the outbox until the next pass.
    fn keep(&mut self, error: &ClientError) {
        self.is_empty = false;
        if error.is_transient() {
            tracing::debug!(%error, "delivery failed; the outbox keeps it");
        } else if !std::mem::replace(&mut self.has_warned, true) {
            tracing::warn!(%error, "the server refuses the token of this worker; deliveries wait in the outbox");
        }
    }
}

/// Runs file work outside the async threads, since an fsync can be slow.
async fn on_disk<T: Send + 'static>(work: impl FnOnce() -> io::Result<T> + Send + 'static) -> io::Result<T> {
    tokio::task::spawn_blocking(work).await.map_err(io::Error::other)?
}

#[cfg(test)]
mod tests;
