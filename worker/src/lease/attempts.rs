//! The attempts that this worker holds, from the claim until the server has confirmed the delivery.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard};

use roost_api::Progress;
use roost_api::ids::JobId;
use roost_api::lease::{AttemptBeat, AttemptDirective, Directive};
use tokio::sync::watch;

use super::new_samples::NewSamples;
use crate::runner::{Run, Sampled, Stop, StopFlag};

/// Job and number of an attempt, which fence its writes.
pub(super) type AttemptKey = (JobId, u32);

/// Maximum of samples in one heartbeat, of all attempts together: some hundred kilobytes.
const MAX_SAMPLES_PER_BEAT: usize = 10_000;

#[derive(Debug)]
struct Entry {
    progress: watch::Receiver<Option<Progress>>,
    samples: Sampled,
    stop: StopFlag,
    new_samples: NewSamples,
}

/// The attempts by job and number. No method blocks.
#[derive(Debug, Default)]
pub(super) struct LeasedAttempts(Mutex<BTreeMap<AttemptKey, Entry>>);

impl LeasedAttempts {
    pub(super) fn insert(&self, key: AttemptKey, run: &Run) {
        let (progress, samples, stop) = (run.progress.clone(), run.samples.clone(), run.stop.clone());
        self.lock().insert(key, Entry { progress, samples, stop, new_samples: NewSamples::default() });
    }

    pub(super) fn remove(&self, key: AttemptKey) {
        self.lock().remove(&key);
    }

    /// A heartbeat of each attempt with its new samples. Samples beyond the maximum go with the next heartbeat.
    pub(super) fn beats(&self) -> Vec<AttemptBeat> {
        let mut attempts = self.lock();
        let mut limit = MAX_SAMPLES_PER_BEAT;
        let beat = |(&(job_id, attempt), entry): (&AttemptKey, &mut Entry)| AttemptBeat {
            job_id,
            attempt,
            progress: entry.progress.borrow().clone(),
            samples: entry.new_samples.since(&entry.samples.series(), &mut limit),
        };
        attempts.iter_mut().map(beat).collect()
    }

    /// Applies the server's directives. A run that has ended already is not stopped: its delivery decides.
    pub(super) fn apply(&self, directives: &[AttemptDirective]) {
        let mut attempts = self.lock();
        for row in directives {
            let key = (row.job_id, row.attempt);
            if let Some(entry) = attempts.get_mut(&key) {
                entry.new_samples.arrived(row.resend_samples);
            }
            match row.directive {
                Directive::Continue => {}
                Directive::Cancel => {
                    if let Some(entry) = attempts.get(&key) {
                        entry.stop.set(Stop::Cancel);
                    }
                }
                Directive::Abandon => {
                    if let Some(entry) = attempts.remove(&key) {
                        entry.stop.set(Stop::Abandon);
                    }
                }
            }
        }
    }

    /// Asks all runs to stop and releases their jobs to the queue.
    pub(super) fn release_all(&self) {
        self.lock().values().for_each(|entry| entry.stop.set(Stop::Release));
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<AttemptKey, Entry>> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Inserts an attempt and returns its stop flag.
    fn hold(attempts: &LeasedAttempts, key: AttemptKey) -> StopFlag {
        let run = Run::pending();
        attempts.insert(key, &run);
        run.stop
    }

    fn row((job_id, attempt): AttemptKey, directive: Directive) -> AttemptDirective {
        AttemptDirective { job_id, attempt, directive, lease_expires_at: None, resend_samples: false }
    }

    #[tokio::test]
    async fn directives_apply_to_their_attempt_only() {
        let attempts = LeasedAttempts::default();
        let keys: Vec<AttemptKey> = (1..=4).map(|attempt| (JobId::new(), attempt)).collect();
        let flags: Vec<_> = keys.iter().map(|&key| hold(&attempts, key)).collect();
        let stale = (keys[3].0, 9);
        attempts.apply(&[
            row(keys[0], Directive::Continue),
            row(keys[1], Directive::Cancel),
            row(keys[2], Directive::Abandon),
            row(stale, Directive::Abandon),
        ]);
        let seen: Vec<_> = flags.iter().map(StopFlag::get).collect();
        assert_eq!(seen, [None, Some(Stop::Cancel), Some(Stop::Abandon), None]);
        let left: Vec<_> = attempts.beats().iter().map(|beat| (beat.job_id, beat.attempt)).collect();
        assert_eq!(left, [keys[0], keys[1], keys[3]], "an abandoned attempt has no heartbeat");
    }

    #[tokio::test]
    async fn release_does_not_replace_cancel() {
        let attempts = LeasedAttempts::default();
        let (first, second) = (hold(&attempts, (JobId::new(), 1)), hold(&attempts, (JobId::new(), 1)));
        first.set(Stop::Cancel);
        attempts.release_all();
        assert_eq!((first.get(), second.get()), (Some(Stop::Cancel), Some(Stop::Release)));
    }
}
