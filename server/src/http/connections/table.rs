//! The open connections: which of them closes when one more comes.
//!
//! A connection waits for a request head, answers a request, or writes the rest of an answer. When all places are taken, a new
//! connection gets the place of another one. The first to go is the oldest on which nothing was ever asked, unless these are few and about to ask; then the one that has
//! been idle longest; then the oldest whose client has still to read the end of an answer. So a flood of half requests or of
//! slow readers displaces itself. A displaced connection closes within a second, and few at once may still have to: the number of
//! open connections has a limit that no client can move.
//!
//! Connections on which nothing was ever asked have only a part of the places, since an honest client asks at once and each of
//! the others costs memory. Requests are answered on all but a few places, so that there always is a connection that waits; a
//! request beyond that is answered with 503. Workers have some of those last places to themselves, and the operator the rest.

use std::collections::BTreeMap;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

use super::streams::Streams;

/// One place of this many is kept for connections that wait, and for workers.
const SPARE: usize = 16;

/// One place of this many is kept for connections that wait, from workers too.
const SPARE_OF_WORKERS: usize = 32;

/// So many connections may always be on their way out.
const ALWAYS_TOLD: usize = 16;

/// Connections on which nothing was ever asked have one place of this many.
const UNASKED: usize = 4;

/// So many they may always be: honest clients that come at once are accepted before the first of them is asked.
const ALWAYS_UNASKED: usize = 256;

/// A full table is logged at most this often.
const LOG_EVERY: Duration = Duration::from_secs(60);

/// Answered on every place: who looks after the server must see why it refuses others.
const ALWAYS_ANSWERED: [&str; 2] = ["/healthz", "/metrics"];

/// Why a client had to go, as a label.
#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub(crate) struct Refused {
    reason: &'static str,
}

/// Whether workers ask for it: without them nothing goes on.
fn is_of_workers(path: &str) -> bool {
    matches!(path, "/v1/claims" | "/v1/workers")
        || path.starts_with("/v1/workers/") && path.ends_with("/heartbeat")
        || path.starts_with("/v1/jobs/") && path.contains("/attempts/")
}

/// A connection closed before anything was asked on it.
const NO_REQUEST: Refused = Refused { reason: "no_request" };
/// An idle connection closed.
const IDLE: Refused = Refused { reason: "idle" };
/// A connection closed before its client had read an answer to the end.
const UNREAD: Refused = Refused { reason: "unread" };
/// A request answered with 503.
const BUSY: Refused = Refused { reason: "busy" };
/// A connection closed at once, since no other could be.
const FULL: Refused = Refused { reason: "full" };

/// The open connections of a server.
pub(crate) struct Connections {
    limit: usize,
    table: Mutex<Table>,
    /// Wakes who waits for a displaced connection to close.
    closed: Notify,
    streams: Arc<Streams>,
    refused: Family<Refused, Counter>,
}

#[derive(Default)]
struct Table {
    open: usize,
    answering: usize,
    /// Those that were told to close, and have not yet.
    told: usize,
    /// Those on which nothing was ever asked, among those that wait.
    unasked: usize,
    /// Those that answer nothing and may be told to close.
    waiting: BTreeMap<Waiting, Arc<Leave>>,
    /// Number of waits so far.
    waits: u64,
    logged_at: Option<Instant>,
}

/// A connection that waits, in the order in which they give way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Waiting {
    rank: Rank,
    since: u64,
}

/// Why a connection waits; the first of them give way first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    /// Nothing was ever asked on it.
    Unasked,
    /// Its last answer is written.
    Idle,
    /// Its client has still to read some of an answer.
    Unread,
}

/// How a connection is told to close.
#[derive(Default)]
struct Leave {
    notify: Notify,
    /// Changes only while the table is locked.
    is_told: AtomicBool,
}

impl Leave {
    fn is_told(&self) -> bool {
        self.is_told.load(Ordering::Relaxed)
    }
}

#[derive(Clone, Copy)]
enum Standing {
    Waiting(Waiting),
    Answering,
}

