//! `roost bench solver`: time per particle-step, on beds that other programs can be timed on too.
//!
//! [`beds`] makes the beds, [`timing`] times runs on the CPU; `gpu` times a graphics adapter and compares it with the plain path.

mod beds;
#[cfg(feature = "gpu")]
pub(super) mod gpu;
mod timing;

use std::path::{Path, PathBuf};

use anyhow::Result;
use roost_solver::cpu::Cpu;
use roost_solver::cpu::fast::InstructionSet;
use roost_solver::scenario::{self, Scenario};
use roost_terminal::format::significant;
use roost_terminal::{BadInput, Exit, Table, input, message, print_json, print_lines, signals, threads};
use serde_json::json;

use beds::{Bed, BedKind};
use timing::{Row, TimedRun};

/// Measure the speed of the solver in particle-steps per second
///
/// A particle-step is one time step of one sub-particle. A bed is a set of sub-particles in contact. A path is one of the codes of
/// the solver: `plain` is the simple reference code, `fast` uses the vector instructions of the processor, and `gpu` uses a graphics
/// adapter. The command measures the paths in turn on the same bed, so that other load on the machine affects all paths equally.
/// Absolute times depend on the machine. Therefore compare only ratios of times from the same run of this command.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Beds to measure
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["loose", "bonded", "hopper"])]
    beds: Vec<BedKind>,
    /// Approximate number of sub-particles of a bed
    #[arg(long, default_value_t = 41_000, value_name = "N", value_parser = clap::value_parser!(u64).range(1000..=2_000_000))]
    subparticles: u64,
    /// Numbers of threads, separated by commas. The command measures each number; 0 means one thread per processor [default: 1,0]
    #[arg(long, value_delimiter = ',', default_values = ["1", "0"], hide_default_value = true, value_name = "N", value_parser = threads::value_parser())]
    threads: Vec<u16>,
    /// Paths of the solver to measure, separated by commas: `plain`, `fast`, `gpu`, or the name of an instruction set. `fast` uses
    /// the widest vector instructions of this machine
    #[arg(long, value_delimiter = ',', default_values = ["fast"], value_name = "PATH")]
    paths: Vec<String>,
    #[cfg(feature = "gpu")]
    #[command(flatten)]
    gpu: gpu::GpuArgs,
    /// Compute no contact between sub-particles that a bond joins. Other programs do the same
    #[arg(long)]
    without_contact_between_bonded: bool,
    /// Number of turns; each path runs once in each turn
    #[arg(long, default_value_t = 7, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Number of time steps per turn
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    steps: u64,
    /// File with the bed to measure, instead of the beds of --beds. Each line is `id x y z`, with the position in metres
    #[arg(long, value_name = "FILE")]
    bed: Option<PathBuf>,
    /// File with the bonds of the bed. Each line is `i j`, where i and j are line numbers in the file of --bed, counted from 1
    #[arg(long, value_name = "FILE", requires = "bed")]
    bonds: Option<PathBuf>,
    /// Scenario of the experiment `hopper`, from which the beds take their sub-particles, material, bonds, contacts and time step.
    /// The default scenario has sub-particles of 4 mm radius
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Measure nothing. Write each settled bed as `NAME.csv` and `NAME_bonds.csv` into this folder
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
    /// Print JSON: one row for each combination of bed, path and number of threads
    #[arg(long)]
    json: bool,
}

pub(super) async fn execute(args: Args) -> Result<Exit> {
    let shutdown = signals::shutdown_token()?;
    tokio::task::spawn_blocking(move || solver(&args, &|| shutdown.is_cancelled())).await?
}

