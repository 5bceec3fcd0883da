//! `roost bench`: measurements on this machine. `solver` times the solver, `farm` measures the targets of the service.

mod farm;
mod solver;

use anyhow::Result;
use roost_terminal::Exit;

/// Measure the speed of this machine as a worker and as a server
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    benchmark: Benchmark,
}

#[derive(Debug, clap::Subcommand)]
enum Benchmark {
    Solver(solver::Args),
    #[cfg(feature = "gpu")]
    Parity(solver::gpu::ParityArgs),
    Farm(farm::Args),
}

/// Runs a benchmark and prints its results.
///
/// # Errors
/// If the benchmark cannot run.
pub async fn execute(args: Args) -> Result<Exit> {
    match args.benchmark {
        Benchmark::Solver(args) => solver::execute(args).await,
        #[cfg(feature = "gpu")]
        Benchmark::Parity(args) => {
            let parity = move || roost_solver::gpu::catch_out_of_memory(|| solver::gpu::parity(&args))?;
            tokio::task::spawn_blocking(parity).await?
        }
        Benchmark::Farm(args) => farm::execute(args).await,
    }
}