/// The place of one connection.
pub(super) struct Place {
    connections: Arc<Connections>,
    /// Tells it to close.
    leave: Arc<Leave>,
    /// Changes only while the table is locked.
    standing: Mutex<Standing>,
}

/// The right to answer a request, until the answer is at its end.
pub(super) struct Turn(Arc<Place>);

/// A request is one too many.
pub(super) struct TooMany {
    /// Requests that are answered at once.
    pub(super) limit: usize,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Connections {
    /// Room for so many.
    pub(crate) fn new(limit: usize) -> Self {
        let refused = Family::<Refused, Counter>::default();
        // So that the first one is an increase.
        for reason in [NO_REQUEST, IDLE, UNREAD, BUSY, FULL] {
            drop(refused.get_or_create(&reason));
        }
        let limit = limit.max(2);
        let (closed, streams) = (Notify::new(), Arc::new(Streams::new(limit)));
        Self { limit, table: Mutex::default(), closed, streams, refused }
    }

    /// How many there may be.
    pub(crate) fn limit(&self) -> usize {
        self.limit
    }

    /// How many there are.
    pub(crate) fn open(&self) -> usize {
        locked(&self.table).open
    }

    /// Counts the clients that had to go.
    pub(crate) fn refused(&self) -> &Family<Refused, Counter> {
        &self.refused
    }

    /// The event streams among them.
    pub(crate) fn streams(&self) -> &Arc<Streams> {
        &self.streams
    }

    /// Requests that are answered at once, where one more asks for this path.
    fn max_answering(&self, path: &str) -> usize {
        if ALWAYS_ANSWERED.contains(&path) {
            return self.limit;
        }
        self.limit - self.limit.div_ceil(if is_of_workers(path) { SPARE_OF_WORKERS } else { SPARE })
    }

    /// Connections that may be there without a request.
    fn max_unasked(&self) -> usize {
        (self.limit / UNASKED).max(ALWAYS_UNASKED)
    }

    /// Connections that may be open beyond the limit, since they were told to close.
    fn max_told(&self) -> usize {
        (self.limit / SPARE).max(ALWAYS_TOLD)
    }

    /// Returns when the displaced connections that are still open are few.
    pub(super) async fn settled(&self) {
        while locked(&self.table).told >= self.max_told() {
            self.closed.notified().await;
        }
    }

    /// A place for one more connection; none when no other can give way.
    pub(super) fn enter(self: &Arc<Self>) -> Option<Arc<Place>> {
        let mut table = locked(&self.table);
        if table.open - table.told >= self.limit || table.unasked >= self.max_unasked() {
            let (limit, unasked) = (self.limit, table.unasked);
            let has_closed = self.close_one(&mut table, |open| {
                tracing::warn!(
                    open,
                    limit,
                    unasked,
                    "too many connections: those that wait longest are closed"
                );
            });
            if !has_closed {
                self.refused.get_or_create(&FULL).inc();
                return None;
            }
        }
        table.open += 1;
        let leave = Arc::<Leave>::default();
        let standing = Mutex::new(Standing::Waiting(table.wait(Rank::Unasked, leave.clone())));
        Some(Arc::new(Place { connections: self.clone(), leave, standing }))
    }

    /// Closes a connection that waits, since no other can be accepted.
    pub(super) fn make_room(&self, error: &io::Error) {
        self.close_one(&mut locked(&self.table), |open| {
            tracing::warn!(%error, open, "no connection can be accepted: those that wait longest are closed");
        });
    }

    /// Closes the first of those that wait, if any does.
    fn close_one(&self, table: &mut Table, log: impl FnOnce(usize)) -> bool {
        if table.logged_at.is_none_or(|then| then.elapsed() > LOG_EVERY) {
            table.logged_at = Some(Instant::now());
            log(table.open);
        }
        if table.told >= self.max_told() {
            return false;
        }
        let asked = Waiting { rank: Rank::Idle, since: 0 };
        // The newest few are about to ask: without this a flood of idle or slow clients displaces each honest newcomer.
        let asked =
            (table.unasked <= self.limit / SPARE).then(|| table.waiting.range(asked..).next()).flatten();
        let Some(waiting) = asked.or_else(|| table.waiting.first_key_value()).map(|(waiting, _)| *waiting)
        else {
            return false;
        };
        let Some(leave) = table.waiting.remove(&waiting) else { return false };
        table.told += 1;
        leave.is_told.store(true, Ordering::Relaxed);
        table.unasked -= usize::from(waiting.rank == Rank::Unasked);
        let reason = match waiting.rank {
            Rank::Unasked => &NO_REQUEST,
            Rank::Idle => &IDLE,
            Rank::Unread => &UNREAD,
        };
        self.refused.get_or_create(reason).inc();
        leave.notify.notify_one();
        true
    }
}

impl Table {
    fn wait(&mut self, rank: Rank, leave: Arc<Leave>) -> Waiting {
        self.waits += 1;
        let waiting = Waiting { rank, since: self.waits };
        // Once told to close, it has no other place to give away.
        if !leave.is_told() {
            self.waiting.insert(waiting, leave);
            self.unasked += usize::from(rank == Rank::Unasked);
        }
        waiting
    }

