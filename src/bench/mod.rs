//! `roost bench`: what this machine does. [`solver`] times particle-steps, [`farm`] holds the service to its promises.

mod farm;
mod solver;

use anyhow::Result;

use crate::exit::Exit;

/// Measure how fast this machine computes, and how well it serves
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    Solver(solver::Args),
    #[cfg(feature = "gpu")]
    Parity(solver::gpu::ParityArgs),
    Farm(farm::Args),
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    match args.what {
        What::Solver(args) => solver::execute(args).await,
        #[cfg(feature = "gpu")]
        What::Parity(args) => {
            let parity = move || roost_solver::gpu::catch_out_of_memory(|| solver::gpu::parity(&args))?;
            tokio::task::spawn_blocking(parity).await?
        }
        What::Farm(args) => farm::execute(args).await,
    }
}
