//! The GPU backend on a bed: how fast in batches, and whether it computes what the plain path does.

use std::time::Instant;

use anyhow::Result;
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::engine::state::State;
use roost_solver::gpu::{Gpu, GpuOptions};
use roost_solver::scenario;
use serde_json::json;

use super::beds::{Bed, Named};
use super::race::{Row, median};
use crate::exit::{BadInput, Exit};
use crate::ui;

/// Which graphics adapter, and how it is used.
#[derive(Debug, clap::Args)]
pub(super) struct GpuArgs {
    /// Runs at once on the GPU
    #[arg(long, value_delimiter = ',', default_values = ["1", "4", "16", "64"], value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) batches: Vec<u16>,
    #[command(flatten)]
    adapter: AdapterArgs,
}

/// Which graphics adapter.
#[derive(Debug, clap::Args)]
struct AdapterArgs {
    /// Part of the name of the graphics adapter to take, where there are several
    #[arg(long, value_name = "NAME")]
    device: Option<String>,
    /// Take an adapter that is software too; its rows say `software`, not `gpu`
    #[arg(long)]
    allow_software: bool,
}

impl AdapterArgs {
    fn open(&self) -> Result<Gpu> {
        let (device, allow_software) = (self.device.clone(), self.allow_software);
        let options = GpuOptions { device, allow_software, ..GpuOptions::default() };
        let gpu = Gpu::new(&options).map_err(|error| BadInput(error.to_string()))?;
        ui::say!("on {}", gpu.name());
        Ok(gpu)
    }
}

impl GpuArgs {
    /// Opens the adapter and measures how fast it copies.
    pub(super) fn open(&self) -> Result<GpuRacers> {
        let gpu = self.adapter.open()?;
        let copied_bytes_per_s = gpu.copied_bytes_per_s()?;
        ui::say!("copies, reads and writes added up, {:.3e} bytes/s", copied_bytes_per_s);
        Ok(GpuRacers { gpu, copied_bytes_per_s })
    }
}

/// An adapter that is measured.
pub(super) struct GpuRacers {
    gpu: Gpu,
    copied_bytes_per_s: f64,
}

impl GpuRacers {
    /// Times batches of copies of a bed.
    pub(super) fn race(
        &self,
        bed: &Bed,
        batches: &[u16],
        repeats: u32,
        steps: u64,
        stop: &dyn Fn() -> bool,
    ) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        for &batch in batches {
            let mut runs = bed.begun_together(&self.gpu, batch);
            let mut turns = Vec::new();
            for turn in 0..repeats {
                if stop() {
                    return Ok(rows);
                }
                ui::say!("{}: batch of {batch}, turn {} of {repeats}", bed.name, turn + 1);
                let clock = Instant::now();
                let mut all: Vec<_> = runs.iter_mut().map(|run| (run, steps)).collect();
                let done = self.gpu.advance(&mut all);
                let spent = clock.elapsed().as_secs_f64();
                let fault = done.iter().find_map(|done| done.fault.clone());
                anyhow::ensure!(fault.is_none(), "the bed diverged: {}", fault.unwrap_or_default());
                turns.push(
                    spent * 1e9 / done.iter().map(|done| done.particle_steps).sum::<u64>().max(1) as f64,
                );
            }
            rows.push(self.row(bed, batch, median(turns)));
        }
        Ok(rows)
    }

    fn row(&self, bed: &Bed, batch: u16, (median, spread): (f64, f64)) -> Row {
        Row {
            // Nothing that software has done is ever called a GPU's.
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

/// Compare what a graphics adapter computes with the plain path, step by step
///
/// Both take the same steps from fillets at rest. An adapter that rounds every operation by itself gives the same bits; one that
/// fuses them strays by roundings, which grow as in any pile of grains. Fails where they are further apart than that.
#[derive(Debug, clap::Args)]
pub(crate) struct ParityArgs {
    #[command(flatten)]
    adapter: AdapterArgs,
    /// Sub-particles of the bed, about
    #[arg(long, default_value_t = 5000, value_name = "N", value_parser = clap::value_parser!(u64).range(1000..=2_000_000))]
    subparticles: u64,
    /// Steps that both take
    #[arg(long, default_value_t = 300, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    steps: u64,
    /// How far apart a sub-particle may be on the two in the end, in metres
    #[arg(long, default_value_t = 1e-6, value_name = "M")]
    tolerance_m: f64,
}

/// Steps between two looks.
const LOOK_EVERY: u64 = 10;

/// Runs the comparison.
pub(crate) fn parity(args: &ParityArgs) -> Result<Exit> {
    let gpu = args.adapter.open()?;
    let laws = scenario::from_value(&json!({"experiment": "hopper"})).expect("the default scenario");
    let most = std::thread::available_parallelism().map_or(1, usize::from);
    ui::say!("settling");
    let bed = Bed::settled(Named::Hopper, &laws, args.subparticles, most)?;
    let plain = Cpu::plain(0);
    let (mut reference, mut run) = (plain.prepare(&bed.scene), gpu.prepare(&bed.scene));
    plain.start(&mut reference);
    gpu.start(&mut run);
    let (mut same_until, mut apart_m, mut step) = (0, 0.0, 0);
    while step < args.steps {
        let steps = LOOK_EVERY.min(args.steps - step);
        let expected = plain.advance(&mut [(&mut reference, steps)]).swap_remove(0);
        let found = gpu.advance(&mut [(&mut run, steps)]).swap_remove(0);
        anyhow::ensure!(expected.fault == found.fault, "{:?} and not {:?}", found.fault, expected.fault);
        step += steps;
        let (a, b) = (plain.state(&mut reference), gpu.state(&mut run));
        apart_m = distance_m(a, b);
        if same_until + steps == step && is_same(a, b) {
            same_until = step;
        }
    }
    let close = apart_m <= args.tolerance_m;
    ui::json(&json!({
        "device": gpu.info().device,
        "is_software": gpu.name().is_software,
        "subparticles": bed.subparticles(),
        "steps": step,
        "same_bits_until_step": same_until,
        "farthest_apart_m": apart_m,
        "is_within_tolerance": close,
    }))?;
    Ok(if close { Exit::Done } else { Exit::Failed })
}

/// How far apart the same sub-particle is in two states at most, in metres.
fn distance_m(a: &State, b: &State) -> f64 {
    let apart = |i| (a.position(i) - b.position(i)).length();
    (0..a.particles.len()).map(apart).fold(0.0, f64::max)
}

/// Whether all bits of motion are the same.
fn is_same(a: &State, b: &State) -> bool {
    let bits = |state: &State| -> Vec<_> {
        let of = |v: glam::Vec3| v.to_array().map(f32::to_bits);
        state.particles.iter().map(|p| (p.position, of(p.velocity), of(p.spin))).collect()
    };
    bits(a) == bits(b)
}