    /// Notes that it waits no longer, unless it was told to leave before.
    fn forget(&mut self, waiting: Waiting) {
        if self.waiting.remove(&waiting).is_some() {
            self.unasked -= usize::from(waiting.rank == Rank::Unasked);
        }
    }
}

impl Place {
    /// A request head has arrived. Drop the turn when the answer is at its end.
    pub(super) fn begin(self: &Arc<Self>, path: &str) -> Result<Turn, TooMany> {
        let connections = &self.connections;
        let mut table = locked(&connections.table);
        let mut standing = locked(&self.standing);
        if let Standing::Waiting(waiting) = *standing {
            table.forget(waiting);
            table.answering += 1;
            *standing = Standing::Answering;
        }
        let limit = connections.max_answering(path);
        if table.answering > limit {
            connections.refused.get_or_create(&BUSY).inc();
            return Err(TooMany { limit });
        }
        Ok(Turn(self.clone()))
    }

    /// All of the answers so far has been written.
    pub(super) fn note_written(&self) {
        // Seldom true, and asked on every flush: the table is not locked for it.
        if self.is_unread() {
            let mut table = locked(&self.connections.table);
            let mut standing = locked(&self.standing);
            if let Standing::Waiting(waiting @ Waiting { rank: Rank::Unread, .. }) = *standing {
                table.forget(waiting);
                *standing = Standing::Waiting(table.wait(Rank::Idle, self.leave.clone()));
            }
        }
    }

    /// Why it waits; none while it answers.
    fn rank(&self) -> Option<Rank> {
        match *locked(&self.standing) {
            Standing::Waiting(waiting) => Some(waiting.rank),
            Standing::Answering => None,
        }
    }

    /// Whether a request has ever arrived on it.
    pub(super) fn has_asked(&self) -> bool {
        self.rank() != Some(Rank::Unasked)
    }

    /// Whether its client has still to read some of an answer that is at its end.
    pub(super) fn is_unread(&self) -> bool {
        self.rank() == Some(Rank::Unread)
    }

    /// Returns when the connection shall end, and whether another one takes its place.
    pub(super) async fn leaves(&self, stop: &CancellationToken) -> bool {
        stop.run_until_cancelled(self.leave.notify.notified()).await.is_some()
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        let place = &self.0;
        let mut table = locked(&place.connections.table);
        let mut standing = locked(&place.standing);
        table.answering -= 1;
        *standing = Standing::Waiting(table.wait(Rank::Unread, place.leave.clone()));
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut table = locked(&self.connections.table);
        table.open -= 1;
        if self.leave.is_told() {
            table.told -= 1;
            self.connections.closed.notify_one();
        }
        match *locked(&self.standing) {
            Standing::Waiting(waiting) => table.forget(waiting),
            // A request that was one too many.
            Standing::Answering => table.answering -= 1,
        }
    }
}

#[cfg(test)]
mod tests;
