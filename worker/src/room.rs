//! Memory of a graphics adapter, shared out among the runs of a worker. A run that finds too little left goes back to the queue, where others
//! may take it and no time of its own runs out; nothing more is claimed until there is as much.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};

/// Bytes of a share.
const MIB: u64 = 1 << 20;

/// Memory that runs share.
#[derive(Debug)]
pub(crate) struct Room {
    /// A permit for each MiB that nobody has.
    left: Arc<Semaphore>,
    all_mib: u32,
    /// What the last run took; 0 before the first.
    usual_mib: AtomicU32,
    /// Runs that have been begun and have not taken theirs yet.
    coming: watch::Sender<usize>,
}

/// A run that has been begun, until it has its share or is over.
#[derive(Debug)]
pub(crate) struct Coming(Arc<Room>);

impl Drop for Coming {
    fn drop(&mut self) {
        self.0.coming.send_modify(|runs| *runs -= 1);
    }
}

/// What a run has of the memory, as long as it holds this.
#[derive(Debug)]
pub(crate) struct Share(#[expect(dead_code, reason = "gives it back when dropped")] OwnedSemaphorePermit);

impl Room {
    pub(crate) fn new(all_mib: u32) -> Self {
        Self {
            left: Arc::new(Semaphore::new(all_mib as usize)),
            all_mib,
            usual_mib: AtomicU32::new(0),
            coming: watch::Sender::new(0),
        }
    }

    /// Says that a run will come for memory.
    pub(crate) fn expect_one(self: &Arc<Self>) -> Coming {
        self.coming.send_modify(|runs| *runs += 1);
        Coming(self.clone())
    }

    /// Takes so much, if it is there: what is larger than all there is, if it is alone. If not, it is what the next claim waits for.
    pub(crate) fn take(&self, bytes: u64) -> Option<Share> {
        let mib = u32::try_from(bytes.div_ceil(MIB)).unwrap_or(u32::MAX).clamp(1, self.all_mib);
        self.usual_mib.store(mib, Relaxed);
        self.left.clone().try_acquire_many_owned(mib).ok().map(Share)
    }

    /// How many more runs there is memory for, if they are as the last one; waits until there is some for one and none comes
    /// before it. One, as long as none has been seen.
    pub(crate) async fn for_more(&self) -> usize {
        // That one never ends: the sender is here.
        let _ = self.coming.subscribe().wait_for(|runs| *runs == 0).await;
        let usual = self.usual_mib.load(Relaxed);
        if usual == 0 {
            return 1;
        }
        let _one = self.left.acquire_many(usual).await.expect("it is never closed");
        1 + self.left.available_permits() / usual as usize
    }
}

#[cfg(test)]
mod tests {
    use std::future::Future;
    use std::pin::pin;
    use std::task::{Context, Poll, Waker};

    use super::*;

    /// What a future says at once.
    fn now<T>(future: impl Future<Output = T>) -> Option<T> {
        match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(value) => Some(value),
            Poll::Pending => None,
        }
    }

    #[test]
    fn as_many_come_as_there_is_memory_for() {
        let room = Arc::new(Room::new(100));
        assert_eq!(now(room.for_more()), Some(1), "of none is known how large it is");
        let coming = room.expect_one();
        assert_eq!(now(room.for_more()), None, "of what was begun is not known how large it is");
        let first = room.take(30 * MIB).expect("there is room");
        drop(coming);
        assert_eq!(now(room.for_more()), Some(2));
        let second = room.take(30 * MIB - 1).expect("there is room");
        let third = room.take(40 * MIB).expect("there is room");
        assert_eq!(now(room.for_more()), None, "there is no room");
        drop(first);
        assert_eq!(now(room.for_more()), None, "there is none for one like the last");
        drop(second);
        assert_eq!(now(room.for_more()), Some(1));
        drop(third);
        assert_eq!(now(room.for_more()), Some(2));
    }

    #[test]
    fn what_is_too_large_comes_in_alone_and_nothing_is_claimed_before_it() {
        let room = Arc::new(Room::new(100));
        let small = room.take(1).expect("there is room");
        assert!(room.take(1 << 40).is_none());
        assert_eq!(now(room.for_more()), None, "something was claimed before there was room for it");
        drop(small);
        assert_eq!(now(room.for_more()), Some(1));
        let all = room.take(1 << 40).expect("it is alone");
        assert!(room.take(1).is_none());
        drop(all);
        assert!(room.take(1).is_some());
    }
}
