//! The open connections: which of them closes when one more comes.
//!
//! A connection waits for a request head, answers a request, or writes the rest of an answer. When all slots
//! are taken, a new connection displaces another one, in this order:
//!
//! 1. the oldest connection without any request, unless these are few and about to send one;
//! 2. the connection that has been idle longest;
//! 3. the oldest connection whose client has not read an answer to its end.
//!
//! A flood of half requests or of slow readers therefore displaces itself. A displaced connection closes
//! within a second. The number of those that are still closing is limited, so no client can raise the number
//! of open connections.
//!
//! Connections without a request have a part of the slots only: an honest client sends its request at once,
//! and each of the others costs memory. A few slots never answer, so that a connection to displace always
//! exists; a request beyond them is answered with 503. Some of those last slots are reserved for workers, and
//! the rest for the operator.

mod streams;

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

pub(crate) use streams::StreamSlot;
use streams::StreamSlots;

/// One slot of this many is reserved for connections that wait, and for workers.
const RESERVED_SHARE: usize = 16;

/// One slot of this many is reserved for connections that wait, even against workers.
const RESERVED_SHARE_FOR_WORKERS: usize = 32;

/// Minimum of the number of displaced connections that may still be open.
const MIN_CLOSING: usize = 16;

/// Connections without a request may take one slot of this many.
const WITHOUT_REQUEST_SHARE: usize = 4;

/// Minimum of that number: honest clients that connect together are accepted before the first request arrives.
const MIN_WITHOUT_REQUEST: usize = 256;

/// Minimum time between two log lines about a full table.
const LOG_EVERY: Duration = Duration::from_secs(60);

/// Paths that are answered on every slot: an operator must see why the server refuses others.
const ALWAYS_ALLOWED: [&str; 2] = ["/healthz", "/metrics"];

/// Why a client was refused, as a label.
#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub(crate) struct Refused {
    reason: &'static str,
}

/// Whether workers send requests to this path.
fn is_worker_path(path: &str) -> bool {
    matches!(path, "/v1/claims" | "/v1/results" | "/v1/workers")
        || path.starts_with("/v1/workers/") && path.ends_with("/heartbeat")
        || path.starts_with("/v1/jobs/") && path.contains("/attempts/")
}

/// A connection was closed before its first request.
const NO_REQUEST: Refused = Refused { reason: "no_request" };
/// An idle connection was closed.
const IDLE: Refused = Refused { reason: "idle" };
/// A connection was closed before its client had read an answer to its end.
const UNREAD: Refused = Refused { reason: "unread" };
/// A request was answered with 503.
const BUSY: Refused = Refused { reason: "busy" };
/// A new connection was closed at once, since no other could be displaced.
const FULL: Refused = Refused { reason: "full" };

/// The open connections of a server.
pub(crate) struct Connections {
    limit: usize,
    table: Mutex<Table>,
    /// Wakes the accept loop when a displaced connection has closed.
    closed: Notify,
    streams: Arc<StreamSlots>,
    refused: Family<Refused, Counter>,
}

#[derive(Default)]
struct Table {
    open: usize,
    answering: usize,
    /// Displaced connections that are still open.
    closing: usize,
    /// Connections in `waiting` without a request.
    without_request: usize,
    /// Connections that answer nothing and may be displaced.
    waiting: BTreeMap<WaitKey, Arc<CloseSignal>>,
    /// Number of wait keys made so far.
    waits: u64,
    logged_at: Option<Instant>,
}

/// Key of a connection that waits; the first key is displaced first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct WaitKey {
    rank: Rank,
    since: u64,
}

/// Why a connection waits; the first of them is displaced first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    /// No request has arrived on it.
    NoRequest,
    /// Its last answer is written.
    Idle,
    /// Its client has not read an answer to its end.
    Unread,
}

/// Asks one connection to close.
#[derive(Default)]
struct CloseSignal {
    notify: Notify,
    /// Changes only while the table is locked.
    is_closing: AtomicBool,
}

impl CloseSignal {
    fn is_closing(&self) -> bool {
        self.is_closing.load(Ordering::Relaxed)
    }
}

#[derive(Clone, Copy)]
enum SlotState {
    Waiting(WaitKey),
    Answering,
}

