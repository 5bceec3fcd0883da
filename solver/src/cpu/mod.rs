//! The CPU backend. Its plain path is the reference for all faster paths.
//!
//! On the plain path every sub-particle gathers its own forces, in the order of its neighbours' ids, with
//! only `+ - * / sqrt`. Each pair is computed twice, once from either side, with exactly opposite results.
//! Bits depend neither on the number of threads, nor on the moment of a list's rebuild, nor on how steps are
//! cut into chunks.
//!
//! Work is shared in chunks of [`CHUNK`] sub-particles, which own the histories of their contacts and bonds.
//! The fast path is in [`fast`].

pub mod cell_list;
pub mod displacement;
pub mod fast;
pub mod forces;
pub mod integrate;
pub mod load;
pub mod neighbour_list;
pub mod stages;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::engine::saved::SavedRun;
use crate::engine::scene::{Laws, Placement, Scene};
use crate::engine::state::State;
use crate::engine::{AdvanceReport, Backend, BackendInfo, SurfaceLoad};
use crate::walls::Walls;
use displacement::DisplacementTracker;
use fast::{FastRun, InstructionSet};
use glam::Vec3;
use load::Load;
use neighbour_list::NeighbourLists;
use stages::{Stage, StageTimers};

/// Number of sub-particles per task.
pub const CHUNK: usize = 256;

/// Verlet skin of the neighbour lists, as a share of R. With the skin the lists must stay below the lattice's
/// face diagonal, 2√2 R, or they triple.
pub(crate) const SKIN_RATIO: f32 = 0.35;

/// The CPU backend: a thread pool, and the path of its runs.
#[derive(Debug)]
pub struct Cpu {
    pool: ThreadPool,
    fast: Option<InstructionSet>,
}

/// A run in main memory.
#[derive(Debug)]
pub enum CpuRun {
    /// On the plain path.
    Plain(Box<PlainRun>),
    /// On the fast path.
    Fast(Box<FastRun>),
}

/// A run on the plain path.
#[derive(Debug)]
pub struct PlainRun {
    params: Params,
    state: State,
    walls: Walls,
    neighbour_lists: NeighbourLists,
    loads: Vec<Load>,
    displacement: DisplacementTracker,
    step: u64,
    start_step: Option<u64>,
    fault: Option<String>,
    stages: StageTimers,
}

/// Constants of a run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Params {
    laws: Laws,
    radius: f32,
    gravity: Vec3,
    dt: f32,
    dt_exact: f64,
    speed_limit: f32,
    skin: f32,
}

impl Params {
    fn of(scene: &Scene) -> Self {
        Self {
            laws: scene.laws,
            radius: scene.radius_m as f32,
            gravity: scene.gravity.as_vec3(),
            dt: scene.timestep_s as f32,
            dt_exact: scene.timestep_s,
            speed_limit: scene.speed_limit_m_s as f32,
            skin: SKIN_RATIO * scene.radius_m as f32,
        }
    }
}

impl Cpu {
    /// A backend on that many threads; 0 means one per processor. It takes the fast path with the widest instructions.
    pub fn new(threads: usize) -> Self {
        Self::fast(threads, InstructionSet::widest())
    }

    /// A backend that takes the fast path with these instructions.
    pub fn fast(threads: usize, instructions: InstructionSet) -> Self {
        Self { pool: pool(threads), fast: Some(instructions) }
    }

    /// A backend that takes the plain path.
    pub fn plain(threads: usize) -> Self {
        Self { pool: pool(threads), fast: None }
    }

    fn device(&self) -> String {
        let path = self.fast.map_or("plain", |instructions| instructions.name());
        format!("{} {path} f32", std::env::consts::ARCH)
    }
}

fn pool(threads: usize) -> ThreadPool {
    let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(|k| format!("solver-{k}")).build();
    pool.expect("the operating system gives threads")
}

