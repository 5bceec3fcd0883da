//! Runs many simulations at once: small ones on one thread each, large ones on several.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use anyhow::Result;
use roost_solver::engine::run::Snapshot;
use roost_solver::result::{EndReason, Phase};
use roost_solver::{
    self as solver, Checked, Checkpoint, Computer, CpuOptions, Flow, Observer, Progress, simulate,
};
use roost_terminal::message;

use crate::picture::{Moment, Picture, Shot};
use crate::record::{Record, Store, machine_name};

/// A run gets a further thread for this many sub-particles.
const SUBPARTICLES_PER_THREAD: u64 = 2000;
/// Interval between checks for a request to stop.
const STOP_CHECK_INTERVAL: Duration = Duration::from_millis(200);

/// A simulation.
#[derive(Clone, Debug)]
pub(crate) struct Task {
    pub(crate) checked: Checked,
    pub(crate) digest: String,
    pub(crate) shots: Vec<Shot>,
    /// Estimated wall time on two threads, in seconds.
    pub(crate) cost_s: f64,
}

/// Wall time between two checkpoints of a simulation.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(60);

/// An event of a task, with the index of the task.
pub(crate) enum Event {
    /// Fraction done, 0 to 1.
    Progress(usize, f64),
    /// The end, with the record or an error message.
    Ended(usize, Box<Result<Record, String>>),
}

/// Runs the tasks with the indices in `order` on `threads` threads in all, until all have ended or `should_stop` returns true.
/// Running tasks are then cancelled without an event.
///
/// # Errors
/// The error of `on_event`, which cancels all tasks too.
pub(crate) fn run_all(
    tasks: &[Task],
    order: &[usize],
    threads: usize,
    store: &Store,
    should_stop: &dyn Fn() -> bool,
    on_event: &mut dyn FnMut(Event) -> Result<()>,
) -> Result<()> {
    let cancelled = AtomicBool::new(false);
    let (sender, events) = channel();
    let mut outcome = Ok(());
    std::thread::scope(|scope| {
        let mut waiting = order.iter().copied();
        let mut free_threads = threads;
        let mut running: Vec<(usize, usize)> = Vec::new();
        loop {
            while free_threads > 0 && !cancelled.load(Ordering::Relaxed) {
                let share = free_threads / waiting.len().max(1);
                let Some(index) = waiting.next() else { break };
                let task = &tasks[index];
                let useful = (task.checked.estimate().subparticles / SUBPARTICLES_PER_THREAD) as usize;
                let threads = share.min(useful).max(1);
                free_threads -= threads;
                running.push((index, threads));
                let (sender, cancelled) = (sender.clone(), &cancelled);
                scope.spawn(move || run(index, task, threads, store, cancelled, &sender));
            }
            if running.is_empty() {
                break;
            }
            match events.recv_timeout(STOP_CHECK_INTERVAL) {
                Ok(Event::Ended(index, end)) => {
                    if let Some(place) = running.iter().position(|(other, _)| *other == index) {
                        free_threads += running.swap_remove(place).1;
                    }
                    let is_cancelled =
                        end.as_ref().as_ref().is_ok_and(|r| r.result.end_reason == EndReason::Cancelled);
                    if !is_cancelled && outcome.is_ok() {
                        outcome = on_event(Event::Ended(index, end));
                    }
                }
                Ok(progress) if outcome.is_ok() => outcome = on_event(progress),
                Ok(_) => {}
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
            }
            if should_stop() || outcome.is_err() {
                cancelled.store(true, Ordering::Relaxed);
            }
        }
    });
    outcome
}

fn run(
    index: usize,
    task: &Task,
    threads: usize,
    store: &Store,
    cancelled: &AtomicBool,
    events: &Sender<Event>,
) {
    let compute = || {
        let (from, pictures) = store.load_checkpoint(&task.digest, &task.shots).unzip();
        let mut observer = TaskObserver {
            index,
            task,
            store,
            cancelled,
            events,
            progress: None,
            last_pictures: Vec::new(),
            pictures: pictures.unwrap_or_default(),
            saved_at: Instant::now(),
        };
        let computer = Computer::Cpu(CpuOptions { threads });
        let result = computer.simulate_from(&task.checked, from.as_ref(), &mut observer);
        let result = result.unwrap_or_else(|error| {
            message!("{error}; the simulation begins at zero");
            observer.pictures.clear();
            simulate(&task.checked, CpuOptions { threads }, &mut observer)
        });
        let pictures = observer.pictures.into_iter().chain(observer.last_pictures);
        Record {
            result,
            machine: machine_name(),
            shots: task.shots.clone(),
            pictures: pictures.map(Picture::without_hidden_discs).collect(),
        }
    };
    let end = catch_unwind(AssertUnwindSafe(compute)).map_err(|payload| panic_message(&*payload));
    // There is no receiver if the command is about to exit.
    let _ = events.send(Event::Ended(index, Box::new(end)));
}

fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(ToString::to_string);
    let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
    format!("the solver panicked: {}", text.unwrap_or_default())
}

/// Reports the progress of a task and takes its pictures.
struct TaskObserver<'a> {
    index: usize,
    task: &'a Task,
    store: &'a Store,
    cancelled: &'a AtomicBool,
    events: &'a Sender<Event>,
    progress: Option<Progress>,
    /// Pictures of the latest sample; the run may end after any sample.
    last_pictures: Vec<Picture>,
    pictures: Vec<Picture>,
    /// Moment of the last checkpoint.
    saved_at: Instant,
}

