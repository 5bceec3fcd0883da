//! Batching of requests of one kind: requests that arrive while one batch is written form the next batch.
//!
//! Each call into SQLite's thread, and each round trip to PostgreSQL, costs as much as a small statement. A batch is therefore one task
//! of the writer, with a fixed number of statements whatever its size. A batch that waits for the writer stays open: requests join it
//! until its first statement. When a batch fails, each request is tried alone, so that a faulty request harms no other.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

use super::StoreError;
use super::database::Connection;
use super::writer::{Work, Writer};

/// Executes a batch, and answers in the order of its requests.
pub(super) type Execute<A, B> = for<'t> fn(&'t mut Connection, &'t [Arc<A>]) -> Work<'t, Vec<B>>;

type Pending<A, B> = (Arc<A>, oneshot::Sender<Result<B, StoreError>>);

/// Maximum time that a batch waits, before it enters the writer's queue, to become as large as the one before. A single client never
/// waits.
const MAX_LINGER: Duration = Duration::from_millis(if cfg!(test) { 0 } else { 2 });

/// Batches of one kind between their first request and their answers.
const BATCHES_AT_ONCE: usize = 2;

/// Collects requests into batches. Its task ends with it.
pub(super) struct Batcher<A, B>(mpsc::Sender<Pending<A, B>>);

impl<A: Send + Sync + 'static, B: Send + 'static> Batcher<A, B> {
    /// Executes batches of up to `max_size` requests, at most one per `interval`. A batch starts while those before it are flushed.
    pub(super) fn start(
        writer: Arc<Writer>,
        max_size: usize,
        interval: Duration,
        execute: Execute<A, B>,
    ) -> Self {
        let (sender, mut pending) = mpsc::channel(4096);
        tokio::spawn(async move {
            let turns = Arc::new(Semaphore::new(BATCHES_AT_ONCE));
            let (mut batch, mut last_size) = (Vec::new(), 0);
            let mut earliest = Instant::now();
            while let Ok(turn) = turns.clone().acquire_owned().await {
                if batch.is_empty() && pending.recv_many(&mut batch, max_size).await == 0 {
                    break;
                }
                take_waiting(&mut batch, &mut pending, max_size);
                if batch.len() < max_size && !interval.is_zero() {
                    tokio::time::sleep_until(earliest).await;
                }
                // The clients of an earlier batch were just answered, and are about to send their next requests.
                let linger = tokio::time::sleep(MAX_LINGER);
                tokio::pin!(linger);
                while batch.len() < last_size.min(max_size) {
                    let free = max_size - batch.len();
                    tokio::select! {
                        received = pending.recv_many(&mut batch, free) => if received == 0 { break },
                        () = &mut linger => break,
                    }
                }
                take_waiting(&mut batch, &mut pending, max_size);
                let size = batch.len();
                let open = Arc::new(OpenBatch::new(std::mem::take(&mut batch)));
                let (writer, submitted) = (writer.clone(), open.clone());
                tokio::spawn(async move {
                    run(&writer, execute, submitted).await;
                    drop(turn);
                });
                let late;
                (last_size, late) = open.fill(size, max_size, &mut pending).await;
                batch.extend(late);
                earliest = Instant::now() + interval;
            }
        });
        Self(sender)
    }

    /// Submits a request, and returns its answer once it is on disk.
    pub(super) async fn submit(&self, request: A) -> Result<B, StoreError> {
        let (sender, receiver) = oneshot::channel();
        self.0.send((Arc::new(request), sender)).await.map_err(|_| StoreError::WriterGone)?;
        receiver.await.map_err(|_| StoreError::WriterGone)?
    }
}

/// Adds requests that have arrived to a batch.
fn take_waiting<T>(batch: &mut Vec<T>, pending: &mut mpsc::Receiver<T>, max_size: usize) {
    while batch.len() < max_size
        && let Ok(next) = pending.try_recv()
    {
        batch.push(next);
    }
}

/// A batch that requests join until the writer begins it.
struct OpenBatch<A, B> {
    batch: Mutex<Vec<Pending<A, B>>>,
    closed: CancellationToken,
}

impl<A, B> OpenBatch<A, B> {
    fn new(batch: Vec<Pending<A, B>>) -> Self {
        Self { batch: Mutex::new(batch), closed: CancellationToken::new() }
    }

    fn batch(&self) -> MutexGuard<'_, Vec<Pending<A, B>>> {
        self.batch.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds requests to a batch of `size` requests until it is closed. Returns its size, and the request that came too late, if one did.
    async fn fill(
        &self,
        mut size: usize,
        max_size: usize,
        pending: &mut mpsc::Receiver<Pending<A, B>>,
    ) -> (usize, Option<Pending<A, B>>) {
        loop {
            let next = tokio::select! {
                biased;
                () = self.closed.cancelled() => return (size, None),
                Some(next) = pending.recv(), if size < max_size => next,
            };
            let mut batch = self.batch();
            if self.closed.is_cancelled() {
                return (size, Some(next));
            }
            batch.push(next);
            size += 1;
        }
    }

    /// Closes the batch, and returns its requests.
    fn close(&self) -> Vec<Arc<A>> {
        let batch = self.batch();
        self.closed.cancel();
        batch.iter().map(|(request, _)| request.clone()).collect()
    }
}

