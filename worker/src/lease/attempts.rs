//! The attempts that this worker holds, from the claim until the server has confirmed the delivery.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard};

use roost_api::Progress;
use roost_api::ids::JobId;
use roost_api::lease::{AttemptBeat, AttemptDirective, Directive};
use tokio::sync::watch;

use super::sent_samples::SentSamples;
use crate::runner::{Run, SharedRecorder};
use crate::stop::{Stop, StopFlag};

/// Job and number of an attempt, which fence its writes.
pub(super) type AttemptKey = (JobId, u32);

/// Maximum of samples in one heartbeat, of all attempts together: some hundred kilobytes.
const MAX_SAMPLES_PER_BEAT: usize = 10_000;

#[derive(Debug)]
struct Entry {
    progress: watch::Receiver<Option<Progress>>,
    recorder: SharedRecorder,
    stop: StopFlag,
    sent: SentSamples,
}

/// The attempts by job and number. No method blocks.
#[derive(Debug, Default)]
pub(super) struct LeasedAttempts {
    held: Mutex<BTreeMap<AttemptKey, Entry>>,
    begun: AtomicU64,
}

impl LeasedAttempts {
    pub(super) fn insert(&self, key: AttemptKey, run: &Run) {
        let (progress, recorder, stop) = (run.progress.clone(), run.recorder.clone(), run.stop.clone());
        self.lock().insert(key, Entry { progress, recorder, stop, sent: SentSamples::default() });
        self.begun.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of attempts so far.
    pub(super) fn begun(&self) -> u64 {
        self.begun.load(Ordering::Relaxed)
    }

    /// Whether none is held.
    pub(super) fn is_empty(&self) -> bool {
        self.lock().is_empty()
    }

    pub(super) fn remove(&self, key: AttemptKey) {
        self.lock().remove(&key);
    }

    /// A heartbeat of each attempt with its new samples. Samples beyond the maximum go with the next heartbeat.
    pub(super) fn beats(&self) -> Vec<AttemptBeat> {
        let mut attempts = self.lock();
        let mut limit = MAX_SAMPLES_PER_BEAT;
        let beat = |(&(job_id, attempt), entry): (&AttemptKey, &mut Entry)| {
            let progress = entry.progress.borrow().clone();
            let recorder = entry.recorder.lock();
            let samples = entry.sent.next_parts(&recorder, &mut limit);
            AttemptBeat { job_id, attempt, progress, t0_s: recorder.t0_s(), samples }
        };
        attempts.iter_mut().map(beat).collect()
    }

    /// Applies the server's directives. A run that has ended already is not stopped: its delivery decides.
    pub(super) fn apply(&self, directives: &[AttemptDirective]) {
        let mut attempts = self.lock();
        for row in directives {
            let key = (row.job_id, row.attempt);
            if let Some(entry) = attempts.get_mut(&key) {
                entry.sent.continue_from(&row.missing_samples);
            }
            match row.directive {
                Directive::Continue => {}
                Directive::Cancel => {
                    if let Some(entry) = attempts.get(&key) {
                        entry.stop.set(Stop::Cancel);
                    }
                }
                Directive::Preempt => {
                    if let Some(entry) = attempts.get(&key) {
                        entry.stop.set(Stop::Preempt);
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
        self.held.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use roost_solver::observe::Clock;

    use super::*;

    /// Inserts an attempt and returns its stop flag.
    fn hold(attempts: &LeasedAttempts, key: AttemptKey) -> StopFlag {
        let run = Run::pending();
        attempts.insert(key, &run);
        run.stop
    }

    fn row((job_id, attempt): AttemptKey, directive: Directive) -> AttemptDirective {
        AttemptDirective {
            job_id,
            attempt,
            directive,
            lease_expires_at: None,
            missing_samples: BTreeMap::new(),
            resend_samples: false,
        }
    }

    #[tokio::test]
    async fn directives_apply_to_their_attempt_only() {
        let attempts = LeasedAttempts::default();
        let keys: Vec<AttemptKey> = (1..=5).map(|attempt| (JobId::new(), attempt)).collect();
        let flags: Vec<_> = keys.iter().map(|&key| hold(&attempts, key)).collect();
        let stale = (keys[3].0, 9);
        attempts.apply(&[
            row(keys[0], Directive::Continue),
            row(keys[1], Directive::Cancel),
            row(keys[2], Directive::Abandon),
            row(stale, Directive::Abandon),
            row(keys[4], Directive::Preempt),
        ]);
        let seen: Vec<_> = flags.iter().map(StopFlag::get).collect();
        assert_eq!(seen, [None, Some(Stop::Cancel), Some(Stop::Abandon), None, Some(Stop::Preempt)]);
        let left: Vec<_> = attempts.beats().iter().map(|beat| (beat.job_id, beat.attempt)).collect();
        assert_eq!(left, [keys[0], keys[1], keys[3], keys[4]], "an abandoned attempt has no heartbeat");
    }

    #[tokio::test]
    async fn heartbeat_carries_t0_and_the_samples_that_the_server_lacks() {
        let attempts = LeasedAttempts::default();
        let key = (JobId::new(), 1);
        let run = Run::pending();
        attempts.insert(key, &run);
        let beat = || {
            let AttemptBeat { t0_s, samples, .. } = attempts.beats().remove(0);
            (t0_s, samples.iter().map(|part| (part.from, part.values.clone())).collect::<Vec<_>>())
        };
        let mass = run.recorder.lock().add("mass", "kg", Clock::Simulated);
        let sample = |simulated_s, belt_s, value| {
            let mut recorder = run.recorder.lock();
            recorder.begin_sample(simulated_s, belt_s);
            recorder.record(mass, value);
        };
        sample(0.5, None, 7.0);
        assert_eq!(beat(), (None, vec![(0, vec![7.0])]));
        sample(1.0, Some(0.0), 8.0);
        assert_eq!(beat(), (Some(1.0), vec![(1, vec![8.0])]));
        assert_eq!(beat(), (Some(1.0), vec![]), "no sample twice");
        let missing_samples = BTreeMap::from([("mass".to_owned(), 0)]);
        attempts.apply(&[AttemptDirective { missing_samples, ..row(key, Directive::Continue) }]);
        assert_eq!(beat(), (Some(1.0), vec![(0, vec![7.0, 8.0])]));
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
