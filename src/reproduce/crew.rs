//! Runs many simulations at once: small ones side by side on a thread each, large ones on what threads are left.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

use anyhow::Result;
use roost_solver::engine::run::Snapshot;
use roost_solver::result::{EndReason, Phase};
use roost_solver::{Checked, CpuOptions, Flow, Observer, Progress, simulate};

use super::picture::{Picture, Shot, When};
use super::record::{Record, this_machine};

/// Threads do not help a run with fewer sub-particles than this for each.
const SUBPARTICLES_A_THREAD: u64 = 2000;
/// Whether to stop is looked at this often.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// A simulation to be run.
#[derive(Clone, Debug)]
pub(super) struct Task {
    pub(super) checked: Checked,
    pub(super) digest: String,
    pub(super) shots: Vec<Shot>,
    /// What it costs, in whatever unit: shares of it count.
    pub(super) cost: f64,
}

/// What is heard of tasks, by their index.
pub(super) enum News {
    /// It has come so far, 0 to 1.
    Progress(usize, f64),
    /// It is over: with its record, or with what went wrong.
    Ended(usize, Box<Result<Record, String>>),
}

/// Runs the tasks of these indices in their order, on so many threads in all, until all are done or `stop` says so: what runs then
/// is lost.
///
/// # Errors
/// What `hear` returns; it ends everything just so.
pub(super) fn work(
    tasks: &[Task],
    order: &[usize],
    threads: usize,
    stop: &dyn Fn() -> bool,
    hear: &mut dyn FnMut(News) -> Result<()>,
) -> Result<()> {
    let stopped = AtomicBool::new(false);
    let (sender, news) = channel();
    let mut heard = Ok(());
    std::thread::scope(|scope| {
        let mut waiting = order.iter().copied();
        let mut free = threads;
        let mut running: Vec<(usize, usize)> = Vec::new();
        loop {
            while free > 0 && !stopped.load(Ordering::Relaxed) {
                let share = free / waiting.len().max(1);
                let Some(index) = waiting.next() else { break };
                let task = &tasks[index];
                let useful = (task.checked.estimate().subparticles / SUBPARTICLES_A_THREAD) as usize;
                let threads = share.min(useful).max(1);
                free -= threads;
                running.push((index, threads));
                let (sender, stopped) = (sender.clone(), &stopped);
                scope.spawn(move || run(index, task, threads, stopped, &sender));
            }
            if running.is_empty() {
                break;
            }
            match news.recv_timeout(LOOK_EVERY) {
                Ok(News::Ended(index, ended)) => {
                    if let Some(place) = running.iter().position(|(other, _)| *other == index) {
                        free += running.swap_remove(place).1;
                    }
                    let is_cancelled =
                        ended.as_ref().as_ref().is_ok_and(|r| r.result.end_reason == EndReason::Cancelled);
                    if !is_cancelled && heard.is_ok() {
                        heard = hear(News::Ended(index, ended));
                    }
                }
                Ok(progress) if heard.is_ok() => heard = hear(progress),
                Ok(_) => {}
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
            }
            if stop() || heard.is_err() {
                stopped.store(true, Ordering::Relaxed);
            }
        }
    });
    heard
}

fn run(index: usize, task: &Task, threads: usize, stopped: &AtomicBool, news: &Sender<News>) {
    let solve = || {
        let mut watch =
            Onlooker { index, task, stopped, news, now: None, last: Vec::new(), pictures: Vec::new() };
        let result = simulate(&task.checked, CpuOptions { threads }, &mut watch);
        let pictures = watch.pictures.into_iter().chain(watch.last).map(Picture::of_what_is_seen);
        Record { result, machine: this_machine(), shots: task.shots.clone(), pictures: pictures.collect() }
    };
    let ended = catch_unwind(AssertUnwindSafe(solve)).map_err(|payload| panic_text(&*payload));
    // Nobody listens any more when the whole command is being torn down.
    let _ = news.send(News::Ended(index, Box::new(ended)));
}

fn panic_text(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(ToString::to_string);
    let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
    format!("the solver panicked: {}", text.unwrap_or_default())
}

/// Passes on the progress of a run and takes its pictures.
struct Onlooker<'a> {
    index: usize,
    task: &'a Task,
    stopped: &'a AtomicBool,
    news: &'a Sender<News>,
    now: Option<Progress>,
    /// Those of the last sample so far.
    last: Vec<Picture>,
    pictures: Vec<Picture>,
}

