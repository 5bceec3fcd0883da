//! The run loop: advances a scene from sample to sample, lets the experiment observe and decide, reports progress.

use std::time::Instant;

use super::Backend;
use super::checkpoint::{Checkpoint, CheckpointError, Head, Moment, Stamp};
use super::run::{Decision, ExperimentMonitor, Observer, RunPlan, RunSummary, Sample, Snapshot};
use super::scene::Scene;
use super::timeline::{SoFar, Timeline};
use crate::result::{EndReason, Flow, Instability, Performance};

/// Reason of an end, and what diverged.
type End = (EndReason, Option<String>);

/// A run in progress.
struct Simulation<'a, B: Backend> {
    backend: &'a B,
    scene: &'a Scene,
    stamp: &'a Stamp,
    monitor: &'a mut dyn ExperimentMonitor,
    observer: &'a mut dyn Observer,
    run: B::Run,
    timeline: Timeline,
    /// Bodies that have entered.
    entered: usize,
    clock: Instant,
    /// Wall time before the run went on from a checkpoint, in seconds.
    earlier_wall_s: f64,
}

/// Runs a scene to its end, from the beginning or from a checkpoint that fits it (see [`Checkpoint::fits`]).
///
/// # Errors
/// A checkpoint that does not fit the scene.
pub fn run<B: Backend>(
    backend: &B,
    scene: &Scene,
    plan: RunPlan,
    stamp: &Stamp,
    from: Option<&Checkpoint>,
    monitor: &mut dyn ExperimentMonitor,
    observer: &mut dyn Observer,
) -> Result<RunSummary, CheckpointError> {
    let so_far = from.map_or(SoFar::default(), |from| from.body.so_far);
    let timeline = Timeline::new(plan, scene.timestep_s, so_far);
    let entered = from.map_or(scene.present().len(), |from| from.body.entered as usize);
    let run = match from {
        None => backend.prepare(scene),
        Some(from) => {
            let damaged = |why: &dyn ToString| CheckpointError::Damaged(why.to_string());
            let saved = from.body.columns.run(scene, entered).map_err(|why| damaged(&why))?;
            let is_same_time = (saved.step, saved.start_step) == (so_far.step, so_far.start_step);
            let is_at_start = from.head.moment == Moment::Start;
            if !is_same_time || !timeline.is_possible() || is_at_start && so_far.start_step.is_some() {
                return Err(damaged(&"its times do not fit each other"));
            }
            monitor.restore(&from.body.monitor).map_err(|why| damaged(&why))?;
            backend.restore(scene, &saved)
        }
    };
    let (clock, earlier_wall_s) = (Instant::now(), from.map_or(0.0, |from| from.head.wall_s));
    let mut simulation = Simulation {
        backend,
        scene,
        stamp,
        monitor,
        observer,
        run,
        timeline,
        entered,
        clock,
        earlier_wall_s,
    };
    if from.is_some_and(|from| from.head.moment == Moment::Start) {
        simulation.start();
    }
    let is_between = from.is_some_and(|from| from.head.moment == Moment::Step);
    let end = simulation.finish(is_between);
    Ok(simulation.summary(end))
}

