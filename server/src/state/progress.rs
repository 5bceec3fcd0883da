//! Progress and samples of running jobs: in memory only, never written to the database.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Mutex, MutexGuard, PoisonError};

use roost_api::ids::{JobId, SweepId};
use roost_api::job::{JobState, JobView};
use roost_api::lease::SeriesPart;
use roost_api::worker::WorkerView;
use roost_api::{Progress, Series};

use super::samples::{Gap, MAX_OF_ALL, Received, Samples};
use crate::store::Subject;

/// The newest progress and the samples of every running job, with a count of changes per job, per sweep and
/// in total.
#[derive(Default)]
pub(crate) struct ProgressBoard(Mutex<Board>);

#[derive(Default)]
struct Board {
    jobs: HashMap<JobId, JobProgress>,
    sweeps: HashMap<SweepId, u64>,
    samples: HashMap<JobId, Samples>,
    /// Samples of all jobs.
    sampled: usize,
    changes: u64,
}

struct JobProgress {
    progress: Progress,
    sweep: Option<SweepId>,
    changes: u64,
}

impl Board {
    fn count(&mut self, sweep: Option<SweepId>) -> u64 {
        self.changes += 1;
        if let Some(sweep) = sweep {
            self.sweeps.insert(sweep, self.changes);
        }
        self.changes
    }
}

impl ProgressBoard {
    fn lock(&self) -> MutexGuard<'_, Board> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stores the progress of a job.
    pub(crate) fn set(&self, job: JobId, sweep: Option<SweepId>, progress: Progress) {
        let mut board = self.lock();
        if board.jobs.get(&job).is_some_and(|known| known.progress == progress) {
            return;
        }
        let changes = board.count(sweep);
        board.jobs.insert(job, JobProgress { progress, sweep, changes });
    }

    /// Counts a change of a running job that the database does not count.
    pub(crate) fn touch(&self, job: JobId) {
        let mut board = self.lock();
        let Some(sweep) = board.jobs.get(&job).map(|known| known.sweep) else { return };
        let changes = board.count(sweep);
        board.jobs.entry(job).and_modify(|known| known.changes = changes);
    }

    /// Removes a job that no longer runs.
    pub(crate) fn remove(&self, job: JobId) {
        let mut board = self.lock();
        let removed = board.samples.remove(&job);
        board.sampled -= removed.map_or(0, |samples| samples.count());
        if let Some(removed) = board.jobs.remove(&job) {
            board.count(removed.sweep);
        }
    }

    /// Sets t = 0 and appends new samples of an attempt. Returns the series with missing earlier samples, each with the
    /// number of samples that are here.
    pub(crate) fn append(
        &self,
        (job, attempt): (JobId, u32),
        sweep: Option<SweepId>,
        t0_s: Option<f64>,
        parts: Vec<SeriesPart>,
    ) -> BTreeMap<String, u64> {
        let mut board = self.lock();
        let changes = board.changes + 1;
        let Board { samples, sampled, .. } = &mut *board;
        let samples = samples.entry(job).or_default();
        if samples.attempt() != attempt {
            *sampled -= samples.count();
            *samples = Samples::new(attempt);
        }
        samples.set_t0(t0_s, changes);
        let others = *sampled - samples.count();
        let mut missing = BTreeMap::new();
        for part in parts {
            let limit = MAX_OF_ALL.saturating_sub(others + samples.count());
            if let Err(Gap { name, count }) = samples.append(part, limit, changes) {
                missing.insert(name, count);
            }
        }
        *sampled = others + samples.count();
        if samples.changes == changes {
            board.count(sweep);
        }
        missing
    }

    /// The series of a running job so far.
    pub(crate) fn series(&self, job: JobId) -> Vec<Series> {
        self.lock().samples.get(&job).map(Samples::series).unwrap_or_default()
    }

    /// The simulated time of t = 0 of a running job, and samples that a follower has not received; none without anything new.
    pub(crate) fn next_samples(
        &self,
        job: JobId,
        received: &mut Received,
    ) -> Option<(Option<f64>, Vec<SeriesPart>)> {
        self.lock().samples.get(&job)?.next_event(received)
    }