impl TaskObserver<'_> {
    fn is_due(&self, shot: &Shot) -> bool {
        let is_taken = || self.pictures.iter().any(|picture| picture.shot == *shot);
        let in_process = self.progress.as_ref().filter(|progress| progress.phase == Phase::Process);
        match shot.when {
            Moment::First => self.progress.is_none() && !is_taken(),
            Moment::At(time_s) => in_process.is_some_and(|now| now.time_s >= time_s - 1e-6) && !is_taken(),
            Moment::Last => true,
        }
    }
}

impl Observer for TaskObserver<'_> {
    fn progress(&mut self, progress: &Progress) -> Flow {
        let _ = self.events.send(Event::Progress(self.index, progress.fraction));
        self.progress = Some(progress.clone());
        if self.cancelled.load(Ordering::Relaxed) { Flow::Cancel } else { Flow::Continue }
    }

    fn wants_checkpoint(&mut self, moment: solver::Moment) -> bool {
        let is_stopped = self.cancelled.load(Ordering::Relaxed);
        moment == solver::Moment::Step && (is_stopped || self.saved_at.elapsed() >= CHECKPOINT_INTERVAL)
    }

    fn checkpoint(&mut self, checkpoint: Checkpoint) {
        self.saved_at = Instant::now();
        if let Err(error) =
            self.store.save_checkpoint(&self.task.digest, &checkpoint, &self.task.shots, &self.pictures)
        {
            message!("a checkpoint was not saved: {error}");
        }
    }

    fn wants_snapshot(&self, _simulated_s: f64) -> bool {
        self.task.shots.iter().any(|shot| self.is_due(shot))
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        self.last_pictures.clear();
        for shot in self.task.shots.iter().filter(|shot| self.is_due(shot)).copied().collect::<Vec<_>>() {
            let picture = Picture::take(shot, snapshot);
            if shot.when == Moment::Last {
                self.last_pictures.push(picture);
            } else {
                self.pictures.push(picture);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use roost_solver::mesh::Meshes;
    use roost_solver::scenario::{Scenario, from_value};
    use roost_solver::{Limits, check};
    use serde_json::json;

    use super::*;
    use crate::picture::View;

    fn checked(scenario: &Scenario) -> Checked {
        check(scenario, &Meshes::default(), &Limits::NONE).unwrap()
    }

    fn sample_task(seed: u64, shots: Vec<Shot>) -> Task {
        let scenario = from_value(&json!({
            "experiment": "hopper", "seed": seed,
            "product": {"count": 2, "subparticle_radius_m": 0.009},
            "equipment": {"hopper_width_m": 0.2},
            "numerics": {"timestep_s": "auto", "duration_s": 0.2, "max_fill_s": 2.0},
        }))
        .unwrap();
        Task { digest: scenario.digest(), checked: checked(&scenario), shots, cost_s: 1.0 }
    }

    #[test]
    fn every_task_ends_once_with_its_pictures() {
        let moments = [Moment::First, Moment::At(0.1), Moment::Last];
        let shots = moments.map(|when| Shot { view: View::Side, when });
        let tasks = [sample_task(1, shots.to_vec()), sample_task(2, Vec::new()), sample_task(3, Vec::new())];
        let mut ended = Vec::new();
        let folder = tempfile::tempdir().unwrap();
        let store = Store::in_folder(folder.path().to_owned());
        run_all(&tasks, &[0, 2], 2, &store, &|| false, &mut |event| {
            if let Event::Ended(index, record) = event {
                ended.push((index, record.unwrap()));
            }
            Ok(())
        })
        .unwrap();
        ended.sort_by_key(|(index, _)| *index);
        assert_eq!(ended.iter().map(|(index, _)| *index).collect::<Vec<_>>(), [0, 2]);
        assert_eq!(ended[0].1.result.scenario_digest, tasks[0].digest);
        assert!(ended[1].1.pictures.is_empty());
        let picture = |when| ended[0].1.picture(View::Side, when).unwrap();
        assert_eq!((picture(Moment::First).simulated_s, picture(Moment::First).belt_time_s), (0.0, None));
        let at = picture(Moment::At(0.1)).belt_time_s.unwrap();
        assert!((0.1 - 1e-3..0.1 + 0.021).contains(&at), "{at}");
        assert!((picture(Moment::Last).belt_time_s.unwrap() - 0.2).abs() < 1e-3);
        assert_ne!(picture(Moment::First).discs, picture(Moment::Last).discs);
    }

    #[test]
    fn stopped_tasks_have_no_end_and_waiting_tasks_do_not_start() {
        let mut long = sample_task(1, Vec::new());
        let scenario = from_value(&json!({
            "experiment": "hopper", "product": {"count": 2, "subparticle_radius_m": 0.009},
            "equipment": {"hopper_width_m": 0.2}, "numerics": {"duration_s": 600.0, "stop": {"when_empty": false}},
        }))
        .unwrap();
        long.checked = checked(&scenario);
        let (mut ended, mut started) = (0, Vec::new());
        let folder = tempfile::tempdir().unwrap();
        let store = Store::in_folder(folder.path().to_owned());
        let digest = long.digest.clone();
        run_all(&[long, sample_task(2, Vec::new())], &[0, 1], 1, &store, &|| true, &mut |event| {
            match event {
                Event::Ended(..) => ended += 1,
                Event::Progress(index, _) => started.push(index),
            }
            Ok(())
        })
        .unwrap();
        started.dedup();
        assert_eq!((ended, started), (0, vec![0]));
        assert!(store.load_checkpoint(&digest, &[]).is_some(), "it continues from there");
    }
}
