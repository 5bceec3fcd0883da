//! Event streams of the jobs of a sweep, or of one job.
//!
//! | event | content |
//! |---|---|
//! | `sweep`, `job` | the current view; the first event unless `Last-Event-ID` resumes a stream |
//! | `change` | a change of a job; its id resumes the stream after it |
//! | `extended`, `deleted` | the sweep was extended or deleted; `deleted` is the last event |
//! | `progress` | the view with new progress; no id, since the next event repeats it |
//! | `samples` | new samples of a running job at simulated times, and the simulated time of t = 0 once known |
//!
//! A stream ends with the server, and when its token is revoked.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::time::Duration;

use axum::Extension;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::sse::{Event, KeepAlive, Sse};
use futures_util::{Stream, stream};
use roost_api::ids::{JobId, SweepId};
use roost_api::job::JobView;
use roost_api::problem::Problem;
use roost_api::sweep::SweepView;
use serde::Serialize;
use serde_json::json;
use tokio::time::{Instant, sleep_until};

use super::extract::Segments;
use super::problem::{ApiError, ProblemKind};
use super::{jobs, sweeps};
use crate::queue::Refusal;
use crate::state::connections::StreamSlot;
use crate::state::{App, Caller, Received};
use crate::store::{EVENTS_AT_ONCE, Subject};

/// Interval between two polls for new events.
const POLL_EVERY: Duration = Duration::from_millis(250);

