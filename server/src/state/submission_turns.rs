//! Turns of requests that submit one sweep: a repeat with the same idempotency key waits for the first, which may take minutes.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use roost_api::ids::SweepId;
use tokio::sync::OwnedMutexGuard;

/// A lock per sweep that is being submitted.
#[derive(Default)]
pub(crate) struct SubmissionTurns(Mutex<HashMap<SweepId, Weak<tokio::sync::Mutex<()>>>>);

impl SubmissionTurns {
    /// Waits until no other request submits this sweep. The turn lasts until the guard is dropped.
    pub(crate) async fn wait(&self, id: SweepId) -> OwnedMutexGuard<()> {
        let turn = {
            let mut turns = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            turns.retain(|_, turn| turn.strong_count() > 0);
            match turns.get(&id).and_then(Weak::upgrade) {
                Some(turn) => turn,
                None => {
                    let turn = Arc::default();
                    turns.insert(id, Arc::downgrade(&turn));
                    turn
                }
            }
        };
        turn.lock_owned().await
    }
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt;

    use super::*;

    #[tokio::test]
    async fn requests_of_one_sweep_take_turns() {
        let (turns, one, other) = (SubmissionTurns::default(), SweepId::new(), SweepId::new());
        let first = turns.wait(one).await;
        assert!(turns.wait(one).now_or_never().is_none(), "the repeat waits");
        assert!(turns.wait(other).now_or_never().is_some());
        drop(first);
        assert!(turns.wait(one).now_or_never().is_some());
    }
}
