//! The CPU backend, plain path: the reference that every faster path is held to.
//!
//! Every sub-particle gathers its own forces, its neighbours in the order of their ids, with only
//! `+ - * / sqrt`; each pair is worked out twice, once from either side, with exactly opposite results. Nothing
//! depends on the number of threads, on when neighbour lists were rebuilt, or on how steps were cut into chunks.
//! Work is shared out in chunks of [`CHUNK`] sub-particles, which own the memory of their contacts and bonds.

pub mod bounds;
pub mod forces;
pub mod grid;
pub mod integrate;
pub mod lists;
pub mod walls;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::engine::scene::{Laws, Scene};
use crate::engine::state::State;
use crate::engine::{Advance, Backend, BackendInfo};
use bounds::Drift;
use forces::Load;
use glam::{DVec3, Vec3};
use lists::Lists;
use walls::Walls;

/// Sub-particles that one task works on.
pub const CHUNK: usize = 256;

/// Distance beyond reach that neighbour lists cover, as a share of R. Lists must stay short of the lattice's face
/// diagonal, 2√2 R, or they triple.
const SKIN_RATIO: f32 = 0.35;

/// The plain path on a pool of threads.
#[derive(Debug)]
pub struct Cpu {
    pool: ThreadPool,
}

/// A run in main memory.
#[derive(Debug)]
pub struct CpuRun {
    params: Params,
    state: State,
    walls: Walls,
    lists: Lists,
    loads: Vec<Load>,
    drift: Drift,
    step: u64,
    start_step: Option<u64>,
    fault: Option<String>,
}

/// What stays the same for a whole run.
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

impl Cpu {
    /// A backend on that many threads; 0 means one per processor.
    pub fn new(threads: usize) -> Self {
        let pool =
            ThreadPoolBuilder::new().num_threads(threads).thread_name(|k| format!("solver-{k}")).build();
        Self { pool: pool.expect("the operating system gives threads") }
    }
}

/// The processor, in words: its architecture and the instruction set that the plain path uses.
pub fn device_name() -> String {
    format!("{} plain f32", std::env::consts::ARCH)
}

impl Backend for Cpu {
    type Run = CpuRun;

    fn info(&self) -> BackendInfo {
        BackendInfo { name: "cpu".into(), device: device_name(), threads: self.pool.current_num_threads() }
    }

    fn prepare(&self, scene: &Scene) -> CpuRun {
        let state = State::new(scene);
        let params = Params {
            laws: scene.laws,
            radius: scene.radius_m as f32,
            gravity: scene.gravity.as_vec3(),
            dt: scene.timestep_s as f32,
            dt_exact: scene.timestep_s,
            speed_limit: scene.speed_limit_m_s as f32,
            skin: SKIN_RATIO * scene.radius_m as f32,
        };
        CpuRun {
            walls: Walls::new(scene, &state.frame),
            lists: Lists::new(scene, &state),
            loads: Vec::new(),
            drift: Drift::default(),
            step: 0,
            start_step: None,
            fault: None,
            params,
            state,
        }
    }

    fn advance(&self, runs: &mut [(&mut CpuRun, u64)]) -> Vec<Advance> {
        self.pool.install(|| runs.iter_mut().map(|(run, steps)| run.advance(*steps)).collect())
    }

    fn state<'a>(&self, run: &'a mut CpuRun) -> &'a State {
        &run.state
    }

    fn surface_forces(&self, run: &mut CpuRun) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; run.walls.surface_count()];
        for wall in run.lists.chunks.iter().flat_map(|chunk| chunk.all_walls()) {
            forces[run.walls.surface_of(wall.facet)] -= wall.force.as_dvec3();
        }
        forces
    }

    fn bonds(&self, run: &mut CpuRun) -> Vec<[u32; 2]> {
        let serials = &run.state.serials;
        let row = |i: usize| run.lists.chunks[i / CHUNK].pairs(i % CHUNK).iter().map(move |pair| (i, pair));
        (0..serials.len())
            .flat_map(row)
            .filter(|(i, pair)| pair.bond_class != 0 && *i < pair.other as usize)
            .map(|(i, pair)| [serials[i], serials[pair.other as usize]])
            .collect()
    }

    fn start(&self, run: &mut CpuRun) {
        run.start_step = Some(run.step);
        run.walls.drop_what_goes_at_start();
    }

    fn remove(&self, run: &mut CpuRun, serials: &[u32]) {
        let map = run.state.remove(serials);
        run.lists.remove(&map);
        run.drift.invalidate();
    }
}

impl CpuRun {
    fn advance(&mut self, steps: u64) -> Advance {
        let mut done = Advance::default();
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
    fn one_step(&mut self, done: &mut Advance) {
        let belt_time = self.start_step.map(|start| (self.step - start) as f64 * self.params.dt_exact);
        self.walls.pose(belt_time, &self.state.frame);
        if self.drift.exceeds(self.params.skin, &self.walls) {
            self.lists.rebuild(&self.params, &self.state, &self.walls);
            self.drift.restart(&self.state, &mut self.walls);
        }
        let mut broken = std::mem::take(&mut self.state.broken);
        let felt = forces::gather(
            &self.params,
            &self.state,
            &self.walls,
            &mut self.lists,
            &mut self.loads,
            &mut broken,
        );
        self.state.broken = broken;
        let moved = integrate::advance(&self.params, &mut self.state, &self.loads, &mut self.drift);
        self.state.bonds_broken += u64::from(felt.bonds_broken);
        self.step += 1;
        done.steps += 1;
        done.particle_steps += self.state.particles.len() as u64;
        done.max_overlap_m = done.max_overlap_m.max(felt.max_overlap);
        self.fault = moved.fault(&self.params, &self.state);
    }
}