/// Streams events of the jobs of a sweep, from now on or from after `Last-Event-ID`.
#[utoipa::path(get, path = "/v1/sweeps/{id}/events", tag = "sweeps", operation_id = "sweep_events",
    params(("id" = uuid::Uuid, Path, description = "The sweep"),
           ("Last-Event-ID" = Option<i64>, Header, description = "Resume after this event")),
    responses((status = 200, description = "Server-sent events", body = String, content_type = "text/event-stream"),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn of_sweep(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    caller: Option<Extension<Caller>>,
    headers: HeaderMap,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, ApiError> {
    app.store.sweep_size(id).await?.ok_or(Refusal::NoSweep)?;
    stream_events(app, Subject::Sweep(id), caller, &headers).await
}

/// Streams events of a job, from now on or from after `Last-Event-ID`.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", tag = "jobs", operation_id = "job_events",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("Last-Event-ID" = Option<i64>, Header, description = "Resume after this event")),
    responses((status = 200, description = "Server-sent events", body = String, content_type = "text/event-stream"),
              (status = 404, description = "No such job", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn of_job(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
    caller: Option<Extension<Caller>>,
    headers: HeaderMap,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, ApiError> {
    jobs::view(&app, id).await?;
    stream_events(app, Subject::Job(id), caller, &headers).await
}

/// Points and replicates of a sweep.
type Size = (u32, u32);

/// A client that follows a subject.
struct Follower {
    app: App,
    subject: Subject,
    caller: Caller,
    _slot: StreamSlot,
    /// The newest event that was sent.
    last: i64,
    /// Whether the current view is still to be sent.
    is_new: bool,
    /// The progress version that was sent.
    progress: u64,
    /// Whether the client may have an outdated view: its last progress event was not the newest, or it resumes.
    is_behind: bool,
    /// Version of the subject at the last size check, and that size.
    checked_size: Option<(Option<String>, Option<Size>)>,
    /// Samples that were sent.
    received: Received,
    /// Whether the subject was deleted.
    is_over: bool,
    /// Events to send.
    ready: VecDeque<Event>,
    /// Time of the next look for events.
    next_poll: Instant,
}

async fn stream_events(
    app: App,
    subject: Subject,
    caller: Option<Extension<Caller>>,
    headers: &HeaderMap,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>> + use<>>, ApiError> {
    let caller = caller.map(|Extension(caller)| caller).unwrap_or_default();
    let streams = app.connections.streams();
    let slot = streams.enter(&caller.token).ok_or_else(|| {
        let max = streams.max();
        let detail = format!(
            "this token has {max} open event streams, which is the maximum: close one, or poll with `if-none-match`"
        );
        ApiError::new(ProblemKind::TooManyRequests, detail)
    })?;
    let (oldest, newest) = app.store.event_range().await?;
    let resume_after =
        match headers.get("last-event-id").map(|value| value.to_str().ok()?.parse::<i64>().ok()) {
            Some(None) => {
                return Err(ApiError::new(
                    ProblemKind::InvalidQuery,
                    "Last-Event-ID must be the id of an event of this server",
                ));
            }
            Some(Some(id)) => Some(id).filter(|id| (oldest - 1..=newest).contains(id)),
            None => None,
        };
    let progress = app.progress.version(subject);
    let follower = Follower {
        app,
        subject,
        caller,
        _slot: slot,
        last: resume_after.unwrap_or(newest),
        is_new: resume_after.is_none(),
        progress,
        // The stream may have ended between an event and the view after it.
        is_behind: resume_after.is_some(),
        checked_size: None,
        received: Received::default(),
        is_over: false,
        ready: VecDeque::new(),
        next_poll: Instant::now(),
    };
    let events = stream::unfold(follower, |mut follower| async move {
        let event = follower.next().await?;
        Some((Ok(event), follower))
    });
    Ok(Sse::new(events).keep_alive(KeepAlive::new().interval(Duration::from_secs(15))))
}

impl Follower {
    /// The next event; none when the server stops or the token is revoked.
    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.ready.pop_front() {
                return Some(event);
            }
            if self.is_over {
                return None;
            }
            // Also after events: an outdated view would be sent again at once.
            self.app.shutdown.clone().run_until_cancelled(sleep_until(self.next_poll)).await?;
            if self.app.shutdown.is_cancelled() || !self.app.access.still_admits(&self.caller) {
                return None;
            }
            self.next_poll = Instant::now() + POLL_EVERY;
            if let Err(error) = self.poll().await {
                tracing::warn!(?error, "an event stream ends");
                return None;
            }
        }
    }

    /// Collects new events.
    async fn poll(&mut self) -> Result<(), ApiError> {
        self.check_size().await?;
        if self.is_over {
            return Ok(());
        }
        if std::mem::take(&mut self.is_new) {
            let view =
                self.view(if matches!(self.subject, Subject::Job(_)) { "job" } else { "sweep" }).await?;
            self.ready.push_back(view.id(self.last.to_string()));
            return Ok(());
        }
        let events = self.app.store.events(self.subject, self.last).await?;
        let has_more = events.len() == EVENTS_AT_ONCE;
        if has_more {
            self.next_poll = Instant::now();
        }
        for (id, event) in events {
            self.last = id;
            self.ready.push_back(data("change", &event)?.id(id.to_string()));
        }
        let progress = self.app.progress.version(self.subject);
        if has_more {
            self.is_behind = true;
        } else if progress != self.progress || !self.ready.is_empty() || self.is_behind {
            self.progress = progress;
            let progress = self.progress_event().await?;
            self.ready.push_back(progress);
        }
        if let Subject::Job(id) = self.subject
            && let Some((t0_s, series)) = self.app.progress.next_samples(id, &mut self.received)
        {
            // A long series comes in parts.
            self.next_poll = Instant::now();
            self.ready.push_back(data("samples", &json!({"job_id": id, "t0_s": t0_s, "series": series}))?);
        }
        Ok(())
    }

    /// Adds the events of a sweep that was extended or deleted, which are no changes of jobs.
    async fn check_size(&mut self) -> Result<(), ApiError> {
        let Subject::Sweep(id) = self.subject else { return Ok(()) };
        let version = self.app.store.version(self.subject).await?;
        let before = match &self.checked_size {
            Some((checked, _)) if *checked == version => return Ok(()),
            Some((_, size)) => *size,
            None => None,
        };
        let size = self.app.store.sweep_size(id).await?;
        self.checked_size = Some((version, size));
        match (before, size) {
            (_, None) => {
                self.ready.push_back(data("deleted", &json!({"id": id}))?);
                self.is_over = true;
            }
            (Some(before), Some(size)) if before != size => {
                let view = self.view("extended").await?;
                self.ready.push_back(view);
            }
            _ => {}
        }
        Ok(())
    }

    /// The progress of the subject. Followers of a sweep share a view; an outdated one is sent again later.
    async fn progress_event(&mut self) -> Result<Event, ApiError> {
        let Subject::Sweep(id) = self.subject else {
            self.is_behind = false;
            return self.view("progress").await;
        };
        let (view, is_newest) = sweeps::recent_view(&self.app, id, POLL_EVERY).await?;
        self.is_behind = !is_newest;
        data::<SweepView>("progress", &view)
    }

    /// The current view of the subject.
    async fn view(&self, name: &str) -> Result<Event, ApiError> {
        match self.subject {
            Subject::Job(id) => data::<JobView>(name, &jobs::view_with_reason(&self.app, id).await?),
            Subject::Sweep(id) => data::<SweepView>(name, &sweeps::view(&self.app, id).await?),
            _ => Err(ApiError::new(ProblemKind::Internal, "the subject has no events")),
        }
    }
}

fn data<T: Serialize>(name: &str, value: &T) -> Result<Event, ApiError> {
    let event = Event::default().event(name).json_data(value);
    event.map_err(|error| ApiError::new(ProblemKind::Internal, error.to_string()))
}
