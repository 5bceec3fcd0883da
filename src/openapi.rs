//! `roost openapi`: the OpenAPI document of the HTTP API, for tools that generate code from it.

use anyhow::Result;
use roost_solver::scenario::json_schema;
use roost_terminal::{Exit, print_line};

/// Print the OpenAPI document of the HTTP API as JSON, without a server
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Print the JSON Schema of scenarios in its place
    #[arg(long)]
    scenario: bool,
}

pub(crate) fn execute(args: &Args) -> Result<Exit> {
    if args.scenario {
        print_line(json_schema())?
    } else {
        print_line(roost_server::openapi())?
    }
    Ok(Exit::Done)
}
