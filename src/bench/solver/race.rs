//! Timing: a run that takes turns with others.

use std::time::Instant;

use anyhow::Result;
use roost_solver::cpu::stages::Stage;
use roost_solver::cpu::{Cpu, CpuRun};
use roost_solver::engine::Backend;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::beds::Bed;

/// What came out for one way of computing on one bed.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub(super) backend: &'static str,
    /// `plain`, or the instruction set of the fast path.
    pub(super) path: &'static str,
    /// Processor architecture and instructions, or graphics adapter.
    pub(super) device: String,
    pub(super) bed: String,
    pub(super) threads: usize,
    /// Runs at once.
    pub(super) batch: usize,
    /// At the start.
    pub(super) subparticles: usize,
    pub(super) contact_between_bonded: bool,
    /// Wall time, the median over turns.
    pub(super) ns_per_particle_step: f64,
    /// Of all the batch.
    pub(super) us_per_step: f64,
    pub(super) particle_steps_per_s: f64,
    /// What copying within the device's memory reads and writes in that time, in bytes.
    pub(super) bytes_copied_meanwhile: Option<f64>,
    /// From the fastest to the slowest turn, as a share of the median.
    pub(super) spread: f64,
    /// Share of the time of all threads that each stage took.
    #[serde(serialize_with = "as_object")]
    pub(super) stages: Vec<(&'static str, f64)>,
    /// Memory that the run took, lists and all, where the system tells and nothing was simulated to make the bed.
    pub(super) bytes_per_subparticle: Option<f64>,
}

fn as_object<S: serde::Serializer>(stages: &[(&'static str, f64)], to: S) -> Result<S::Ok, S::Error> {
    let object: Map<String, Value> =
        stages.iter().map(|(name, share)| ((*name).to_owned(), json!(share))).collect();
    object.serialize(to)
}

/// A run among others.
pub(super) struct Racer {
    path: &'static str,
    cpu: Cpu,
    run: CpuRun,
    bytes: Option<u64>,
    /// Nanoseconds a particle-step, of each turn.
    turns: Vec<f64>,
}

impl Racer {
    /// Brings a bed to where measuring begins.
    pub(super) fn new(bed: &Bed, path: &'static str, cpu: Cpu) -> Self {
        let before = resident_bytes();
        let run = bed.begun(&cpu);
        let taken = resident_bytes().zip(before).map(|(after, before)| after.saturating_sub(before));
        let bytes = taken.filter(|_| bed.is_fresh);
        Self { path, cpu, run, bytes, turns: Vec::new() }
    }

    /// Takes some steps.
    pub(super) fn turn(&mut self, steps: u64) -> Result<()> {
        let clock = Instant::now();
        let done = self.cpu.advance(&mut [(&mut self.run, steps)]).swap_remove(0);
        let spent = clock.elapsed().as_secs_f64();
        anyhow::ensure!(done.fault.is_none(), "the bed diverged: {}", done.fault.unwrap_or_default());
        self.turns.push(spent * 1e9 / done.particle_steps.max(1) as f64);
        Ok(())
    }

    /// What came out, after one more turn of `steps` that shows where the time goes: to measure that takes some.
    pub(super) fn row(mut self, bed: &Bed, steps: u64) -> Row {
        self.run.stages().measure(true);
        self.cpu.advance(&mut [(&mut self.run, steps)]);
        let (median, spread) = median(self.turns);
        let spent = Stage::ALL.map(|stage| self.run.stages().seconds(stage));
        let all = spent.iter().sum::<f64>().max(f64::MIN_POSITIVE);
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
            stages: Stage::ALL.iter().map(|stage| stage.name()).zip(spent.iter().map(|s| s / all)).collect(),
            bytes_per_subparticle: self.bytes.map(|bytes| bytes as f64 / bed.subparticles() as f64),
        }
    }
}

/// The median of some turns, and the way from the least to the greatest as a share of it.
pub(super) fn median(mut turns: Vec<f64>) -> (f64, f64) {
    turns.sort_by(f64::total_cmp);
    let median = turns[turns.len() / 2];
    (median, (turns[turns.len() - 1] - turns[0]) / median)
}

/// Memory of this process that is in use, in bytes.
fn resident_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().strip_suffix(" kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
