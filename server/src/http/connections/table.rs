//! The open connections: which of them closes when one more comes.
//!
//! A connection waits for a request head or answers a request. When all places are taken, a new connection gets the place of
//! one that waits: first of those on which nothing was ever asked, the one that has waited longest; then of the others, the
//! one that has been idle longest. So a flood of half requests displaces itself, and workers and pages keep their
//! connections. Connections on which nothing was ever asked have only a part of the places, since an honest client asks at
//! once and each of the others costs memory. Requests are answered on all but a few places, so that there always is a connection that waits; a request
//! beyond that is answered with 503.

use std::collections::BTreeMap;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

/// One place of this many is kept for connections that wait.
const SPARE: usize = 16;

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

/// A connection closed before anything was asked on it.
const NO_REQUEST: Refused = Refused { reason: "no_request" };
/// An idle connection closed.
const IDLE: Refused = Refused { reason: "idle" };
/// A request answered with 503.
const BUSY: Refused = Refused { reason: "busy" };

/// The open connections of a server.
pub(crate) struct Connections {
    limit: usize,
    table: Mutex<Table>,
    refused: Family<Refused, Counter>,
}

#[derive(Default)]
struct Table {
    open: usize,
    answering: usize,
    /// Those on which nothing was ever asked, among those that wait.
    unasked: usize,
    /// Those that wait for a request head.
    waiting: BTreeMap<Waiting, Arc<Notify>>,
    /// Number of waits so far.
    waits: u64,
    logged_at: Option<Instant>,
}

/// A connection that waits, in the order in which they give way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Waiting {
    has_asked: bool,
    since: u64,
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
    leave: Arc<Notify>,
    /// Changes only while the table is locked.
    standing: Mutex<Standing>,
}

/// The right to answer a request, until the answer is sent.
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
        for reason in [NO_REQUEST, IDLE, BUSY] {
            drop(refused.get_or_create(&reason));
        }
        Self { limit: limit.max(2), table: Mutex::default(), refused }
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

    /// Requests that are answered at once.
    fn most_answering(&self) -> usize {
        self.limit - self.limit.div_ceil(SPARE)
    }

    /// Connections that may be there without a request.
    fn most_unasked(&self) -> usize {
        (self.limit / UNASKED).max(ALWAYS_UNASKED)
    }

    /// A place for one more connection; none when all of them answer requests.
    pub(super) fn enter(self: &Arc<Self>) -> Option<Arc<Place>> {
        let mut table = locked(&self.table);
        if table.open >= self.limit || table.unasked >= self.most_unasked() {
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
                self.refused.get_or_create(&BUSY).inc();
                return None;
            }
        }
        table.open += 1;
        let leave = Arc::new(Notify::new());
        let standing = Mutex::new(Standing::Waiting(table.wait(false, leave.clone())));
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
        let Some((waiting, leave)) = table.waiting.pop_first() else { return false };
        table.unasked -= usize::from(!waiting.has_asked);
        self.refused.get_or_create(if waiting.has_asked { &IDLE } else { &NO_REQUEST }).inc();
        leave.notify_one();
        true
    }
}

impl Table {
    fn wait(&mut self, has_asked: bool, leave: Arc<Notify>) -> Waiting {
        self.waits += 1;
        let waiting = Waiting { has_asked, since: self.waits };
        self.waiting.insert(waiting, leave);
        self.unasked += usize::from(!has_asked);
        waiting
    }

    /// Notes that it waits no longer, unless it was told to leave before.
    fn forget(&mut self, waiting: Waiting) {
        if self.waiting.remove(&waiting).is_some() {
            self.unasked -= usize::from(!waiting.has_asked);
        }
    }
}

impl Place {
    /// A request head has arrived. Drop what it returns when the answer is sent.
    pub(super) fn begin(self: &Arc<Self>, path: &str) -> Result<Turn, TooMany> {
        let connections = &self.connections;
        let mut table = locked(&connections.table);
        let mut standing = locked(&self.standing);
        if let Standing::Waiting(waiting) = *standing {
            table.forget(waiting);
            table.answering += 1;
            *standing = Standing::Answering;
        }
        let limit = connections.most_answering();
        if table.answering > limit && !ALWAYS_ANSWERED.contains(&path) {
            connections.refused.get_or_create(&BUSY).inc();
            return Err(TooMany { limit });
        }
        Ok(Turn(self.clone()))
    }

