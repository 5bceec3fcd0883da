//! `roost study submit`: submit a question to the server.

use std::path::{Path, PathBuf};

use anyhow::Result;
use roost_api::study::StudyView;
use roost_terminal::{BadInput, Exit, input, message, print_json, print_line, signals};
use roost_worker::client::Client;
use serde_json::json;
use uuid::Uuid;

use super::{follow, show};
use crate::document::DocumentKind;
use crate::meshes::{self, Resolved};
use crate::submit::{NO_LIMITS, submission_error};
use crate::target;

/// Submit a study to a server
///
/// The command first uploads the STL files that the server does not have.
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
    let resolved = read(&args.file)?;
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

/// Reads a study from a file with its meshes, or refuses it with all faults that are found without a server.
pub(super) fn read(file: &Path) -> Result<Resolved> {
    let resolved = meshes::resolve(file, input::read_document(file)?).checked(file)?;
    if DocumentKind::of(&resolved.document) != DocumentKind::Study {
        let name = input::display_name(file);
        return Err(BadInput(format!("{name} is no study: a study has a `goal`")).into());
    }
    if resolved.is_self_contained() {
        let report =
            roost_server::validate(resolved.document.clone(), &resolved.meshes, &NO_LIMITS, u64::MAX);
        report.map_err(|faults| input::faults_error(file, &faults))?;
    }
    Ok(resolved)
}

/// Submits a study with its meshes. The key makes a repeat harmless.
pub(super) async fn submit(
    client: &Client,
    file: &Path,
    resolved: &Resolved,
    key: &str,
) -> Result<StudyView> {
    resolved.upload(client).await?;
    let submitted = client.submit_study(&resolved.document, key).await;
    submitted.map_err(|error| submission_error(file, DocumentKind::Study, error))
}
