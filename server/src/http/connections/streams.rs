//! The event streams: one token has only a part of them.
//!
//! A stream answers for as long as its client likes, and idles most of the time. Without a limit one token could take all
//! places for answers.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// One token has one place of this many.
const SHARE: usize = 8;

/// So many streams it may always have.
const ALWAYS: usize = 16;

/// The event streams of each token.
pub(crate) struct Streams {
    max: usize,
    open: Mutex<HashMap<Arc<str>, usize>>,
}

/// The place of one event stream.
pub(crate) struct StreamPlace {
    streams: Arc<Streams>,
    token: Arc<str>,
}

impl Streams {
    /// Of a server with so many connections.
    pub(super) fn new(connections: usize) -> Self {
        Self { max: (connections / SHARE).max(ALWAYS), open: Mutex::default() }
    }

    /// Streams that one token may have.
    pub(crate) fn max(&self) -> usize {
        self.max
    }

    /// A place for one more stream of that token; none when it has enough of them.
    pub(crate) fn enter(self: &Arc<Self>, token: &Arc<str>) -> Option<StreamPlace> {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let count = open.entry(token.clone()).or_default();
        if *count >= self.max {
            return None;
        }
        *count += 1;
        Some(StreamPlace { streams: self.clone(), token: token.clone() })
    }
}

impl Drop for StreamPlace {
    fn drop(&mut self) {
        let mut open = self.streams.open.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(count) = open.get_mut(&self.token) {
            *count -= 1;
            if *count == 0 {
                open.remove(&self.token);
            }
        }
    }
}
