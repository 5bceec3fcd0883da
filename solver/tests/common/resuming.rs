//! A backend that advances by random numbers of steps, and runs that are killed and go on.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses some of these")]

use std::cell::RefCell;

use roost_solver::engine::run::Observer;
use roost_solver::engine::saved::SavedRun;
use roost_solver::engine::scene::{Placement, Scene};
use roost_solver::engine::state::State;
use roost_solver::engine::{AdvanceReport, Backend, BackendInfo, SurfaceLoad};
use roost_solver::result::RunResult;
use roost_solver::{Checked, Checkpoint, Flow, Moment, Progress, simulate_on};
use serde_json::json;

/// Does at most a random number of steps at a time, so that checkpoints may be taken after any of them.
pub struct RandomSteps<'a, B>(pub &'a B, pub RefCell<fastrand::Rng>);

impl<B: Backend> Backend for RandomSteps<'_, B> {
    type Run = B::Run;

    fn info(&self) -> BackendInfo {
        self.0.info()
    }

    fn prepare(&self, scene: &Scene) -> B::Run {
        self.0.prepare(scene)
    }

    fn advance(&self, runs: &mut [(&mut B::Run, u64)]) -> Vec<AdvanceReport> {
        for (_, steps) in runs.iter_mut() {
            // Often all of them: the run then lies on a sample.
            let mut random = self.1.borrow_mut();
            *steps = if random.bool() { *steps } else { random.u64(1..=*steps) };
        }
        self.0.advance(runs)
    }

    fn state<'a>(&self, run: &'a mut B::Run) -> &'a State {
        self.0.state(run)
    }

    fn surface_loads(&self, run: &mut B::Run) -> Vec<SurfaceLoad> {
        self.0.surface_loads(run)
    }

    fn bonds(&self, run: &mut B::Run) -> Vec<[u32; 2]> {
        self.0.bonds(run)
    }

    fn start(&self, run: &mut B::Run) {
        self.0.start(run);
    }

    fn enter(&self, run: &mut B::Run, scene: &Scene, first: usize, bodies: &[Placement]) {
        self.0.enter(run, scene, first, bodies);
    }

    fn remove(&self, run: &mut B::Run, serials: &[u32]) {
        self.0.remove(run, serials);
    }

    fn save(&self, run: &mut B::Run) -> SavedRun {
        self.0.save(run)
    }

    fn restore(&self, scene: &Scene, saved: &SavedRun) -> B::Run {
        self.0.restore(scene, saved)
    }
}

/// Kills a run at a share of its progress, with a checkpoint.
pub struct Killer {
    /// Progress at which it kills, from 0 to 1.
    pub at: f64,
    /// The checkpoint that it has saved.
    pub saved: Option<Checkpoint>,
    killed: bool,
}

impl Killer {
    pub fn at(at: f64) -> Self {
        Self { at, saved: None, killed: false }
    }
}

impl Observer for Killer {
    fn progress(&mut self, progress: &Progress) -> Flow {
        self.killed = progress.fraction >= self.at;
        if self.killed { Flow::Cancel } else { Flow::Continue }
    }

    fn wants_checkpoint(&mut self, moment: Moment) -> bool {
        self.killed && moment == Moment::Step
    }

    fn checkpoint(&mut self, checkpoint: Checkpoint) {
        self.saved = Some(checkpoint);
    }
}

/// Runs a scenario on a backend until each share of its progress, killed there and continued from the bytes of its checkpoint
/// on the backend that `next` gives, and then to its end.
pub fn with_kills<B: Backend>(
    checked: &Checked,
    shares: &[f64],
    mut next: impl FnMut() -> B,
) -> (RunResult, usize) {
    let (mut from, mut kills) = (None, 0);
    for share in shares {
        let mut killer = Killer::at(*share);
        let result = simulate_on(&next(), checked, from.as_ref(), &mut killer).expect("its own checkpoint");
        let Some(saved) = killer.saved else { return (result, kills) };
        kills += 1;
        from = Some(Checkpoint::from_bytes(&saved.to_bytes()).expect("its own bytes"));
    }
    let mut keep_on = |_: &Progress| Flow::Continue;
    (simulate_on(&next(), checked, from.as_ref(), &mut keep_on).expect("its own checkpoint"), kills)
}

/// Everything of a result but its cost and the number of threads.
pub fn bits(result: &RunResult) -> String {
    let performance = &result.performance;
    let counts = [performance.subparticles, performance.particle_steps, performance.steps];
    json!([
        result.responses,
        result.series,
        result.curves,
        result.warnings,
        result.end_reason,
        result.instability,
        counts
    ])
    .to_string()
}
