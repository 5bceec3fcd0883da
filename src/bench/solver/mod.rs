//! `roost bench solver`: how fast the solver is here, on beds that others can be timed on too.
//!
//! [`beds`] makes what is simulated, [`race`] times it, `gpu` does so on graphics adapters and compares what they compute.

mod beds;
#[cfg(feature = "gpu")]
pub(super) mod gpu;
mod race;

use std::path::{Path, PathBuf};

use anyhow::Result;
use roost_solver::cpu::Cpu;
use roost_solver::cpu::fast::InstructionSet;
use roost_solver::scenario::{self, Scenario};
use roost_worker::device::Device;
use serde_json::json;

use crate::exit::{BadInput, Exit};
use crate::ui;
use crate::ui::format::significant;
use crate::ui::table::Table;
use crate::work::{say_threads, threads};
use crate::{input, signals};
use beds::{Bed, Named};
use race::{Racer, Row};

/// Time the solver's particle-steps
///
/// Every way of computing takes turns on the same bed, so that what else the machine does hits all alike. Ratios of one run tell
/// something; a figure by itself belongs to its machine.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Beds to time
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["loose", "bonded", "hopper"])]
    beds: Vec<Named>,
    /// Sub-particles of a bed, about
    #[arg(long, default_value_t = 41_000, value_name = "N", value_parser = clap::value_parser!(u64).range(1000..=2_000_000))]
    subparticles: u64,
    /// Numbers of threads; 0 means one per processor [default: 1,0]
    #[arg(long, value_delimiter = ',', default_values = ["1", "0"], hide_default_value = true, value_name = "N", value_parser = threads())]
    threads: Vec<u16>,
    /// Ways to compute: `plain`, `fast` (the widest instructions of this machine), names of instruction sets, or `gpu`
    #[arg(long, value_delimiter = ',', default_values = ["fast"], value_name = "PATH")]
    paths: Vec<String>,
    #[cfg(feature = "gpu")]
    #[command(flatten)]
    gpu: gpu::GpuArgs,
    /// Without contact between bonded neighbours, as other codes have it
    #[arg(long)]
    without_contact_between_bonded: bool,
    /// Turns that each takes
    #[arg(long, default_value_t = 7, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Steps of a turn
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    steps: u64,
    /// A bed of one's own instead: lines of `id x y z`, in metres
    #[arg(long, value_name = "FILE")]
    bed: Option<PathBuf>,
    /// Its bonds: lines of `i j`, numbers of lines of the bed, from 1
    #[arg(long, value_name = "FILE", requires = "bed")]
    bonds: Option<PathBuf>,
    /// A scenario whose sub-particles, material, bonds, contacts and time step the beds take; sub-particles have 4 mm without one
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Write the settled bed as `NAME.csv` and `NAME_bonds.csv` into this folder, and time nothing
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
    /// Print JSON, one row a bed, way and number of threads
    #[arg(long)]
    json: bool,
}

pub(super) async fn execute(args: Args) -> Result<Exit> {
    let shutdown = signals::shutdown()?;
    tokio::task::spawn_blocking(move || solver(&args, &|| shutdown.is_cancelled())).await?
}

