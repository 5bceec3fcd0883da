//! The attempts this worker answers for, from the claim until the server has confirmed the delivery.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard};

use roost_api::Progress;
use roost_api::ids::JobId;
use roost_api::lease::{AttemptBeat, AttemptDirective, Directive};
use tokio::sync::watch;

use super::news::News;
use crate::runner::{Run, Sampled, Stop, StopFlag};

/// What fences an attempt: its job and its number.
pub(super) type Key = (JobId, u32);

/// Samples that one beat carries at most, of all attempts together: some hundred kilobytes.
const SAMPLES_OF_A_BEAT: usize = 10_000;

#[derive(Debug)]
struct Entry {
    progress: watch::Receiver<Option<Progress>>,
    samples: Sampled,
    stop: StopFlag,
    news: News,
}

/// The table of attempts held. Every method is short and none waits.
#[derive(Debug, Default)]
pub(super) struct Held(Mutex<BTreeMap<Key, Entry>>);

impl Held {
    pub(super) fn insert(&self, key: Key, run: &Run) {
        let (progress, samples, stop) = (run.progress.clone(), run.samples.clone(), run.stop.clone());
        self.lock().insert(key, Entry { progress, samples, stop, news: News::default() });
    }

    pub(super) fn remove(&self, key: Key) {
        self.lock().remove(&key);
    }

    /// A sign of life for each, with what it has sampled since; what one beat cannot carry comes with the next.
    pub(super) fn beats(&self) -> Vec<AttemptBeat> {
        let mut held = self.lock();
        let mut room = SAMPLES_OF_A_BEAT;
        let beat = |(&(job_id, attempt), entry): (&Key, &mut Entry)| AttemptBeat {
            job_id,
            attempt,
            progress: entry.progress.borrow().clone(),
            samples: entry.news.since(&entry.samples.series(), &mut room),
        };
        held.iter_mut().map(beat).collect()
    }

    /// Does what the server says. What has ended already is past stopping: its delivery decides.
    pub(super) fn obey(&self, directives: &[AttemptDirective]) {
        let mut held = self.lock();
        for row in directives {
            let key = (row.job_id, row.attempt);
            if let Some(entry) = held.get_mut(&key) {
                entry.news.arrived(row.resend_samples);
            }
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

    /// Holds an attempt of which nothing is known but how to stop it.
    fn hold(held: &Held, key: Key) -> StopFlag {
        let run = Run::of_nothing();
        held.insert(key, &run);
        run.stop
    }

    fn row((job_id, attempt): Key, directive: Directive) -> AttemptDirective {
        AttemptDirective { job_id, attempt, directive, lease_expires_at: None, resend_samples: false }
    }

    #[tokio::test]
    async fn directives_reach_their_attempt_and_no_other() {
        let held = Held::default();
        let keys: Vec<Key> = (1..=4).map(|attempt| (JobId::new(), attempt)).collect();
        let flags: Vec<_> = keys.iter().map(|&key| hold(&held, key)).collect();
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

    #[tokio::test]
    async fn release_leaves_a_cancel_alone() {
        let held = Held::default();
        let (first, second) = (hold(&held, (JobId::new(), 1)), hold(&held, (JobId::new(), 1)));
        first.set(Stop::Cancel);
        held.release_all();
        assert_eq!((first.get(), second.get()), (Some(Stop::Cancel), Some(Stop::Release)));
    }
}
