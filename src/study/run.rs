//! `roost study run`: a study with a server and a worker in this process.

use std::path::PathBuf;

use anyhow::Result;
use roost_api::study::StudyView;
use roost_server::ServerConfig;
use roost_terminal::{Exit, message, print_line, signals};
use roost_worker::client::Client;
use tokio_util::sync::CancellationToken;

use super::answer::{self, write_file};
use super::folder::{Folder, client_driver, smaller_budget};
use super::{follow, show, submit};
use crate::farm::Farm;
use crate::meshes::Resolved;
use crate::work::WorkerArgs;

/// Answer a question on this machine, without a server
///
/// The command runs a server and a worker in this process, and stores the study in the output folder. After Ctrl-C or a crash, repeat
/// the same command to continue the study. If the study is finished, the command prints its answer at once. To raise the budget,
/// write a larger number `max_runs` into the file. After any other change of the file, use another output folder.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// JSON file with a study; `-` reads stdin
    file: PathBuf,
    /// Folder for the study: `answer.json`, `answer.svg`, `results.csv` and the data
    #[arg(short, long, default_value = "study-out", value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    worker: WorkerArgs,
}

/// A question with its file and its folder.
struct Asked {
    file: PathBuf,
    resolved: Resolved,
    folder: Folder,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let shutdown = signals::shutdown_token()?;
    let resolved = submit::read(&args.file)?;
    let folder = Folder::open(args.output)?;
    let device = args.worker.device()?;
    let (data, state) = (folder.data(), folder.data().join("worker"));
    let server = ServerConfig { listen: ([127, 0, 0, 1], 0).into(), data, ..ServerConfig::default() };
    let mut farm = Farm::start(server, |address| args.worker.config(address, state, device)).await?;
    message!("server at {}, data in {}", farm.address, folder.data().display());
    let client = Client::new(&farm.address)?;
    let asked = Asked { file: args.file, resolved, folder };
    let outcome = tokio::select! {
        outcome = asked.answer(&client, &shutdown) => outcome,
        error = farm.failure() => return Err(error),
    };
    farm.stop().await?;
    outcome
}

impl Asked {
    /// Begins the study or goes on with it, follows it, and writes its answer.
    async fn answer(&self, client: &Client, shutdown: &CancellationToken) -> Result<Exit> {
        let study = self.begin(client).await?;
        let followed = follow::follow(client, study.id, shutdown).await;
        if shutdown.is_cancelled() {
            message!("stopped; the same command goes on with the study");
            return Ok(Exit::Failed);
        }
        let study = followed?;
        let folder = self.folder.path();
        let mut paths = answer::write(client, study.id, folder).await?;
        let table = client.sweep_table(study.id, &[("format", "csv")]).await?;
        paths.push(write_file(folder.join("results.csv"), &table)?);
        show::print(&study, false)?;
        print_line("")?;
        for path in paths {
            print_line(path.display())?;
        }
        Ok(follow::exit_of(&study))
    }

    /// The study of the folder, with the budget in the file. It is submitted if there is none.
    async fn begin(&self, client: &Client) -> Result<StudyView> {
        let question = &self.resolved.document;
        if question["driver"] == "client" {
            return Err(client_driver(&self.file).into());
        }
        let Some(study) = client.studies(None, 1).await?.items.pop() else {
            self.folder.store(question)?;
            // A repeat of a submission whose answer was lost creates no second study.
            let key = blake3::hash(question.to_string().as_bytes()).to_hex();
            return submit::submit(client, &self.file, &self.resolved, &key).await;
        };
        self.folder.check(&self.file, question)?;
        message!("going on with study {}", study.id);
        let present = study.runs.max_runs;
        match question.pointer("/budget/max_runs").and_then(serde_json::Value::as_u64) {
            Some(wanted) if wanted < present => Err(smaller_budget(&self.file, wanted, present).into()),
            Some(wanted) if wanted > present => {
                let wanted = u32::try_from(wanted).unwrap_or(u32::MAX);
                let study = client.raise_study_budget(study.id, wanted).await?;
                self.folder.store(question)?;
                message!("budget raised from {present} to {wanted} runs");
                Ok(study)
            }
            _ => Ok(study),
        }
    }
}
