//! The engine: state, the order of the stages of a step, the backend interface and the run loop.
//!
//! It knows neither experiments nor backends. An experiment provides a [`scene::Scene`] and a
//! [`run::ExperimentMonitor`]; a backend implements [`Backend`].

pub mod checkpoint;
mod columns;
pub mod frame;
pub mod run;
pub mod saved;
pub mod saved_fields;
pub mod scene;
pub mod simulation;
pub mod state;
mod timeline;
pub mod wall_pair;

use glam::DVec3;
use saved::SavedRun;
use scene::{Placement, Scene};
use state::State;
use thiserror::Error;

/// The backend and its device, recorded with every result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BackendInfo {
    /// Short name, such as `cpu`.
    pub name: String,
    /// Processor and instruction set, or graphics adapter.
    pub device: String,
    /// Number of threads.
    pub threads: usize,
}

/// Outcome of a call of [`Backend::advance`] for one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AdvanceReport {
    /// Steps done.
    pub steps: u64,
    /// Sub-particle updates done.
    pub particle_steps: u64,
    /// Maximum overlap between sub-particles without a bond, in metres.
    pub max_overlap_m: f32,
    /// How often a sub-particle has passed through a surface (see [`crate::walls`]).
    pub passed_through: u64,
    /// Reason of a divergence. A run that diverged stays at that step.
    pub fault: Option<String>,
}

/// Force and torque on a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceLoad {
    /// In newton.
    pub force: DVec3,
    /// About the origin of coordinates, in N m.
    pub torque: DVec3,
}

impl SurfaceLoad {
    /// The torque about another point, given in metres; in N m.
    pub fn torque_about(&self, point: DVec3) -> DVec3 {
        self.torque - point.cross(self.force)
    }
}

/// The device has too little memory for a run, with details. The device itself and its other runs are sound.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("no room on the device: {0}")]
pub struct OutOfDeviceMemory(pub String);

/// Advances batches of independent runs.
///
/// The stages of a step, in order: move *surfaces*, update *neighbour lists* where they may be stale, gather
/// *forces*, *integrate* motion.
///
/// The bits of a run do not depend on the rest of the batch, the number of threads, or the chunks of steps.
///
/// A backend whose device has too little memory unwinds with [`OutOfDeviceMemory`].
/// [`crate::Computer::simulate`] catches it, so that code between the two needs no error path for devices.
pub trait Backend {
    /// A run in the form of this backend, on its device.
    type Run;

    /// The backend and its device.
    fn info(&self) -> BackendInfo;

    /// Takes in a scene, at rest before t = 0.
    fn prepare(&self, scene: &Scene) -> Self::Run;

    /// Advances each run by its number of steps; a run that diverges stops at that step.
    fn advance(&self, runs: &mut [(&mut Self::Run, u64)]) -> Vec<AdvanceReport>;

    /// The state of a run, for observers.
    fn state<'a>(&self, run: &'a mut Self::Run) -> &'a State;

    /// The load on each surface of the scene in the last step; zero before the first.
    fn surface_loads(&self, run: &mut Self::Run) -> Vec<SurfaceLoad>;

    /// The force on each surface of the scene in the last step, in newton; zero before the first.
    fn surface_forces(&self, run: &mut Self::Run) -> Vec<DVec3> {
        self.surface_loads(run).iter().map(|load| load.force).collect()
    }

    /// Intact bonds, as pairs of serials, ascending.
    fn bonds(&self, run: &mut Self::Run) -> Vec<[u32; 2]>;

    /// Sets t = 0: motions start, and surfaces present until the start disappear.
    fn start(&self, run: &mut Self::Run);

    /// Appends bodies of the run's scene, numbered from `first` on, at these places.
    fn enter(&self, run: &mut Self::Run, scene: &Scene, first: usize, bodies: &[Placement]);

    /// Removes sub-particles from a run, by serial, ascending.
    fn remove(&self, run: &mut Self::Run, serials: &[u32]);

    /// The state on which later steps of a run depend.
    fn save(&self, run: &mut Self::Run) -> SavedRun;

    /// A run of a scene that goes on from there: its later bits are those of the run that was saved.
    fn restore(&self, scene: &Scene, saved: &SavedRun) -> Self::Run;
}
