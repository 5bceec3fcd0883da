//! The server of a command, and ids of its sweeps, jobs and workers.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use roost_api::ids::{JobId, SweepId, WorkerId};
use roost_api::job::JobView;
use roost_api::sweep::SweepView;
use roost_terminal::BadInput;
use roost_worker::client::{Client, ClientError, Credentials};
use uuid::Uuid;

/// The server of a command.
#[derive(Clone, Debug, Args)]
pub(crate) struct Server {
    /// Address of the server
    #[arg(long, env = "ROOST_SERVER", default_value = "http://127.0.0.1:7373", value_name = "URL")]
    server: String,
    #[command(flatten)]
    access: Access,
}

impl Server {
    pub(crate) fn client(&self) -> Result<Client> {
        Ok(Client::with_credentials(&self.server, &self.access.read()?)?)
    }

    /// Its address.
    pub(crate) fn address(&self) -> &str {
        &self.server
    }

    /// The file with the access token.
    pub(crate) fn token_file(&self) -> Option<&Path> {
        self.access.token_file.as_deref()
    }

    /// The file with the authorities to trust.
    pub(crate) fn ca(&self) -> Option<&Path> {
        self.access.ca.as_deref()
    }
}

/// The server of a command that needs none.
#[derive(Clone, Debug, Args)]
pub(crate) struct OptionalServer {
    /// Address of a server. With this option, the forecast is for the workers of this server instead of for this machine. The server
    /// must already have the STL files that the document names
    #[arg(long, value_name = "URL")]
    server: Option<String>,
    #[command(flatten)]
    access: Access,
}

impl OptionalServer {
    /// A client, if a server is named.
    pub(crate) fn client(&self) -> Result<Option<Client>> {
        let Some(server) = &self.server else { return Ok(None) };
        Ok(Some(Client::with_credentials(server, &self.access.read()?)?))
    }
}

/// Credentials for the server. A token is never an argument, since other users can see those.
#[derive(Clone, Debug, Args)]
pub(crate) struct Access {
    /// File with the access token [default: the token in the environment variable ROOST_TOKEN]
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// PEM file with the certificates of certificate authorities. For https, the command trusts these authorities instead of the
    /// authorities of the system
    #[arg(long, env = "ROOST_CA", value_name = "FILE")]
    ca: Option<PathBuf>,
}

impl Access {
    pub(crate) fn read(&self) -> Result<Credentials> {
        let mut credentials = Credentials { token: self.token()?, ca: None };
        if let Some(path) = &self.ca {
            let to_error = |error| {
                let path = path.display();
                BadInput(format!(
                    "cannot read the certificates to trust (--ca or ROOST_CA) in {path}: {error}"
                ))
            };
            credentials.ca = Some(std::fs::read(path).map_err(to_error)?);
            credentials.check().with_context(|| path.display().to_string())?;
        }
        Ok(credentials)
    }

    fn token(&self) -> Result<Option<String>> {
        let Some(path) = &self.token_file else {
            return Ok(std::env::var("ROOST_TOKEN").ok().filter(|token| !token.trim().is_empty()));
        };
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read the token in {}", path.display()))?;
        Ok(Some(text.trim().to_owned()))
    }
}

/// Parses the id of a sweep or a job.
pub(crate) fn id(text: &str) -> Result<Uuid, String> {
    parse_id("roost list", text)
}

/// Parses the id of a study.
pub(crate) fn study_id(text: &str) -> Result<SweepId, String> {
    parse_id("roost study list", text).map(SweepId)
}

/// Parses the id of a worker.
pub(crate) fn worker_id(text: &str) -> Result<WorkerId, String> {
    parse_id("roost list --workers", text).map(WorkerId)
}

fn parse_id(list: &str, text: &str) -> Result<Uuid, String> {
    // The error of the parser does not help users.
    let to_error = |_| format!("not an id, such as 01890a5d-ac96-774b-bcce-b302099a8057; `{list}` shows all");
    text.parse().map_err(to_error)
}

/// The sweep or the job of an id.
#[derive(Clone, Debug)]
pub(crate) enum Target {
    Sweep(SweepView),
    Job(Box<JobView>),
}

/// Finds the sweep or the job of an id, which does not contain its type.
pub(crate) async fn find(client: &Client, id: Uuid) -> Result<Target> {
    match client.sweep(SweepId(id)).await {
        Ok(sweep) => return Ok(Target::Sweep(sweep)),
        Err(error) if error.problem_status() == Some(404) => {}
        Err(error) => return Err(error.into()),
    }
    match client.job(JobId(id)).await {
        Ok(job) => Ok(Target::Job(Box::new(job))),
        Err(ClientError::Problem(mut problem)) if problem.status == 404 => {
            problem.detail = format!("no sweep and no job has the id {id} at {}", client.server());
            Err(ClientError::Problem(problem).into())
        }
        Err(error) => Err(error.into()),
    }
}