    /// Whether a request has ever arrived on it.
    pub(super) fn has_asked(&self) -> bool {
        let standing = *locked(&self.standing);
        !matches!(standing, Standing::Waiting(Waiting { has_asked: false, .. }))
    }

    /// Returns when the connection shall end.
    pub(super) async fn leaves(&self, stop: &CancellationToken) {
        stop.run_until_cancelled(self.leave.notified()).await;
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        let place = &self.0;
        let mut table = locked(&place.connections.table);
        let mut standing = locked(&place.standing);
        table.answering -= 1;
        *standing = Standing::Waiting(table.wait(true, place.leave.clone()));
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut table = locked(&self.connections.table);
        table.open -= 1;
        match *locked(&self.standing) {
            Standing::Waiting(waiting) => table.forget(waiting),
            // A request that was one too many.
            Standing::Answering => table.answering -= 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_told(place: &Place) -> bool {
        use futures_util::FutureExt;
        place.leave.notified().now_or_never().is_some()
    }

    fn count(connections: &Connections, reason: &Refused) -> u64 {
        connections.refused.get_or_create(reason).get()
    }

    /// A connection that has been asked something, and waits.
    fn served(connections: &Arc<Connections>) -> Arc<Place> {
        let place = connections.enter().unwrap();
        drop(place.begin("/v1/jobs").ok().unwrap());
        place
    }

    fn assert_is_empty(connections: &Connections) {
        let table = locked(&connections.table);
        assert_eq!((table.open, table.answering, table.unasked, table.waiting.len()), (0, 0, 0, 0));
    }

    #[test]
    fn who_never_asked_gives_way_first_and_then_who_is_idle_longest() {
        let connections = Arc::new(Connections::new(4));
        let (first, second) = (served(&connections), served(&connections));
        // It has been there for longer, and been idle for less long.
        drop(first.begin("/v1/jobs").ok().unwrap());
        let third = served(&connections);
        let silent = connections.enter().unwrap();
        let fifth = served(&connections);
        assert!(is_told(&silent), "the newest of all, but it has asked for nothing");
        let sixth = served(&connections);
        assert!(is_told(&second) && !is_told(&first) && !is_told(&third), "idle for longest");
        assert_eq!((count(&connections, &NO_REQUEST), count(&connections, &IDLE)), (1, 1));
        assert_eq!(connections.open(), 6, "until those that were told have closed");
        // One that was told may have been asked something at that very moment: that is answered.
        drop(second.begin("/v1/jobs").ok().unwrap());
        drop((first, second, third, silent, fifth, sixth));
        assert_is_empty(&connections);
    }

    #[test]
    fn those_that_never_asked_have_a_quarter_of_the_places() {
        let connections = Arc::new(Connections::new(4000));
        let regular: Vec<_> = (0..4).map(|_| served(&connections)).collect();
        let silent: Vec<_> = (0..1020).map(|_| connections.enter().unwrap()).collect();
        let told = silent.iter().take_while(|place| is_told(place)).count();
        assert_eq!((told, locked(&connections.table).unasked), (20, 1000), "the older ones");
        assert!(!regular.iter().any(|place| is_told(place)));
        drop((regular, silent));
        assert_is_empty(&connections);
    }

    #[test]
    fn a_few_places_are_kept_for_connections_that_wait() {
        let connections = Arc::new(Connections::new(32));
        let places: Vec<_> = (0..32).map(|_| served(&connections)).collect();
        let mut turns: Vec<_> = places[..30].iter().map(|place| place.begin("/").ok().unwrap()).collect();
        assert_eq!(places[30].begin("/").err().map(|refused| refused.limit), Some(30));
        turns.push(places[31].begin("/metrics").ok().expect("that is always answered"));
        assert!(connections.enter().is_none(), "nobody waits, so nobody can give way");
        assert_eq!(count(&connections, &BUSY), 2);
        turns.pop();
        let newest = connections.enter().expect("the one before waits now");
        assert!(is_told(&places[31]));
        drop((places, turns, newest));
        assert_is_empty(&connections);
    }
}