fn solver(args: &Args, should_stop: &dyn Fn() -> bool) -> Result<Exit> {
    let scenario = read_scenario(args)?;
    if args.write.is_some() && scenario.bonds.types != 2 {
        let text = "--write: the scenario's /bonds/types is 1; must be 2, since a file of bonds does not have their lengths";
        return Err(BadInput(text.to_owned()).into());
    }
    let paths: Vec<SolverPath> =
        args.paths.iter().map(|name| SolverPath::parse(name)).collect::<Result<_>>()?;
    // A missing adapter is an error before beds settle, which takes a while.
    #[cfg(feature = "gpu")]
    let gpu =
        paths.iter().any(|path| matches!(path, SolverPath::Gpu)).then(|| args.gpu.open()).transpose()?;
    args.threads.iter().for_each(|&requested| threads::warn_if_too_many(requested));
    let mut thread_counts: Vec<usize> = args.threads.iter().map(|&n| threads::count(n)).collect();
    thread_counts.dedup();
    let mut rows: Vec<Row> = Vec::new();
    let kinds = if args.bed.is_some() { &[][..] } else { &args.beds[..] };
    let read = args.bed.iter().map(|file| Bed::read(file, args.bonds.as_deref(), &scenario));
    let settled = kinds.iter().map(|kind| {
        message!("{}: settling", kind.name());
        Bed::settled(*kind, &scenario, args.subparticles, threads::count(0))
    });
    for bed in read.chain(settled) {
        let bed = bed?;
        if let Some(folder) = &args.write {
            bed.write(folder)?;
            continue;
        }
        let cpus =
            thread_counts.iter().flat_map(|&threads| paths.iter().filter_map(move |path| path.cpu(threads)));
        let mut runs: Vec<TimedRun> = cpus.map(|(name, cpu)| TimedRun::new(&bed, name, cpu)).collect();
        for turn in 0..args.repeats {
            message!("{}: turn {} of {}", bed.name, turn + 1, args.repeats);
            for run in &mut runs {
                if should_stop() {
                    return Ok(Exit::Failed);
                }
                run.turn(args.steps)?;
            }
        }
        rows.extend(runs.into_iter().map(|run| run.row(&bed, args.steps)));
        #[cfg(feature = "gpu")]
        if let Some(gpu) = &gpu {
            let time = || gpu.time(&bed, &args.gpu.batches, args.repeats, args.steps, should_stop);
            rows.extend(roost_solver::gpu::catch_out_of_memory(time)??);
        }
    }
    if args.json {
        print_json(&json!(rows))?;
    } else if args.write.is_none() {
        print_lines(format_args!("{}\n", table(&rows)))?;
    }
    Ok(Exit::Done)
}

/// The scenario that gives beds their sub-particles, material and time step.
fn read_scenario(args: &Args) -> Result<Scenario> {
    let faults_error = |file: &Path, faults: Vec<_>| input::faults_error(file, &faults);
    let mut document = match &args.scenario {
        Some(file) => input::read_document(file)?,
        None => json!({"experiment": "hopper"}),
    };
    if args.without_contact_between_bonded {
        document["bonds"]["contact_between_bonded"] = json!(false);
    }
    let file = args.scenario.clone().unwrap_or_else(|| "the built-in scenario".into());
    let scenario = scenario::from_value(&document).map_err(|faults| faults_error(&file, faults))?;
    if scenario.equipment().is_none() {
        let text = "--scenario: must be a scenario of the experiment \"hopper\"";
        return Err(BadInput(text.to_owned()).into());
    }
    Ok(scenario)
}

/// A path of the solver.
#[derive(Clone, Copy, Debug)]
enum SolverPath {
    Plain,
    Fast(InstructionSet),
    #[cfg(feature = "gpu")]
    Gpu,
}

impl SolverPath {
    fn parse(name: &str) -> Result<Self> {
        let sets = InstructionSet::available();
        let path = match name {
            "plain" => Some(Self::Plain),
            #[cfg(feature = "gpu")]
            "gpu" => Some(Self::Gpu),
            "fast" => Some(Self::Fast(InstructionSet::widest())),
            _ => sets.iter().find(|set| set.name() == name).map(|set| Self::Fast(*set)),
        };
        let names: Vec<_> = sets.iter().map(|set| set.name()).collect();
        path.ok_or_else(|| {
            BadInput(format!("--paths {name}: must be among plain, fast, {}, gpu", names.join(", "))).into()
        })
    }

    /// Name and backend of a path on the CPU.
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
        "bytes per sub-particle",
        "share of stages (%)",
    ];
    let mut table = Table::new(header);
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
