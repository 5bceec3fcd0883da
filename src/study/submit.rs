//! `roost study submit`: submit a question to the server.

use std::path::PathBuf;

use anyhow::Result;
use roost_api::study::StudyView;
use roost_terminal::{Exit, input, message, print_json, print_line, signals};
use roost_worker::client::Client;
use serde_json::json;
use uuid::Uuid;

use super::{follow, show};
use crate::document::DocumentKind;
use crate::meshes::{self, Resolved};
use crate::submit::submission_error;
use crate::target;

/// Submit a study to a server
///
/// Uploads its STL files first, unless the server has them.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// JSON file with a study; `-` reads stdin
    file: PathBuf,
    #[command(flatten)]
    server: target::Server,
    /// Wait for the answer, with a progress bar, and print it
    #[arg(long)]
    wait: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let resolved = meshes::resolve(&args.file, input::read_document(&args.file)?).checked(&args.file)?;
    let client = args.server.client()?;
    // Two submissions of one file are two studies.
    let study = submit(&client, &args.file, &resolved, &Uuid::new_v4().to_string()).await?;
    let id = study.id;
    if args.wait {
        message!("study {id}");
        let study = follow::follow(&client, id, &signals::shutdown_token()?).await?;
        show::print(&study, args.json)?;
        return Ok(follow::exit_of(&study));
    }
    if args.json {
        print_json(&json!(study))?;
    } else {
        print_line(format_args!("{id}"))?;
        message!("next: roost study watch {id}");
    }
    Ok(Exit::Done)
}

/// Submits a study with its meshes. The key makes a repeat harmless.
pub(super) async fn submit(
    client: &Client,
    file: &std::path::Path,
    resolved: &Resolved,
    key: &str,
) -> Result<StudyView> {
    resolved.upload(client).await?;
    let submitted = client.submit_study(&resolved.document, key).await;
    submitted.map_err(|error| submission_error(file, DocumentKind::Sweep, error))
}