/// Architecture and instruction set of the processor.
pub fn device_name() -> String {
    format!("{} {} f32", std::env::consts::ARCH, InstructionSet::widest().name())
}

impl Backend for Cpu {
    type Run = CpuRun;

    fn info(&self) -> BackendInfo {
        BackendInfo { name: "cpu".into(), device: self.device(), threads: self.pool.current_num_threads() }
    }

    fn prepare(&self, scene: &Scene) -> CpuRun {
        let params = Params::of(scene);
        match self.fast {
            Some(instructions) => CpuRun::Fast(Box::new(FastRun::new(scene, params, instructions))),
            None => CpuRun::Plain(Box::new(PlainRun::new(scene, params))),
        }
    }

    fn advance(&self, runs: &mut [(&mut CpuRun, u64)]) -> Vec<AdvanceReport> {
        let advance = |(run, steps): &mut (&mut CpuRun, u64)| match run {
            CpuRun::Plain(run) => run.advance(*steps),
            CpuRun::Fast(run) => run.advance(*steps),
        };
        self.pool.install(|| runs.iter_mut().map(advance).collect())
    }

    fn state<'a>(&self, run: &'a mut CpuRun) -> &'a State {
        match run {
            CpuRun::Plain(run) => &run.state,
            CpuRun::Fast(run) => run.state(),
        }
    }

    fn surface_loads(&self, run: &mut CpuRun) -> Vec<SurfaceLoad> {
        match run {
            CpuRun::Plain(run) => run.surface_loads(),
            CpuRun::Fast(run) => run.surface_loads(),
        }
    }

    fn bonds(&self, run: &mut CpuRun) -> Vec<[u32; 2]> {
        match run {
            CpuRun::Plain(run) => run.bonds(),
            CpuRun::Fast(run) => run.bonds(),
        }
    }

    fn start(&self, run: &mut CpuRun) {
        match run {
            CpuRun::Plain(run) => run.start(),
            CpuRun::Fast(run) => run.start(),
        }
    }

    fn enter(&self, run: &mut CpuRun, scene: &Scene, first: usize, bodies: &[Placement]) {
        match run {
            CpuRun::Plain(run) => run.enter(scene, first, bodies),
            CpuRun::Fast(run) => run.enter(scene, first, bodies),
        }
    }

    fn remove(&self, run: &mut CpuRun, serials: &[u32]) {
        match run {
            CpuRun::Plain(run) => run.remove(serials),
            CpuRun::Fast(run) => run.remove(serials),
        }
    }

    fn save(&self, run: &mut CpuRun) -> SavedRun {
        match run {
            CpuRun::Plain(run) => run.save(),
            CpuRun::Fast(run) => run.save(),
        }
    }

    fn restore(&self, scene: &Scene, saved: &SavedRun) -> CpuRun {
        let params = Params::of(scene);
        match self.fast {
            Some(instructions) => {
                CpuRun::Fast(Box::new(FastRun::restore(scene, params, instructions, saved)))
            }
            None => CpuRun::Plain(Box::new(PlainRun::restore(scene, params, saved))),
        }
    }
}

impl CpuRun {
    /// Time spent in each stage, while measured.
    pub fn stages(&self) -> &StageTimers {
        match self {
            Self::Plain(run) => &run.stages,
            Self::Fast(run) => run.stages(),
        }
    }
}

impl PlainRun {
    fn new(scene: &Scene, params: Params) -> Self {
        let state = State::new(scene);
        Self {
            walls: Walls::new(scene, &state.frame),
            neighbour_lists: NeighbourLists::new(scene),
            loads: Vec::new(),
            displacement: DisplacementTracker::default(),
            step: 0,
            start_step: None,
            fault: None,
            stages: StageTimers::default(),
            params,
            state,
        }
    }

    fn save(&self) -> SavedRun {
        SavedRun {
            step: self.step,
            start_step: self.start_step,
            state: self.state.clone(),
            stored_bodies: Vec::new(),
            pairs: self.neighbour_lists.save_pairs(),
            walls: self.neighbour_lists.save_walls(),
        }
    }

