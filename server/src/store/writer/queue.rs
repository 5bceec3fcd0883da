//! The queue of the writer: writes, and the beat of an idle writer.

use tokio::sync::mpsc;
use tokio::sync::mpsc::error::TrySendError;

use super::{BEAT, Write};

pub(super) enum Message {
    Work(Box<dyn Write>),
    /// A transaction is due if there was none for a while.
    Beat,
    Close,
}

/// The next writes of the queue.
#[derive(Default)]
pub(super) struct Next {
    /// A large write that came while a group was open.
    large: Option<Box<dyn Write>>,
    /// Whether the queue is closed.
    is_closed: bool,
}

impl Next {
    /// The first write of a group.
    pub(super) async fn first(&mut self, waiting: &mut mpsc::Receiver<Message>) -> First {
        if let Some(large) = self.large.take() {
            return First::Write(large);
        }
        if self.is_closed {
            return First::End;
        }
        match waiting.recv().await {
            Some(Message::Work(piece)) => First::Write(piece),
            Some(Message::Beat) => First::Beat,
            Some(Message::Close) | None => First::End,
        }
    }

    /// The next write of the same group, if one is queued.
    pub(super) fn more(&mut self, waiting: &mut mpsc::Receiver<Message>) -> Option<Box<dyn Write>> {
        match waiting.try_recv().ok()? {
            Message::Work(piece) if piece.is_large() => self.large = Some(piece),
            Message::Work(piece) => return Some(piece),
            // The transaction that runs is one.
            Message::Beat => {}
            Message::Close => self.is_closed = true,
        }
        None
    }
}

/// What the writer does next.
pub(super) enum First {
    Write(Box<dyn Write>),
    Beat,
    End,
}

/// Asks for transactions until the writer ends.
pub(super) async fn beat(queue: mpsc::WeakSender<Message>) {
    loop {
        tokio::time::sleep(BEAT / 4).await;
        let Some(queue) = queue.upgrade() else { return };
        // A full queue has writes.
        if let Err(TrySendError::Closed(_)) = queue.try_send(Message::Beat) {
            return;
        }
    }
}