impl<B: Backend> Simulation<'_, B> {
    /// Runs to the end, at first to the next sample if it is between two.
    fn finish(&mut self, is_between: bool) -> End {
        if is_between && let Some(end) = self.advance() {
            return end;
        }
        loop {
            if let Some(end) = self.sample().or_else(|| self.advance()) {
                return end;
            }
        }
    }

    /// Takes a sample, lets the experiment decide, and does what it decides.
    fn sample(&mut self) -> Option<End> {
        loop {
            let surface_loads = self.backend.surface_loads(&mut self.run);
            let sample = Sample {
                simulated_s: self.timeline.simulated_s(),
                belt_time_s: self.timeline.belt_time_s(),
                state: self.backend.state(&mut self.run),
                max_overlap_m: self.timeline.so_far.max_overlap_m,
                passed_through: self.timeline.so_far.passed_through,
                surface_loads: &surface_loads,
            };
            let decision = self.monitor.observe(&sample);
            self.offer_snapshot(matches!(decision, Decision::Start));
            match decision {
                Decision::End(reason) => return Some((reason, None)),
                Decision::Diverged(seen) => return Some((EndReason::Unstable, Some(seen))),
                Decision::Start => {
                    self.offer_checkpoint(Moment::Start);
                    self.start();
                }
                Decision::Continue { remove } => {
                    if !remove.is_empty() {
                        self.backend.remove(&mut self.run, &remove);
                    }
                    break;
                }
            }
        }
        if self.observer.wants_samples() {
            self.observer.samples(self.monitor.recorder());
        }
        if let Some(reason) = self.timeline.time_limit_reached() {
            return Some((reason, None));
        }
        let state = self.backend.state(&mut self.run);
        let entering = self.monitor.entering(state, self.timeline.belt_time_s());
        if !entering.is_empty() {
            self.backend.enter(&mut self.run, self.scene, self.entered, &entering);
            self.entered += entering.len();
        }
        self.timeline.next_sample();
        None
    }

    fn start(&mut self) {
        self.backend.start(&mut self.run);
        self.timeline.start();
    }

    /// Advances to the next sample.
    fn advance(&mut self) -> Option<End> {
        // The count holds until the next sample. A call to the device would cost time.
        let left = self.backend.state(&mut self.run).particles.len() as u64;
        while self.timeline.steps_to_sample() > 0 {
            let steps = self.timeline.steps_to_next_progress().min(self.timeline.steps_to_sample());
            let before = Instant::now();
            let advance = self.backend.advance(&mut [(&mut self.run, steps)]).swap_remove(0);
            self.timeline.record(advance, before.elapsed().as_secs_f64());
            let progress = self.timeline.progress(left, self.wall_s(), self.monitor.discharged_kg());
            let flow = self.observer.progress(&progress);
            if let Some(fault) = self.timeline.fault.take() {
                return Some((EndReason::Unstable, Some(fault)));
            }
            self.offer_checkpoint(Moment::Step);
            if flow == Flow::Cancel {
                return Some((EndReason::Cancelled, None));
            }
        }
        None
    }

    /// Offers a picture. The one at t = 0 is taken after the start, at the second offer.
    fn offer_snapshot(&mut self, starts: bool) {
        let (simulated_s, belt_time_s) = (self.timeline.simulated_s(), self.timeline.belt_time_s());
        if self.observer.wants_snapshot(simulated_s) && !starts {
            let bonds = self.backend.bonds(&mut self.run);
            let state = self.backend.state(&mut self.run);
            self.observer.snapshot(&Snapshot {
                scene: self.scene,
                simulated_s,
                belt_time_s,
                state,
                bonds: &bonds,
            });
        }
    }

    fn offer_checkpoint(&mut self, moment: Moment) {
        if self.observer.wants_checkpoint(moment) {
            let saved = self.backend.save(&mut self.run);
            let head = Head {
                stamp: self.stamp.clone(),
                moment,
                simulated_s: self.timeline.simulated_s(),
                wall_s: self.wall_s(),
            };
            let (so_far, entered) = (self.timeline.so_far, self.entered as u64);
            let checkpoint = Checkpoint::new(head, so_far, entered, &saved, self.monitor.save());
            self.observer.checkpoint(checkpoint);
        }
    }

    fn wall_s(&self) -> f64 {
        self.earlier_wall_s + self.clock.elapsed().as_secs_f64()
    }

    /// Completes the series. Returns the end and the cost.
    fn summary(self, (reason, fault): End) -> RunSummary {
        self.monitor.finish();
        let (wall_s, timeline) = (self.wall_s(), &self.timeline);
        let so_far = timeline.so_far;
        let instability =
            fault.map(|reason| Instability { step: so_far.step, time_s: timeline.time_s(), reason });
        let performance = Performance {
            subparticles: u64::from(self.scene.first_serial(self.scene.present().len())),
            particle_steps: so_far.particle_steps,
            steps: so_far.step,
            wall_s,
            ns_per_particle_step: so_far.advancing_s * 1e9 / so_far.particle_steps.max(1) as f64,
        };
        RunSummary { reason, instability, performance }
    }
}