    fn restore(scene: &Scene, params: Params, saved: &SavedRun) -> Self {
        let mut run = Self {
            neighbour_lists: NeighbourLists::restore(saved, params.laws.moment.is_some()),
            state: saved.state.clone(),
            step: saved.step,
            start_step: saved.start_step,
            ..Self::new(scene, params)
        };
        run.walls.restore(saved.start_step, saved.step, scene.timestep_s, &run.state.frame);
        run
    }

    fn surface_loads(&self) -> Vec<SurfaceLoad> {
        let contacts = self.state.particles.iter().enumerate().flat_map(|(i, particle)| {
            let walls = self.neighbour_lists.chunks.get(i / CHUNK).map(|chunk| chunk.wall_pairs(i % CHUNK));
            walls.into_iter().flatten().map(move |wall| (*particle, wall.facet, wall.force))
        });
        self.walls.loads(&self.state.frame, self.params.dt, contacts)
    }

    fn bonds(&self) -> Vec<[u32; 2]> {
        let serials = &self.state.serials;
        let row = |i: usize| {
            self.neighbour_lists.chunks[i / CHUNK].pairs(i % CHUNK).iter().map(move |pair| (i, pair))
        };
        (0..serials.len())
            .flat_map(row)
            .filter(|(i, pair)| pair.bond_class != 0 && *i < pair.other as usize)
            .map(|(i, pair)| [serials[i], serials[pair.other as usize]])
            .collect()
    }

    fn start(&mut self) {
        self.start_step = Some(self.step);
        let changed = self.walls.start();
        self.neighbour_lists.surfaces_changed(&changed);
    }

    fn enter(&mut self, scene: &Scene, first: usize, bodies: &[Placement]) {
        let base = self.state.particles.len() as u32;
        self.state.enter(scene, first, bodies);
        self.neighbour_lists.enter(scene, bodies, base);
        self.displacement.invalidate();
    }

    fn remove(&mut self, serials: &[u32]) {
        let map = self.state.remove(serials);
        self.neighbour_lists.remove(&map);
        self.displacement.invalidate();
    }

    fn advance(&mut self, steps: u64) -> AdvanceReport {
        let mut done = AdvanceReport::default();
        for _ in 0..steps {
            if self.fault.is_some() {
                break;
            }
            self.one_step(&mut done);
        }
        done.fault.clone_from(&self.fault);
        done
    }

    /// One time step: the stages of [`Backend`].
    fn one_step(&mut self, done: &mut AdvanceReport) {
        let belt_time = self.start_step.map(|start| (self.step - start) as f64 * self.params.dt_exact);
        let mut timer = self.stages.timer();
        self.walls.pose(belt_time, &self.state.frame);
        if self.displacement.needs_rebuild(self.params.skin, &self.walls) {
            self.neighbour_lists.rebuild(&self.params, &self.state, &self.walls);
            self.displacement.reset(&self.state, &mut self.walls);
        }
        timer.lap(Stage::Neighbours);
        let mut broken = std::mem::take(&mut self.state.broken);
        let stats = forces::gather(
            &self.params,
            &self.state,
            &self.walls,
            &mut self.neighbour_lists,
            &mut self.loads,
            &mut broken,
        );
        self.state.broken = broken;
        timer.lap(Stage::Contacts);
        let moved = integrate::advance(&self.params, &mut self.state, &self.loads, &mut self.displacement);
        timer.lap(Stage::Motion);
        self.state.bonds_broken += u64::from(stats.bonds_broken);
        self.step += 1;
        done.steps += 1;
        done.particle_steps += self.state.particles.len() as u64;
        done.max_overlap_m = done.max_overlap_m.max(stats.max_overlap);
        done.passed_through += u64::from(stats.passed_through);
        self.fault = moved.fault(&self.params, &self.state);
    }
}
