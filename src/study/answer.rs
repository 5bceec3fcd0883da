//! `roost study answer`: the answer as numbers and as a picture.

use std::path::{Path, PathBuf};

use anyhow::Result;
use roost_api::ids::SweepId;
use roost_solver::files;
use roost_terminal::{BadInput, Exit, plot, print_json, print_line};
use roost_worker::client::Client;
use serde_json::json;

use crate::target;

/// Print the answer of a study as JSON, or write the answer and its picture to files
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a study
    #[arg(value_parser = target::study_id)]
    id: SweepId,
    #[command(flatten)]
    server: target::Server,
    /// Write `answer.json` and `answer.svg` into this folder
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let client = args.server.client()?;
    match args.output {
        Some(folder) => {
            for path in write(&client, args.id, &folder).await? {
                print_line(path.display())?;
            }
        }
        None => print_json(&json!(client.study_answer(args.id).await?))?,
    }
    Ok(Exit::Done)
}

/// Writes `answer.json` and `answer.svg` into a folder. Returns their paths.
pub(super) async fn write(client: &Client, id: SweepId, folder: &Path) -> Result<Vec<PathBuf>> {
    let answer = client.study_answer(id).await?;
    let picture = plot::answer_svg(&answer)?;
    let document = format!("{:#}\n", json!(answer));
    std::fs::create_dir_all(folder)
        .map_err(|error| BadInput(format!("cannot create the folder {}: {error}", folder.display())))?;
    let mut paths = Vec::new();
    for (name, content) in [("answer.json", document), ("answer.svg", picture)] {
        paths.push(write_file(folder.join(name), content.as_bytes())?);
    }
    Ok(paths)
}

/// Writes a file, and returns its path.
pub(super) fn write_file(path: PathBuf, content: &[u8]) -> Result<PathBuf> {
    files::write_atomically(&path, content)
        .map_err(|error| BadInput(format!("cannot write {}: {error}", path.display())))?;
    Ok(path)
}