    /// The jobs on the board.
    pub(crate) fn jobs(&self) -> Vec<JobId> {
        let board = self.lock();
        board
            .jobs
            .keys()
            .chain(board.samples.keys().filter(|job| !board.jobs.contains_key(*job)))
            .copied()
            .collect()
    }

    /// The sweep of a job, if it has one; the outer `None` is a job without progress.
    pub(crate) fn sweep_of(&self, job: JobId) -> Option<Option<SweepId>> {
        self.lock().jobs.get(&job).map(|known| known.sweep)
    }

    /// The count of changes of a subject. It starts anew with the server.
    pub(crate) fn version(&self, subject: Subject) -> u64 {
        let board = self.lock();
        match subject {
            Subject::Everything | Subject::Workers => board.changes,
            Subject::Job(job) => {
                let sampled = board.samples.get(&job).map_or(0, |samples| samples.changes);
                board.jobs.get(&job).map_or(0, |known| known.changes).max(sampled)
            }
            Subject::Sweep(sweep) => board.sweeps.get(&sweep).copied().unwrap_or(0),
            Subject::Studies | Subject::Study(_) | Subject::Meshes => 0,
        }
    }

    /// Adds the progress to the view of a running job.
    pub(crate) fn add_to_job(&self, job: &mut JobView) {
        if job.state == JobState::Running {
            job.progress = self.lock().jobs.get(&job.id).map(|known| known.progress.clone());
        }
    }

    /// The completed fraction of a running job and its wall time so far, in seconds.
    pub(crate) fn done(&self, job: JobId) -> Option<(f64, f64)> {
        let board = self.lock();
        board.jobs.get(&job).map(|known| (known.progress.fraction, known.progress.wall_s))
    }

    /// Adds the progress and the speed of its jobs to the view of a worker.
    pub(crate) fn add_to_worker(&self, worker: &mut WorkerView) {
        let board = self.lock();
        let known = worker.running.iter().map(|job| board.jobs.get(job).map(|known| known.progress.clone()));
        worker.progress = known.collect();
        let moving = worker.progress.iter().flatten().filter(|progress| progress.wall_s > 0.0);
        let speeds: Vec<f64> =
            moving.map(|progress| progress.particle_steps as f64 / progress.wall_s).collect();
        worker.particle_steps_per_s = (!speeds.is_empty()).then(|| speeds.iter().sum());
    }

    /// The sum of the completed fractions of these jobs.
    pub(crate) fn completed(&self, jobs: &[JobId]) -> f64 {
        let board = self.lock();
        let known = jobs.iter().filter_map(|job| board.jobs.get(job));
        known.map(|known| known.progress.fraction.clamp(0.0, 1.0)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first samples of a series.
    fn part(count: usize) -> SeriesPart {
        let zeros = vec![0.0; count];
        SeriesPart {
            name: "mass".to_owned(),
            unit: "kg".to_owned(),
            from: 0,
            t_s: zeros.clone(),
            values: zeros,
        }
    }

    #[test]
    fn samples_of_all_jobs_are_bounded_and_freed_with_their_attempt() {
        let board = ProgressBoard::default();
        let jobs: Vec<JobId> = (0..11).map(|_| JobId::new()).collect();
        let append = |job: usize, attempt, count| {
            let missing = board.append((jobs[job], attempt), None, None, vec![part(count)]);
            assert!(missing.is_empty(), "{missing:?}");
            board.series(jobs[job]).first().map_or(0, |series| series.values.len())
        };
        let tenth = MAX_OF_ALL / 10;
        assert_eq!((0..11).map(|job| append(job, 1, tenth)).sum::<usize>(), MAX_OF_ALL);
        assert_eq!(append(10, 2, 7), 0, "no memory");
        assert_eq!(append(0, 2, tenth - 5), tenth - 5, "a new attempt replaces the samples of the old one");
        assert_eq!(append(10, 3, 7), 5);
        board.remove(jobs[1]);
        assert_eq!(append(10, 4, tenth), tenth);
    }
}
