//! The attempts this worker answers for, from the claim until the server has confirmed the delivery.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard};

use roost_api::Progress;
use roost_api::ids::JobId;
use roost_api::lease::{AttemptBeat, AttemptDirective, Directive};
use tokio::sync::watch;

use crate::runner::{Stop, StopFlag};

/// What fences an attempt: its job and its number.
pub(super) type Key = (JobId, u32);

#[derive(Debug)]
struct Entry {
    progress: watch::Receiver<Option<Progress>>,
    stop: StopFlag,
}

/// The table of attempts held. Every method is short and none waits.
#[derive(Debug, Default)]
pub(super) struct Held(Mutex<BTreeMap<Key, Entry>>);

impl Held {
    pub(super) fn insert(&self, key: Key, progress: watch::Receiver<Option<Progress>>, stop: StopFlag) {
        self.lock().insert(key, Entry { progress, stop });
    }

    pub(super) fn remove(&self, key: Key) {
        self.lock().remove(&key);
    }

    /// A sign of life for each.
    pub(super) fn beats(&self) -> Vec<AttemptBeat> {
        let held = self.lock();
        let beat = |(&(job_id, attempt), entry): (&Key, &Entry)| AttemptBeat {
            job_id,
            attempt,
            progress: entry.progress.borrow().clone(),
        };
        held.iter().map(beat).collect()
    }

    /// Does what the server says. What has ended already is past stopping: its delivery decides.
    pub(super) fn obey(&self, directives: &[AttemptDirective]) {
        let mut held = self.lock();
        for row in directives {
            let key = (row.job_id, row.attempt);
            match row.directive {
                Directive::Continue => {}
                Directive::Cancel => {
                    if let Some(entry) = held.get(&key) {
                        entry.stop.set(Stop::Cancel);
                    }
                }
                Directive::Abandon => {
                    if let Some(entry) = held.remove(&key) {
                        entry.stop.set(Stop::Abandon);
                    }
                }
            }
        }
    }

    /// Asks everything to stop and go back to the queue.
    pub(super) fn release_all(&self) {
        self.lock().values().for_each(|entry| entry.stop.set(Stop::Release));
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<Key, Entry>> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row((job_id, attempt): Key, directive: Directive) -> AttemptDirective {
        AttemptDirective { job_id, attempt, directive, lease_expires_at: None }
    }

    #[test]
    fn directives_reach_their_attempt_and_no_other() {
        let held = Held::default();
        let keys: Vec<Key> = (1..=4).map(|attempt| (JobId::new(), attempt)).collect();
        let flags: Vec<_> = keys
            .iter()
            .map(|&key| {
                let stop = StopFlag::default();
                held.insert(key, watch::channel(None).1, stop.clone());
                stop
            })
            .collect();
        let stale = (keys[3].0, 9);
        held.obey(&[
            row(keys[0], Directive::Continue),
            row(keys[1], Directive::Cancel),
            row(keys[2], Directive::Abandon),
            row(stale, Directive::Abandon),
        ]);
        let seen: Vec<_> = flags.iter().map(StopFlag::get).collect();
        assert_eq!(seen, [None, Some(Stop::Cancel), Some(Stop::Abandon), None]);
        let left: Vec<_> = held.beats().iter().map(|beat| (beat.job_id, beat.attempt)).collect();
        assert_eq!(left, [keys[0], keys[1], keys[3]], "an abandoned attempt beats no more");
    }

    #[test]
    fn release_leaves_a_cancel_alone() {
        let held = Held::default();
        let (first, second) = (StopFlag::default(), StopFlag::default());
        held.insert((JobId::new(), 1), watch::channel(None).1, first.clone());
        held.insert((JobId::new(), 1), watch::channel(None).1, second.clone());
        first.set(Stop::Cancel);
        held.release_all();
        assert_eq!((first.get(), second.get()), (Some(Stop::Cancel), Some(Stop::Release)));
    }
}
