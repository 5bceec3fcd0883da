//! The engine: state, the stages of a step in their order, the backend's interface and the run loop.
//!
//! It knows neither experiments nor backends: an experiment hands it a [`scene::Scene`] and a
//! [`run::ExperimentMonitor`], a backend implements [`Backend`].

pub mod frame;
pub mod run;
pub mod scene;
pub mod state;

use glam::DVec3;
use scene::Scene;
use state::State;
use thiserror::Error;

/// What computes: recorded with every result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BackendInfo {
    /// Short name, such as `cpu`.
    pub name: String,
    /// Processor and instruction set, or graphics adapter.
    pub device: String,
    /// Threads.
    pub threads: usize,
}

/// What happened while a run was advanced.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AdvanceReport {
    /// Steps done.
    pub steps: u64,
    /// Sub-particle updates done.
    pub particle_steps: u64,
    /// Greatest overlap between sub-particles that no bond joins, in metres.
    pub max_overlap_m: f32,
    /// What made the run diverge, if it did: it stands still from then on.
    pub fault: Option<String>,
}

/// The device has no room for a run; in words. Nothing is wrong with the device, nor with what else runs on it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("no room on the device: {0}")]
pub struct OutOfDeviceMemory(pub String);

/// Carries out time steps for batches of independent runs. The stages of a step, in their order: *surfaces* are brought to
/// where they are, *neighbours* are looked up where they may have changed, *forces* are gathered, motion is *integrated*.
///
/// Advancing a run gives the same bits whatever else is in the batch, however many threads there are, and
/// however the steps are cut into chunks.
///
/// A backend whose device has no room for a run unwinds with [`OutOfDeviceMemory`], which [`crate::Computer::simulate`] catches: runs have no
/// use for errors of devices.
pub trait Backend {
    /// A run as this backend keeps it, on whatever device.
    type Run;

    /// What computes.
    fn info(&self) -> BackendInfo;

    /// Takes a scene in, at rest before t = 0.
    fn prepare(&self, scene: &Scene) -> Self::Run;

    /// Advances each run by its number of steps; a run that diverges stops at that step.
    fn advance(&self, runs: &mut [(&mut Self::Run, u64)]) -> Vec<AdvanceReport>;

    /// The state of a run, for observers.
    fn state<'a>(&self, run: &'a mut Self::Run) -> &'a State;

    /// The force on each surface of the scene in the last step, in newton; zero before the first.
    fn surface_forces(&self, run: &mut Self::Run) -> Vec<DVec3>;

    /// The bonds that hold, as pairs of serials, ascending.
    fn bonds(&self, run: &mut Self::Run) -> Vec<[u32; 2]>;

    /// Makes now t = 0: motions start, what was there only until the start goes.
    fn start(&self, run: &mut Self::Run);

    /// Takes sub-particles out of a run, by serial, ascending.
    fn remove(&self, run: &mut Self::Run, serials: &[u32]);
}
