//! Event streams: what happens to a sweep's jobs or to one job, as it happens.
//!
//! A stream begins with what there is now (`sweep` or `job`), then has an event `change` for everything that happens, whose id
//! `Last-Event-ID` resumes after, and of a sweep `extended` when it has grown and `deleted`, which is the last. Between them come `progress` events, without an id: the next one says it all again; and of a
//! job `samples`, what it has sampled since. A stream ends
//! with the server, at once, and with the token that it was asked for with.

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

use super::access::Caller;
use super::connections::StreamPlace;
use super::extract::Segments;
use super::problem::{ApiError, Kind};
use super::{jobs, sweeps};
use crate::app::App;
use crate::queue::Refusal;
use crate::samples::Followed;
use crate::store::Subject;

/// Looks no more often than this, however much happens.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// What happens to the jobs of a sweep, from now on or from after `Last-Event-ID`.
#[utoipa::path(get, path = "/v1/sweeps/{id}/events", tag = "sweeps", operation_id = "sweep_events",
    params(("id" = uuid::Uuid, Path, description = "The sweep"),
           ("Last-Event-ID" = Option<i64>, Header, description = "Go on after this event")),
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
    streamed(app, Subject::Sweep(id), caller, &headers).await
}

/// What happens to a job, from now on or from after `Last-Event-ID`.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", tag = "jobs", operation_id = "job_events",
    params(("id" = uuid::Uuid, Path, description = "The job"),
           ("Last-Event-ID" = Option<i64>, Header, description = "Go on after this event")),
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
    streamed(app, Subject::Job(id), caller, &headers).await
}

/// Points and replicates of a sweep.
type Size = (u32, u32);

struct Following {
    app: App,
    subject: Subject,
    /// Who follows.
    caller: Caller,
    _place: StreamPlace,
    /// The newest event that was sent.
    last: i64,
    /// Whether what there is now is still to be sent.
    fresh: bool,
    progress: u64,
    /// Whether the sweep has come further than was told.
    behind: bool,
    /// Version of the subject when its size was looked at last, and that size.
    seen: Option<(Option<String>, Option<Size>)>,
    /// What of a running job's samples was sent.
    followed: Vec<Followed>,
    /// Whether there is nothing more to follow.
    over: bool,
    ready: VecDeque<Event>,
}

async fn streamed(
    app: App,
    subject: Subject,
    caller: Option<Extension<Caller>>,
    headers: &HeaderMap,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>> + use<>>, ApiError> {
    let caller = caller.map(|Extension(caller)| caller).unwrap_or_default();
    let streams = app.connections.streams();
    let place = streams.enter(&caller.0).ok_or_else(|| {
        let max = streams.max();
        let detail = format!(
            "this token has {max} event streams open, the maximum: close one, or poll with `if-none-match`"
        );
        ApiError::new(Kind::TooManyRequests, detail)
    })?;
    let (oldest, newest) = app.store.event_range().await?;
    let asked = match headers.get("last-event-id").map(|value| value.to_str().ok()?.parse::<i64>().ok()) {
        Some(None) => {
            return Err(ApiError::new(Kind::InvalidQuery, "Last-Event-ID is no id of an event of ours"));
        }
        Some(Some(id)) => Some(id).filter(|id| (oldest - 1..=newest).contains(id)),
        None => None,
    };
    let progress = app.progress.version(subject);
    let following = Following {
        app,
        subject,
        caller,
        _place: place,
        last: asked.unwrap_or(newest),
        fresh: asked.is_none(),
        progress,
        behind: false,
        seen: None,
        followed: Vec::new(),
        over: false,
        ready: VecDeque::new(),
    };
    let events = stream::unfold(following, |mut following| async move {
        let event = following.next().await?;
        Some((Ok(event), following))
    });
    Ok(Sse::new(events).keep_alive(KeepAlive::new().interval(Duration::from_secs(15))))
}

impl Following {
    /// The next event; none when the server stops, or the token of who follows is revoked.
    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.ready.pop_front() {
                return Some(event);
            }
            if self.over || self.app.shutdown.is_cancelled() || !self.app.access.knows(&self.caller) {
                return None;
            }
            if let Err(error) = self.look().await {
                tracing::warn!(?error, "an event stream ends");
                return None;
            }
            if self.ready.is_empty() {
                self.app.shutdown.clone().run_until_cancelled(tokio::time::sleep(LOOK_EVERY)).await?;
            }
        }
    }

    async fn look(&mut self) -> Result<(), ApiError> {
        self.look_at_size().await?;
        if self.over {
            return Ok(());
        }
        if std::mem::take(&mut self.fresh) {
            let now = self.now(if matches!(self.subject, Subject::Job(_)) { "job" } else { "sweep" }).await?;
            self.ready.push_back(now.id(self.last.to_string()));
            return Ok(());
        }
        let happened = self.app.store.events(self.subject, self.last).await?;
        for (id, event) in happened {
            self.last = id;
            self.ready.push_back(data("change", &event)?.id(id.to_string()));
        }
        let progress = self.app.progress.version(self.subject);
        if progress != self.progress || !self.ready.is_empty() || self.behind {
            self.progress = progress;
            let now = self.progress().await?;
            self.ready.push_back(now);
        }
        if let Subject::Job(id) = self.subject {
            let series = self.app.progress.news(id, &mut self.followed);
            if !series.is_empty() {
                self.ready.push_back(data("samples", &json!({"job_id": id, "series": series}))?);
            }
        }
        Ok(())
    }

    /// Tells when a sweep has grown or has been deleted, which is no change of a job.
    async fn look_at_size(&mut self) -> Result<(), ApiError> {
        let Subject::Sweep(id) = self.subject else { return Ok(()) };
        let version = self.app.store.version(self.subject).await?;
        let before = match &self.seen {
            Some((seen, _)) if *seen == version => return Ok(()),
            Some((_, size)) => *size,
            None => None,
        };
        let size = self.app.store.sweep_size(id).await?;
        self.seen = Some((version, size));
        match (before, size) {
            (_, None) => {
                self.ready.push_back(data("deleted", &json!({"id": id}))?);
                self.over = true;
            }
            (Some(before), Some(size)) if before != size => {
                let now = self.now("extended").await?;
                self.ready.push_back(now);
            }
            _ => {}
        }
        Ok(())
    }

    /// How far it has come. All who follow a sweep share a view, which is told again when it is out of date.
    async fn progress(&mut self) -> Result<Event, ApiError> {
        let Subject::Sweep(id) = self.subject else { return self.now("progress").await };
        let (view, is_newest) = sweeps::lately(&self.app, id, LOOK_EVERY).await?;
        self.behind = !is_newest;
        data::<SweepView>("progress", &view)
    }

    async fn now(&self, name: &str) -> Result<Event, ApiError> {
        match self.subject {
            Subject::Job(id) => data::<JobView>(name, &jobs::view(&self.app, id).await?),
            Subject::Sweep(id) => data::<SweepView>(name, &sweeps::view(&self.app, id).await?),
            _ => Err(ApiError::new(Kind::Internal, "nothing to follow")),
        }
    }
}

fn data<T: Serialize>(name: &str, value: &T) -> Result<Event, ApiError> {
    let event = Event::default().event(name).json_data(value);
    event.map_err(|error| ApiError::new(Kind::Internal, error.to_string()))
}
