//! Requests of one kind that are worked together: what has come in while one group was written makes the next.
//!
//! Each way to SQLite's thread and back costs as much as a small statement. A group therefore is one piece of the writer's
//! with a handful of statements over all that is asked, however many ask. When a group fails, each of it is tried alone: what is wrong
//! with one harms no other.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::Arc;
use std::time::Duration;

use sqlx::SqliteConnection;
use tokio::sync::{mpsc, oneshot};
use tokio::time::Instant;

use super::StoreError;
use super::writer::{Work, Writer};

/// What does a group, answering in the order of those who ask.
pub(super) type Together<A, B> = for<'t> fn(&'t mut SqliteConnection, &'t [Arc<A>]) -> Work<'t, Vec<B>>;

type Waiting<A, B> = (Arc<A>, oneshot::Sender<Result<B, StoreError>>);

/// A group waits no longer than this to become as large as the one before. Who asks alone again and again never waits.
const PATIENCE: Duration = Duration::from_millis(if cfg!(test) { 0 } else { 2 });

/// Where requests wait for each other. Its task ends with it.
pub(super) struct Collector<A, B>(mpsc::Sender<Waiting<A, B>>);

impl<A: Send + Sync + 'static, B: Send + 'static> Collector<A, B> {
    /// Works groups of up to `most`, one at a time and one in `window` at the most.
    pub(super) fn start(
        writer: Arc<Writer>,
        most: usize,
        window: Duration,
        together: Together<A, B>,
    ) -> Self {
        let (sender, mut waiting) = mpsc::channel(4096);
        tokio::spawn(async move {
            let (mut group, mut before) = (Vec::new(), 0);
            let mut earliest = Instant::now();
            while waiting.recv_many(&mut group, most).await > 0 {
                if group.len() < most && !window.is_zero() {
                    tokio::time::sleep_until(earliest).await;
                }
                // As many as the last time are about to come again: what they do in turn was answered a moment ago.
                let patience = tokio::time::sleep(PATIENCE);
                tokio::pin!(patience);
                while group.len() < before.min(most) {
                    let room = most - group.len();
                    tokio::select! {
                        more = waiting.recv_many(&mut group, room) => if more == 0 { break },
                        () = &mut patience => break,
                    }
                }
                while group.len() < most
                    && let Ok(next) = waiting.try_recv()
                {
                    group.push(next);
                }
                earliest = Instant::now() + window;
                before = group.len();
                work(&writer, together, std::mem::take(&mut group)).await;
            }
        });
        Self(sender)
    }

    /// Asks, and returns once it is on disk.
    pub(super) async fn ask(&self, asked: A) -> Result<B, StoreError> {
        let (sender, receiver) = oneshot::channel();
        self.0.send((Arc::new(asked), sender)).await.map_err(|_| StoreError::WriterGone)?;
        receiver.await.map_err(|_| StoreError::WriterGone)?
    }
}

/// Works a group, and answers everybody.
async fn work<A, B>(writer: &Writer, together: Together<A, B>, group: Vec<Waiting<A, B>>)
where
    A: Send + Sync + 'static,
    B: Send + 'static,
{
    let write = async |asked: Vec<Arc<A>>| {
        writer.write(move |tx| Box::pin(async move { together(tx, &asked).await })).await
    };
    let (asked, senders): (Vec<_>, Vec<_>) = group.into_iter().unzip();
    // Nobody may be listening any more to what is sent below.
    match write(asked.clone()).await {
        Ok(answers) => {
            senders.into_iter().zip(answers).for_each(|(sender, answer)| drop(sender.send(Ok(answer))))
        }
        Err(error) if asked.len() == 1 || error.hindrance().is_some() || error.is_stopping() => {
            let error = Arc::new(error);
            senders.into_iter().for_each(|sender| drop(sender.send(Err(StoreError::Shared(error.clone())))));
        }
        Err(error) => {
            tracing::error!(
                error = error.as_dyn(),
                requests = asked.len(),
                "a group failed: each is tried alone"
            );
            for (asked, sender) in asked.into_iter().zip(senders) {
                let answer = write(vec![asked])
                    .await
                    .and_then(|answers| answers.into_iter().next().ok_or(StoreError::WriterGone));
                drop(sender.send(answer));
            }
        }
    }
}

/// Places of these keys in rounds: no key stands twice in one, and what stands twice keeps its order.
pub(super) fn rounds<K: Eq + Hash>(keys: impl IntoIterator<Item = K>) -> Vec<Vec<usize>> {
    let mut rounds: Vec<Vec<usize>> = Vec::new();
    let mut seen: HashMap<K, usize> = HashMap::new();
    for (place, key) in keys.into_iter().enumerate() {
        let round = seen.entry(key).or_default();
        if rounds.len() == *round {
            rounds.push(Vec::new());
        }
        rounds[*round].push(place);
        *round += 1;
    }
    rounds
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use futures_util::future::join_all;

    use super::*;
    use crate::store::Store;

    /// The groups that were tried.
    static TRIED: Mutex<Vec<Vec<u32>>> = Mutex::new(Vec::new());

    /// Answers each with its square; 13 is bad luck for all that are worked with it.
    fn squares<'t>(_: &'t mut SqliteConnection, group: &'t [Arc<u32>]) -> Work<'t, Vec<u32>> {
        Box::pin(async move {
            let group: Vec<u32> = group.iter().map(|asked| **asked).collect();
            TRIED.lock().unwrap().push(group.clone());
            if group.contains(&13) {
                return Err(StoreError::Corrupt { what: "number", message: "13".to_owned() });
            }
            Ok(group.iter().map(|asked| asked * asked).collect())
        })
    }

    #[tokio::test]
    async fn a_group_is_worked_at_once_and_one_that_fails_one_by_one() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(&dir.path().join("roost.db"), None).await.unwrap();
        let collector = Collector::start(store.writer.clone(), 64, Duration::ZERO, squares);
        // One thread, so that all ask before the first group is begun.
        let ask = async |asked: std::ops::Range<u32>| join_all(asked.map(|asked| collector.ask(asked))).await;

        let answers: Vec<u32> = ask(0..13).await.into_iter().map(Result::unwrap).collect();
        assert_eq!(answers, (0..13).map(|asked| asked * asked).collect::<Vec<_>>());
        assert_eq!(std::mem::take(&mut *TRIED.lock().unwrap()), [(0..13).collect::<Vec<_>>()], "all at once");

        for (asked, answer) in (10..16).zip(ask(10..16).await) {
            assert_eq!(answer.ok(), (asked != 13).then_some(asked * asked), "{asked}");
        }
        let tried = std::mem::take(&mut *TRIED.lock().unwrap());
        assert_eq!(tried[0], (10..16).collect::<Vec<_>>());
        assert_eq!(tried[1..], (10..16).map(|asked| vec![asked]).collect::<Vec<_>>());
        store.close().await;
    }

    #[test]
    fn what_asks_twice_waits_for_its_next_round() {
        assert_eq!(rounds(["a", "b", "a", "c", "a", "b"]), [vec![0, 1, 3], vec![2, 5], vec![4]]);
        assert!(rounds([0; 0]).is_empty());
    }
}
