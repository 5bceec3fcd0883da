//! Timing of the GPU backend in batches, and its comparison with the plain path.

use std::time::Instant;

use anyhow::Result;
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::engine::state::State;
use roost_solver::gpu::{Gpu, GpuOptions};
use roost_solver::scenario;
use roost_terminal::{BadInput, Exit, message, print_json, threads};
use serde_json::json;

use super::beds::{Bed, BedKind};
use super::timing::{Row, median};

/// Options of the path `gpu`.
#[derive(Debug, clap::Args)]
pub(super) struct GpuArgs {
    /// Numbers of runs that the GPU computes together as one batch. The command measures each number
    #[arg(long, value_delimiter = ',', default_values = ["1", "4", "16", "64"], value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) batches: Vec<u16>,
    #[command(flatten)]
    adapter: AdapterArgs,
}

/// The graphics adapter.
#[derive(Debug, clap::Args)]
struct AdapterArgs {
    /// Graphics adapter (GPU) to use, if the machine has several adapters: a part of its name is enough
    #[arg(long, value_name = "NAME")]
    device: Option<String>,
    /// Accept an adapter that software emulates. The rows of this adapter have the backend `software`
    #[arg(long)]
    allow_software: bool,
}

impl AdapterArgs {
    fn open(&self) -> Result<Gpu> {
        let (device, allow_software) = (self.device.clone(), self.allow_software);
        let options = GpuOptions { device, allow_software, ..GpuOptions::default() };
        let gpu = Gpu::new(&options).map_err(|error| BadInput(error.to_string()))?;
        message!("adapter: {}", gpu.name());
        Ok(gpu)
    }
}

impl GpuArgs {
    /// Opens the adapter and measures how fast it copies.
    pub(super) fn open(&self) -> Result<GpuTimer> {
        let gpu = self.adapter.open()?;
        let copied_bytes_per_s = gpu.copied_bytes_per_s()?;
        message!("copies within its memory: {copied_bytes_per_s:.3e} bytes/s read and written");
        Ok(GpuTimer { gpu, copied_bytes_per_s })
    }
}

/// An adapter whose speed of copying is known.
pub(super) struct GpuTimer {
    gpu: Gpu,
    copied_bytes_per_s: f64,
}

impl GpuTimer {
    /// Times batches of equal runs.
    pub(super) fn time(
        &self,
        bed: &Bed,
        batches: &[u16],
        repeats: u32,
        steps: u64,
        should_stop: &dyn Fn() -> bool,
    ) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        for &batch in batches {
            let mut runs = bed.warmed_up_runs(&self.gpu, batch);
            let mut turns = Vec::new();
            for turn in 0..repeats {
                if should_stop() {
                    return Ok(rows);
                }
                message!("{}: batch of {batch}, turn {} of {repeats}", bed.name, turn + 1);
                let started = Instant::now();
                let mut batch_runs: Vec<_> = runs.iter_mut().map(|run| (run, steps)).collect();
                let done = self.gpu.advance(&mut batch_runs);
                let wall_s = started.elapsed().as_secs_f64();
                let fault = done.iter().find_map(|done| done.fault.clone());
                anyhow::ensure!(fault.is_none(), "the bed diverged: {}", fault.unwrap_or_default());
                turns.push(
                    wall_s * 1e9 / done.iter().map(|done| done.particle_steps).sum::<u64>().max(1) as f64,
                );
            }
            rows.push(self.row(bed, batch, median(turns)));
        }
        Ok(rows)
    }

    fn row(&self, bed: &Bed, batch: u16, (median, spread): (f64, f64)) -> Row {
        Row {
            // The time of a software adapter is not the time of a GPU.
            backend: if self.gpu.name().is_software { "software" } else { "gpu" },
            path: if self.gpu.name().is_software { "software" } else { "gpu" },
            device: self.gpu.info().device,
            bed: bed.name.clone(),
            threads: 1,
            batch: batch.into(),
            subparticles: bed.subparticles(),
            contact_between_bonded: bed.scene.laws.contact_between_bonded,
            ns_per_particle_step: median,
            us_per_step: median * bed.subparticles() as f64 * f64::from(batch) / 1e3,
            particle_steps_per_s: 1e9 / median,
            bytes_copied_meanwhile: Some(median * 1e-9 * self.copied_bytes_per_s),
            spread,
            stages: Vec::new(),
            bytes_per_subparticle: None,
        }
    }
}

