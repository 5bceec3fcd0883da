//! Memory of a graphics adapter, shared out among the runs of a worker. Who finds too little left waits for others to end, in the
//! order in which they came; nothing more is claimed meanwhile.

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

    /// Takes so much, once it is there. What is larger than all there is waits until it is alone.
    pub(crate) async fn take(&self, bytes: u64) -> Share {
        let mib = u32::try_from(bytes.div_ceil(MIB)).unwrap_or(u32::MAX).clamp(1, self.all_mib);
        self.usual_mib.store(mib, Relaxed);
        Share(self.left.clone().acquire_many_owned(mib).await.expect("it is never closed"))
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
        let first = now(room.take(30 * MIB)).expect("there is room");
        drop(coming);
        assert_eq!(now(room.for_more()), Some(2));
        let second = now(room.take(30 * MIB - 1)).expect("there is room");
        let third = now(room.take(40 * MIB)).expect("there is room");
        assert_eq!(now(room.for_more()), None, "there is no room");
        drop(first);
        assert_eq!(now(room.for_more()), None, "there is none for one like the last");
        drop(second);
        assert_eq!(now(room.for_more()), Some(1));
        drop(third);
        assert_eq!(now(room.for_more()), Some(2));
    }

    #[test]
    fn what_is_too_large_waits_until_it_is_alone_and_nobody_overtakes_it() {
        let room = Arc::new(Room::new(100));
        let small = now(room.take(1)).expect("there is room");
        let mut large = Box::pin(room.take(1 << 40));
        assert!(now(large.as_mut()).is_none());
        assert!(now(room.take(1)).is_none(), "one that came later was let in before");
        drop(small);
        let all = now(large).expect("it is alone");
        assert!(now(room.take(1)).is_none());
        drop(all);
        assert!(now(room.take(1)).is_some());
    }
}
