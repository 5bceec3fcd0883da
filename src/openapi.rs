//! `roost openapi`: the OpenAPI document of the HTTP API, for tools that generate code from it.

use anyhow::Result;
use roost_terminal::{Exit, print_line};

/// Print the OpenAPI document of the HTTP API as JSON, without a server
#[derive(Debug, clap::Args)]
pub(crate) struct Args {}

pub(crate) fn execute(_args: &Args) -> Result<Exit> {
    print_line(roost_server::openapi())?;
    Ok(Exit::Done)
}
