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
    pub(super) bed: String,
    pub(super) threads: usize,
    /// At the start.
    pub(super) subparticles: usize,
    pub(super) contact_between_bonded: bool,
    /// Wall time, the median over turns.
    pub(super) ns_per_particle_step: f64,
    /// From the fastest to the slowest turn, as a share of the median.
    pub(super) spread: f64,
    /// Share of the time of all threads that each stage took.
    #[serde(serialize_with = "as_object")]
    pub(super) stages: Vec<(&'static str, f64)>,
    /// Memory that the run took, where the system tells.
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
        let bytes = resident_bytes().zip(before).map(|(after, before)| after.saturating_sub(before));
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
        self.turns.sort_by(f64::total_cmp);
        let (first, last) = (self.turns[0], self.turns[self.turns.len() - 1]);
        let median = self.turns[self.turns.len() / 2];
        let spent = Stage::ALL.map(|stage| self.run.stages().seconds(stage));
        let all = spent.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        Row {
            backend: "cpu",
            path: self.path,
            bed: bed.name.clone(),
            threads: self.cpu.info().threads,
            subparticles: bed.subparticles(),
            contact_between_bonded: bed.scene.laws.contact_between_bonded,
            ns_per_particle_step: median,
            spread: (last - first) / median,
            stages: Stage::ALL.iter().map(|stage| stage.name()).zip(spent.iter().map(|s| s / all)).collect(),
            bytes_per_subparticle: self.bytes.map(|bytes| bytes as f64 / bed.subparticles() as f64),
        }
    }
}

/// Memory of this process that is in use, in bytes.
fn resident_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().strip_suffix(" kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