/// Compare a graphics adapter (GPU) with the reference code of the solver (the plain path), step by step
///
/// The reference code runs on the CPU. The adapter and the plain path compute the same steps, starting
/// from fillets at rest. Some adapters round the result of every operation. Their results have the same bits as the results of the
/// plain path. Other adapters combine two operations into one, with only one rounding. Their results differ from the plain path by
/// rounding errors, which grow with time. If the difference after the last step is larger than the tolerance, the command fails.
#[derive(Debug, clap::Args)]
pub(crate) struct ParityArgs {
    #[command(flatten)]
    adapter: AdapterArgs,
    /// Approximate number of sub-particles of the bed
    #[arg(long, default_value_t = 5000, value_name = "N", value_parser = clap::value_parser!(u64).range(1000..=2_000_000))]
    subparticles: u64,
    /// Number of steps
    #[arg(long, default_value_t = 300, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    steps: u64,
    /// Maximum distance between the position of a sub-particle on the adapter and its position on the plain path, after the last step, in metres
    #[arg(long, default_value_t = 1e-6, value_name = "M")]
    tolerance_m: f64,
}

/// Steps between two comparisons.
const COMPARISON_INTERVAL: u64 = 10;

/// Runs the comparison.
pub(crate) fn parity(args: &ParityArgs) -> Result<Exit> {
    let gpu = args.adapter.open()?;
    let scenario = scenario::from_value(&json!({"experiment": "hopper"})).expect("the default scenario");
    message!("settling");
    let bed = Bed::settled(BedKind::Hopper, &scenario, args.subparticles, threads::count(0))?;
    let plain = Cpu::plain(0);
    let (mut reference, mut run) = (plain.prepare(&bed.scene), gpu.prepare(&bed.scene));
    plain.start(&mut reference);
    gpu.start(&mut run);
    let (mut same_until, mut distance_m, mut step) = (0, 0.0, 0);
    while step < args.steps {
        let steps = COMPARISON_INTERVAL.min(args.steps - step);
        let expected = plain.advance(&mut [(&mut reference, steps)]).swap_remove(0);
        let actual = gpu.advance(&mut [(&mut run, steps)]).swap_remove(0);
        anyhow::ensure!(expected.fault == actual.fault, "{:?} and not {:?}", actual.fault, expected.fault);
        step += steps;
        let (a, b) = (plain.state(&mut reference), gpu.state(&mut run));
        distance_m = maximum_distance_m(a, b);
        if same_until + steps == step && has_same_bits(a, b) {
            same_until = step;
        }
    }
    let is_within_tolerance = distance_m <= args.tolerance_m;
    print_json(&json!({
        "device": gpu.info().device,
        "is_software": gpu.name().is_software,
        "subparticles": bed.subparticles(),
        "steps": step,
        "same_bits_until_step": same_until,
        "farthest_apart_m": distance_m,
        "is_within_tolerance": is_within_tolerance,
    }))?;
    Ok(if is_within_tolerance { Exit::Done } else { Exit::Failed })
}

/// Maximum distance between the positions of the same sub-particle in two states, in metres.
fn maximum_distance_m(a: &State, b: &State) -> f64 {
    let distance = |i| (a.position(i) - b.position(i)).length();
    (0..a.particles.len()).map(distance).fold(0.0, f64::max)
}

/// Whether positions, velocities and spins have the same bits.
fn has_same_bits(a: &State, b: &State) -> bool {
    let bits = |state: &State| -> Vec<_> {
        let bits_of = |v: glam::Vec3| v.to_array().map(f32::to_bits);
        state.particles.iter().map(|p| (p.position, bits_of(p.velocity), bits_of(p.spin))).collect()
    };
    bits(a) == bits(b)
}