/// The slot of one connection.
pub(crate) struct ConnectionSlot {
    connections: Arc<Connections>,
    /// Asks it to close.
    close: Arc<CloseSignal>,
    /// Changes only while the table is locked.
    state: Mutex<SlotState>,
}

/// The permit to answer a request; dropped at the end of the answer.
pub(crate) struct AnswerPermit(Arc<ConnectionSlot>);

/// The server answers too many requests.
pub(crate) struct Busy {
    /// Maximum of requests that are answered at once.
    pub(crate) limit: usize,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Connections {
    /// A table of `limit` slots.
    pub(crate) fn new(limit: usize) -> Self {
        let refused = Family::<Refused, Counter>::default();
        // Creates every label, so that the first event already shows as an increase.
        for reason in [NO_REQUEST, IDLE, UNREAD, BUSY, FULL] {
            drop(refused.get_or_create(&reason));
        }
        let limit = limit.max(2);
        let (closed, streams) = (Notify::new(), Arc::new(StreamSlots::new(limit)));
        Self { limit, table: Mutex::default(), closed, streams, refused }
    }

    /// Maximum number of connections.
    pub(crate) fn limit(&self) -> usize {
        self.limit
    }

    /// Number of open connections.
    pub(crate) fn open(&self) -> usize {
        locked(&self.table).open
    }

    /// Counter of refused clients.
    pub(crate) fn refused(&self) -> &Family<Refused, Counter> {
        &self.refused
    }

    /// Slots of event streams.
    pub(crate) fn streams(&self) -> &Arc<StreamSlots> {
        &self.streams
    }

    /// Maximum of requests that are answered at once, for a request to this path.
    fn max_answering(&self, path: &str) -> usize {
        if ALWAYS_ALLOWED.contains(&path) {
            return self.limit;
        }
        self.limit
            - self.limit.div_ceil(if is_worker_path(path) {
                RESERVED_SHARE_FOR_WORKERS
            } else {
                RESERVED_SHARE
            })
    }

    /// Maximum of connections without a request.
    fn max_without_request(&self) -> usize {
        (self.limit / WITHOUT_REQUEST_SHARE).max(MIN_WITHOUT_REQUEST)
    }

    /// Maximum of displaced connections that are still open; they are not part of `limit`.
    fn max_closing(&self) -> usize {
        (self.limit / RESERVED_SHARE).max(MIN_CLOSING)
    }

    /// Waits until few displaced connections are still open.
    pub(crate) async fn wait_for_closing(&self) {
        while locked(&self.table).closing >= self.max_closing() {
            self.closed.notified().await;
        }
    }

    /// A slot for a new connection; none if no other connection can be displaced.
    pub(crate) fn enter(self: &Arc<Self>) -> Option<Arc<ConnectionSlot>> {
        let mut table = locked(&self.table);
        if table.open - table.closing >= self.limit || table.without_request >= self.max_without_request() {
            let (limit, without_request) = (self.limit, table.without_request);
            let has_closed = self.displace(&mut table, |open| {
                tracing::warn!(
                    open,
                    limit,
                    without_request,
                    "too many connections: those that have waited longest are closed"
                );
            });
            if !has_closed {
                self.refused.get_or_create(&FULL).inc();
                return None;
            }
        }
        table.open += 1;
        let close = Arc::<CloseSignal>::default();
        let state = Mutex::new(SlotState::Waiting(table.wait(Rank::NoRequest, close.clone())));
        Some(Arc::new(ConnectionSlot { connections: self.clone(), close, state }))
    }

    /// Displaces a connection, since no new one can be accepted.
    pub(crate) fn displace_one(&self, error: &io::Error) {
        self.displace(&mut locked(&self.table), |open| {
            tracing::warn!(%error, open, "no connection can be accepted: those that have waited longest are closed");
        });
    }

    /// Displaces the first connection that waits; false if none does.
    fn displace(&self, table: &mut Table, log: impl FnOnce(usize)) -> bool {
        if table.logged_at.is_none_or(|then| then.elapsed() > LOG_EVERY) {
            table.logged_at = Some(Instant::now());
            log(table.open);
        }
        if table.closing >= self.max_closing() {
            return false;
        }
        let with_request = WaitKey { rank: Rank::Idle, since: 0 };
        // The newest few are about to send a request. Otherwise a flood of idle or slow clients would
        // displace every honest newcomer.
        let with_request = (table.without_request <= self.limit / RESERVED_SHARE)
            .then(|| table.waiting.range(with_request..).next())
            .flatten();
        let Some(key) = with_request.or_else(|| table.waiting.first_key_value()).map(|(key, _)| *key) else {
            return false;
        };
        let Some(close) = table.waiting.remove(&key) else { return false };
        table.closing += 1;
        close.is_closing.store(true, Ordering::Relaxed);
        table.without_request -= usize::from(key.rank == Rank::NoRequest);
        let reason = match key.rank {
            Rank::NoRequest => &NO_REQUEST,
            Rank::Idle => &IDLE,
            Rank::Unread => &UNREAD,
        };
        self.refused.get_or_create(reason).inc();
        close.notify.notify_one();
        true
    }
}

impl Table {
    fn wait(&mut self, rank: Rank, close: Arc<CloseSignal>) -> WaitKey {
        self.waits += 1;
        let key = WaitKey { rank, since: self.waits };
        // A connection that was asked to close cannot be displaced again.
        if !close.is_closing() {
            self.waiting.insert(key, close);
            self.without_request += usize::from(rank == Rank::NoRequest);
        }
        key
    }

