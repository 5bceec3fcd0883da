//! The slots of event streams: each token has a part of them only.
//!
//! A stream lasts for as long as its client likes, and idles most of the time. Without a limit one token
//! could take all slots of connections that answer.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// One token may have one stream for this many connections.
const CONNECTIONS_PER_STREAM: usize = 8;

/// Minimum of that number.
const MIN_STREAMS: usize = 16;

/// The open event streams of each token.
pub(crate) struct StreamSlots {
    max: usize,
    open: Mutex<HashMap<Arc<str>, usize>>,
}

/// The slot of one event stream.
pub(crate) struct StreamSlot {
    streams: Arc<StreamSlots>,
    token: Arc<str>,
}

impl StreamSlots {
    /// Slots of a server with this many connections.
    pub(super) fn new(connections: usize) -> Self {
        Self { max: (connections / CONNECTIONS_PER_STREAM).max(MIN_STREAMS), open: Mutex::default() }
    }

    /// StreamSlots that one token may have.
    pub(crate) fn max(&self) -> usize {
        self.max
    }

    /// A slot for one more stream of a token; none at the maximum.
    pub(crate) fn enter(self: &Arc<Self>, token: &Arc<str>) -> Option<StreamSlot> {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let count = open.entry(token.clone()).or_default();
        if *count >= self.max {
            return None;
        }
        *count += 1;
        Some(StreamSlot { streams: self.clone(), token: token.clone() })
    }
}

impl Drop for StreamSlot {
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