fn solver(args: &Args, stop: &dyn Fn() -> bool) -> Result<Exit> {
    let scenario = laws(args)?;
    if args.write.is_some() && scenario.bonds.types != 2 {
        let text = "--write: the scenario's /bonds/types is 1; must be 2, since a file of bonds does not tell which are longer";
        return Err(BadInput(text.to_owned()).into());
    }
    let paths: Vec<Way> = args.paths.iter().map(|name| Way::named(name)).collect::<Result<_>>()?;
    // Before beds settle, which takes a while.
    #[cfg(feature = "gpu")]
    let gpu = paths.iter().any(|path| matches!(path, Way::Gpu)).then(|| args.gpu.open()).transpose()?;
    let most = std::thread::available_parallelism().map_or(1, usize::from);
    args.threads.iter().for_each(|&asked| say_threads(asked, &Device::cpu()));
    let mut threads: Vec<usize> = args.threads.iter().map(|&n| roost_worker::threads(n.into())).collect();
    threads.dedup();
    let mut rows: Vec<Row> = Vec::new();
    let names = if args.bed.is_some() { &[][..] } else { &args.beds[..] };
    let own = args.bed.iter().map(|file| Bed::read(file, args.bonds.as_deref(), &scenario));
    let named = names.iter().map(|name| {
        ui::say!("{}: settling", name.name());
        Bed::settled(*name, &scenario, args.subparticles, most)
    });
    for bed in own.chain(named) {
        let bed = bed?;
        if let Some(folder) = &args.write {
            bed.write(folder)?;
            continue;
        }
        let racers =
            threads.iter().flat_map(|&threads| paths.iter().filter_map(move |path| path.cpu(threads)));
        let mut racers: Vec<Racer> = racers.map(|(name, cpu)| Racer::new(&bed, name, cpu)).collect();
        for turn in 0..args.repeats {
            ui::say!("{}: turn {} of {}", bed.name, turn + 1, args.repeats);
            for racer in &mut racers {
                if stop() {
                    return Ok(Exit::Failed);
                }
                racer.turn(args.steps)?;
            }
        }
        rows.extend(racers.into_iter().map(|racer| racer.row(&bed, args.steps)));
        #[cfg(feature = "gpu")]
        if let Some(gpu) = &gpu {
            let race = || gpu.race(&bed, &args.gpu.batches, args.repeats, args.steps, stop);
            rows.extend(roost_solver::gpu::catch_out_of_memory(race)??);
        }
    }
    if args.json {
        ui::json(&json!(rows))?;
    } else if args.write.is_none() {
        ui::print(format_args!("{}\n", table(&rows)))?;
    }
    Ok(Exit::Done)
}

/// The scenario that beds take their laws from.
fn laws(args: &Args) -> Result<Scenario> {
    let bad = |file: &Path, faults: Vec<_>| input::faults(file, &faults);
    let mut document = match &args.scenario {
        Some(file) => input::read(file)?,
        None => json!({"experiment": "hopper"}),
    };
    if args.without_contact_between_bonded {
        document["bonds"]["contact_between_bonded"] = json!(false);
    }
    let file = args.scenario.clone().unwrap_or_else(|| "the built-in scenario".into());
    let scenario = scenario::from_value(&document).map_err(|faults| bad(&file, faults))?;
    if scenario.equipment().is_none() {
        return Err(
            BadInput("beds take their laws from a scenario of the experiment \"hopper\"".to_owned()).into()
        );
    }
    Ok(scenario)
}

/// A way to compute.
#[derive(Clone, Copy, Debug)]
enum Way {
    Plain,
    Fast(InstructionSet),
    #[cfg(feature = "gpu")]
    Gpu,
}

impl Way {
    fn named(name: &str) -> Result<Self> {
        let sets = InstructionSet::available();
        let found = match name {
            "plain" => Some(Self::Plain),
            #[cfg(feature = "gpu")]
            "gpu" => Some(Self::Gpu),
            "fast" => Some(Self::Fast(InstructionSet::widest())),
            _ => sets.iter().find(|set| set.name() == name).map(|set| Self::Fast(*set)),
        };
        let names: Vec<_> = sets.iter().map(|set| set.name()).collect();
        found.ok_or_else(|| {
            BadInput(format!("--paths {name}: must be among plain, fast, {}, gpu", names.join(", "))).into()
        })
    }

    /// Its name and what computes, where that is the CPU.
    fn cpu(self, threads: usize) -> Option<(&'static str, Cpu)> {
        match self {
            Self::Plain => Some(("plain", Cpu::plain(threads))),
            Self::Fast(set) => Some((set.name(), Cpu::fast(threads, set))),
            #[cfg(feature = "gpu")]
            Self::Gpu => None,
        }
    }
}

fn table(rows: &[Row]) -> Table {
    let header = [
        "bed",
        "sub-particles",
        "bonded contact",
        "path",
        "threads",
        "batch",
        "µs per step",
        "ns per particle-step",
        "± %",
        "bytes each",
    ];
    let mut table = Table::new(header.into_iter().chain(["where the time goes (%)"]));
    for row in rows {
        let shares: Vec<String> =
            row.stages.iter().map(|(name, share)| format!("{name} {:.0}", 100.0 * share)).collect();
        table.row([
            row.bed.clone(),
            row.subparticles.to_string(),
            if row.contact_between_bonded { "on" } else { "off" }.to_owned(),
            row.path.to_owned(),
            row.threads.to_string(),
            row.batch.to_string(),
            significant(row.us_per_step),
            significant(row.ns_per_particle_step),
            format!("{:.0}", 50.0 * row.spread),
            row.bytes_per_subparticle.map_or_else(|| "–".to_owned(), |bytes| format!("{bytes:.0}")),
            shares.join(", "),
        ]);
    }
    table
}