/// Executes a batch, and sends the answers.
async fn run<A, B>(writer: &Writer, execute: Execute<A, B>, open: Arc<OpenBatch<A, B>>)
where
    A: Send + Sync + 'static,
    B: Send + 'static,
{
    let begun = open.clone();
    let written = writer.write(move |tx| {
        let requests = begun.close();
        Box::pin(async move { execute(tx, &requests).await })
    });
    let written = written.await;
    // The writer may have refused it before it started.
    open.closed.cancel();
    let (requests, senders): (Vec<_>, Vec<_>) = std::mem::take(&mut *open.batch()).into_iter().unzip();
    // A client may have stopped waiting for its answer.
    match written {
        Ok(answers) => {
            senders.into_iter().zip(answers).for_each(|(sender, answer)| drop(sender.send(Ok(answer))))
        }
        Err(error) if requests.len() == 1 || error.unavailable().is_some() || error.is_stopping() => {
            let error = Arc::new(error);
            senders.into_iter().for_each(|sender| drop(sender.send(Err(StoreError::Shared(error.clone())))));
        }
        Err(error) => {
            tracing::error!(
                error = error.as_dyn(),
                requests = requests.len(),
                "a batch failed; its requests are tried one by one"
            );
            for (request, sender) in requests.into_iter().zip(senders) {
                let alone = writer.write(move |tx| Box::pin(async move { execute(tx, &[request]).await }));
                let answer =
                    alone.await.and_then(|answers| answers.into_iter().next().ok_or(StoreError::WriterGone));
                drop(sender.send(answer));
            }
        }
    }
}

/// Splits the indices of keys into waves: a wave has no key twice, and equal keys keep their order.
pub(super) fn waves<K: Eq + Hash>(keys: impl IntoIterator<Item = K>) -> Vec<Vec<usize>> {
    let mut waves: Vec<Vec<usize>> = Vec::new();
    let mut next_wave: HashMap<K, usize> = HashMap::new();
    for (index, key) in keys.into_iter().enumerate() {
        let wave = next_wave.entry(key).or_default();
        if waves.len() == *wave {
            waves.push(Vec::new());
        }
        waves[*wave].push(index);
        *wave += 1;
    }
    waves
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use futures_util::future::join_all;

    use super::*;
    use crate::store::testing::Place;

    /// The batches that were tried.
    static TRIED: Mutex<Vec<Vec<u32>>> = Mutex::new(Vec::new());

    /// Answers each request with its square. A batch with 13 fails.
    fn squares<'t>(_: &'t mut Connection, batch: &'t [Arc<u32>]) -> Work<'t, Vec<u32>> {
        Box::pin(async move {
            let batch: Vec<u32> = batch.iter().map(|request| **request).collect();
            TRIED.lock().unwrap().push(batch.clone());
            if batch.contains(&13) {
                return Err(StoreError::Corrupt { what: "number", message: "13".to_owned() });
            }
            Ok(batch.iter().map(|request| request * request).collect())
        })
    }

    #[tokio::test]
    async fn a_failed_batch_is_tried_one_by_one() {
        let place = Place::sqlite();
        let store = place.open().await;
        let batcher = Batcher::start(store.writer.clone(), 64, Duration::ZERO, squares);
        // On one thread all requests are submitted before the first batch starts.
        let submit = async |requests: std::ops::Range<u32>| {
            join_all(requests.map(|request| batcher.submit(request))).await
        };

        let answers: Vec<u32> = submit(0..13).await.into_iter().map(Result::unwrap).collect();
        assert_eq!(answers, (0..13).map(|request| request * request).collect::<Vec<_>>());
        assert_eq!(std::mem::take(&mut *TRIED.lock().unwrap()), [(0..13).collect::<Vec<_>>()], "one batch");

        for (request, answer) in (10..16).zip(submit(10..16).await) {
            assert_eq!(answer.ok(), (request != 13).then_some(request * request), "{request}");
        }
        let tried = std::mem::take(&mut *TRIED.lock().unwrap());
        assert_eq!(tried[0], (10..16).collect::<Vec<_>>());
        assert_eq!(tried[1..], (10..16).map(|request| vec![request]).collect::<Vec<_>>());
        store.close().await;
    }

    /// The sizes of the batches that were executed.
    static SIZES: Mutex<Vec<usize>> = Mutex::new(Vec::new());

    fn sizes<'t>(_: &'t mut Connection, batch: &'t [Arc<u32>]) -> Work<'t, Vec<()>> {
        Box::pin(async move {
            SIZES.lock().unwrap().push(batch.len());
            Ok(batch.iter().map(|_| ()).collect())
        })
    }

    #[tokio::test]
    async fn a_batch_takes_requests_until_the_writer_begins_it() {
        let place = Place::sqlite();
        let store = place.open().await;
        let batcher = Batcher::start(store.writer.clone(), 4, Duration::ZERO, sizes);
        let (begin, has_begun) = oneshot::channel();
        let (release, is_released) = oneshot::channel();
        let other = store.writer.write(move |_| {
            Box::pin(async move {
                begin.send(()).unwrap();
                is_released.await.unwrap();
                Ok(())
            })
        });
        let requests = async {
            has_begun.await.unwrap();
            let submit = async |number: u32| {
                tokio::time::sleep(Duration::from_millis(10 * u64::from(number))).await;
                batcher.submit(number).await.unwrap();
            };
            let submitted = async {
                tokio::time::sleep(Duration::from_millis(200)).await;
                release.send(()).unwrap();
            };
            tokio::join!(join_all((0..6).map(submit)), submitted);
        };
        let (other, ()) = tokio::join!(other, requests);
        other.unwrap();
        assert_eq!(*SIZES.lock().unwrap(), [4, 2], "one full batch, and the rest");
        store.close().await;
    }

    #[test]
    fn equal_keys_are_in_different_waves() {
        assert_eq!(waves(["a", "b", "a", "c", "a", "b"]), [vec![0, 1, 3], vec![2, 5], vec![4]]);
        assert!(waves([0; 0]).is_empty());
    }
}
