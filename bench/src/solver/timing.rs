//! Timing of runs that take turns.

use std::time::Instant;

use anyhow::Result;
use roost_solver::cpu::stages::Stage;
use roost_solver::cpu::{Cpu, CpuRun};
use roost_solver::engine::Backend;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::beds::Bed;

/// The result of one path on one bed.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub(super) backend: &'static str,
    /// `plain`, or the instruction set of the fast path.
    pub(super) path: &'static str,
    /// Processor architecture and instructions, or graphics adapter.
    pub(super) device: String,
    pub(super) bed: String,
    pub(super) threads: usize,
    /// Number of runs that advance together.
    pub(super) batch: usize,
    /// Number at the start.
    pub(super) subparticles: usize,
    pub(super) contact_between_bonded: bool,
    /// Wall time, median over turns.
    pub(super) ns_per_particle_step: f64,
    /// Wall time of the whole batch, median over turns.
    pub(super) us_per_step: f64,
    pub(super) particle_steps_per_s: f64,
    /// Bytes that a copy within the device's memory reads and writes in the time of a particle-step.
    pub(super) bytes_copied_meanwhile: Option<f64>,
    /// Slowest less fastest turn, as a share of the median.
    pub(super) spread: f64,
    /// Share of each stage in the time of all threads.
    #[serde(serialize_with = "as_object")]
    pub(super) stages: Vec<(&'static str, f64)>,
    /// Memory of the run with its lists. None if the system does not report it, or if the bed has been simulated before.
    pub(super) bytes_per_subparticle: Option<f64>,
}

fn as_object<S: serde::Serializer>(stages: &[(&'static str, f64)], to: S) -> Result<S::Ok, S::Error> {
    let object: Map<String, Value> =
        stages.iter().map(|(name, share)| ((*name).to_owned(), json!(share))).collect();
    object.serialize(to)
}

/// A run that takes turns with others.
pub(super) struct TimedRun {
    path: &'static str,
    cpu: Cpu,
    run: CpuRun,
    bytes: Option<u64>,
    /// Nanoseconds per particle-step of each turn.
    turns: Vec<f64>,
}

impl TimedRun {
    /// A run that has warmed up.
    pub(super) fn new(bed: &Bed, path: &'static str, cpu: Cpu) -> Self {
        let before = resident_bytes();
        let run = bed.warmed_up_run(&cpu);
        let used = resident_bytes().zip(before).map(|(after, before)| after.saturating_sub(before));
        let bytes = used.filter(|_| !bed.is_simulated);
        Self { path, cpu, run, bytes, turns: Vec::new() }
    }

    /// Times one turn.
    pub(super) fn turn(&mut self, steps: u64) -> Result<()> {
        let started = Instant::now();
        let done = self.cpu.advance(&mut [(&mut self.run, steps)]).swap_remove(0);
        let wall_s = started.elapsed().as_secs_f64();
        anyhow::ensure!(done.fault.is_none(), "the bed diverged: {}", done.fault.unwrap_or_default());
        self.turns.push(wall_s * 1e9 / done.particle_steps.max(1) as f64);
        Ok(())
    }

    /// The result. The shares of stages come from one more turn, since their measurement takes time itself.
    pub(super) fn row(mut self, bed: &Bed, steps: u64) -> Row {
        self.run.stages().measure(true);
        self.cpu.advance(&mut [(&mut self.run, steps)]);
        let (median, spread) = median(self.turns);
        let stage_s = Stage::ALL.map(|stage| self.run.stages().seconds(stage));
        let total_s = stage_s.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        Row {
            backend: "cpu",
            path: self.path,
            device: self.cpu.info().device,
            bed: bed.name.clone(),
            threads: self.cpu.info().threads,
            batch: 1,
            subparticles: bed.subparticles(),
            contact_between_bonded: bed.scene.laws.contact_between_bonded,
            ns_per_particle_step: median,
            us_per_step: median * bed.subparticles() as f64 / 1e3,
            particle_steps_per_s: 1e9 / median,
            bytes_copied_meanwhile: None,
            spread,
            stages: Stage::ALL
                .iter()
                .map(|stage| stage.name())
                .zip(stage_s.iter().map(|s| s / total_s))
                .collect(),
            bytes_per_subparticle: self.bytes.map(|bytes| bytes as f64 / bed.subparticles() as f64),
        }
    }
}

/// The median of the turns, and maximum less minimum as a share of it.
pub(super) fn median(mut turns: Vec<f64>) -> (f64, f64) {
    turns.sort_by(f64::total_cmp);
    let median = turns[turns.len() / 2];
    (median, (turns[turns.len() - 1] - turns[0]) / median)
}

/// Resident memory of this process in bytes.
fn resident_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().strip_suffix(" kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