impl Onlooker<'_> {
    fn is_due(&self, shot: &Shot) -> bool {
        let is_taken = || self.pictures.iter().any(|picture| picture.shot == *shot);
        let belt_s = self.now.as_ref().filter(|now| now.phase == Phase::Process).map(|now| now.time_s);
        match shot.when {
            When::First => self.now.is_none() && !is_taken(),
            When::At(time_s) => belt_s.is_some_and(|belt_s| belt_s >= time_s - 1e-6) && !is_taken(),
            When::Last => true,
        }
    }
}

impl Observer for Onlooker<'_> {
    fn progress(&mut self, progress: &Progress) -> Flow {
        let _ = self.news.send(News::Progress(self.index, progress.fraction));
        self.now = Some(progress.clone());
        if self.stopped.load(Ordering::Relaxed) { Flow::Cancel } else { Flow::Continue }
    }

    fn wants_snapshot(&self, _simulated_s: f64) -> bool {
        self.task.shots.iter().any(|shot| self.is_due(shot))
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        self.last.clear();
        for shot in self.task.shots.iter().filter(|shot| self.is_due(shot)).copied().collect::<Vec<_>>() {
            let picture = Picture::take(shot, snapshot);
            let kept = if shot.when == When::Last { &mut self.last } else { &mut self.pictures };
            kept.push(picture);
        }
    }
}

#[cfg(test)]
mod tests {
    use roost_solver::mesh::Meshes;
    use roost_solver::scenario::{Scenario, from_value};
    use roost_solver::{Limits, check};
    use serde_json::json;

    use super::super::picture::View;
    use super::*;

    fn checked(scenario: &Scenario) -> Checked {
        check(scenario, &Meshes::default(), &Limits::NONE).unwrap()
    }

    fn task(seed: u64, shots: Vec<Shot>) -> Task {
        let scenario = from_value(&json!({
            "experiment": "hopper", "seed": seed,
            "product": {"count": 2, "subparticle_radius_m": 0.009},
            "equipment": {"hopper_width_m": 0.2},
            "numerics": {"timestep_s": "auto", "duration_s": 0.2, "max_fill_s": 2.0},
        }))
        .unwrap();
        Task { digest: scenario.digest(), checked: checked(&scenario), shots, cost: 1.0 }
    }

    #[test]
    fn every_task_ends_once_with_its_pictures_at_their_moments() {
        let whens = [When::First, When::At(0.1), When::Last];
        let shots = whens.map(|when| Shot { view: View::Side, when });
        let tasks = [task(1, shots.to_vec()), task(2, Vec::new()), task(3, Vec::new())];
        let mut ended = Vec::new();
        work(&tasks, &[0, 2], 2, &|| false, &mut |news| {
            if let News::Ended(index, record) = news {
                ended.push((index, record.unwrap()));
            }
            Ok(())
        })
        .unwrap();
        ended.sort_by_key(|(index, _)| *index);
        assert_eq!(ended.iter().map(|(index, _)| *index).collect::<Vec<_>>(), [0, 2]);
        assert_eq!(ended[0].1.result.scenario_digest, tasks[0].digest);
        assert!(ended[1].1.pictures.is_empty());
        let of = |when| ended[0].1.picture(View::Side, when).unwrap();
        assert_eq!((of(When::First).simulated_s, of(When::First).belt_time_s), (0.0, None));
        let at = of(When::At(0.1)).belt_time_s.unwrap();
        assert!((0.1 - 1e-3..0.1 + 0.021).contains(&at), "{at}");
        assert!((of(When::Last).belt_time_s.unwrap() - 0.2).abs() < 1e-3);
        assert_ne!(of(When::First).discs, of(When::Last).discs);
    }

    #[test]
    fn what_is_stopped_is_not_heard_of_and_what_waits_never_starts() {
        let mut long = task(1, Vec::new());
        let scenario = from_value(&json!({
            "experiment": "hopper", "product": {"count": 2, "subparticle_radius_m": 0.009},
            "equipment": {"hopper_width_m": 0.2}, "numerics": {"duration_s": 600.0, "stop": {"when_empty": false}},
        }))
        .unwrap();
        long.checked = checked(&scenario);
        let (mut ended, mut begun) = (0, Vec::new());
        work(&[long, task(2, Vec::new())], &[0, 1], 1, &|| true, &mut |news| {
            match news {
                News::Ended(..) => ended += 1,
                News::Progress(index, _) => begun.push(index),
            }
            Ok(())
        })
        .unwrap();
        begun.dedup();
        assert_eq!((ended, begun), (0, vec![0]));
    }
}