    /// Removes a connection that no longer waits, unless it was displaced before.
    fn forget(&mut self, key: WaitKey) {
        if self.waiting.remove(&key).is_some() {
            self.without_request -= usize::from(key.rank == Rank::NoRequest);
        }
    }
}

impl ConnectionSlot {
    /// Starts the answer to a request head that has arrived. Drop the permit at the end of the answer.
    pub(crate) fn begin(self: &Arc<Self>, path: &str) -> Result<AnswerPermit, Busy> {
        let connections = &self.connections;
        let mut table = locked(&connections.table);
        let mut state = locked(&self.state);
        if let SlotState::Waiting(key) = *state {
            table.forget(key);
            table.answering += 1;
            *state = SlotState::Answering;
        }
        let limit = connections.max_answering(path);
        if table.answering > limit {
            connections.refused.get_or_create(&BUSY).inc();
            return Err(Busy { limit });
        }
        Ok(AnswerPermit(self.clone()))
    }

    /// Notes that all answers so far are written.
    pub(crate) fn note_written(&self) {
        // Rarely true, and called on every flush: lock the table only then.
        if self.is_unread() {
            let mut table = locked(&self.connections.table);
            let mut state = locked(&self.state);
            if let SlotState::Waiting(key @ WaitKey { rank: Rank::Unread, .. }) = *state {
                table.forget(key);
                *state = SlotState::Waiting(table.wait(Rank::Idle, self.close.clone()));
            }
        }
    }

    /// Why the connection waits; none while it answers.
    fn rank(&self) -> Option<Rank> {
        match *locked(&self.state) {
            SlotState::Waiting(key) => Some(key.rank),
            SlotState::Answering => None,
        }
    }

    /// Whether a request has arrived on the connection.
    pub(crate) fn has_had_request(&self) -> bool {
        self.rank() != Some(Rank::NoRequest)
    }

    /// Whether the client has not yet read an answer to its end.
    pub(crate) fn is_unread(&self) -> bool {
        self.rank() == Some(Rank::Unread)
    }

    /// Waits until the connection shall close; true if another connection displaces it.
    pub(crate) async fn wait_for_close(&self, stop: &CancellationToken) -> bool {
        stop.run_until_cancelled(self.close.notify.notified()).await.is_some()
    }
}

impl Drop for AnswerPermit {
    fn drop(&mut self) {
        let slot = &self.0;
        let mut table = locked(&slot.connections.table);
        let mut state = locked(&slot.state);
        table.answering -= 1;
        *state = SlotState::Waiting(table.wait(Rank::Unread, slot.close.clone()));
    }
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        let mut table = locked(&self.connections.table);
        table.open -= 1;
        if self.close.is_closing() {
            table.closing -= 1;
            self.connections.closed.notify_one();
        }
        match *locked(&self.state) {
            SlotState::Waiting(key) => table.forget(key),
            // The request was refused as one too many.
            SlotState::Answering => table.answering -= 1,
        }
    }
}

#[cfg(test)]
mod tests;
