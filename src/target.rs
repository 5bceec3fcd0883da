//! Which server, and which job or sweep of it.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use roost_api::ids::{JobId, SweepId};
use roost_api::job::JobView;
use roost_api::sweep::SweepView;
use roost_worker::client::{Client, ClientError};
use uuid::Uuid;

/// The server to talk to.
#[derive(Clone, Debug, Args)]
pub(crate) struct Server {
    /// Address of the server
    #[arg(long, env = "ROOST_SERVER", default_value = "http://127.0.0.1:7373", value_name = "URL")]
    server: String,
    #[command(flatten)]
    token: Token,
}

impl Server {
    pub(crate) fn client(&self) -> Result<Client> {
        Ok(Client::with_token(&self.server, self.token.read()?.as_deref())?)
    }
}

/// The access token, where the server wants one. Never an argument: others see those.
#[derive(Clone, Debug, Args)]
pub(crate) struct Token {
    /// File with the access token; without it, ROOST_TOKEN from the environment
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
}

impl Token {
    pub(crate) fn read(&self) -> Result<Option<String>> {
        let Some(path) = &self.token_file else {
            return Ok(std::env::var("ROOST_TOKEN").ok().filter(|token| !token.trim().is_empty()));
        };
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read the token in {}", path.display()))?;
        Ok(Some(text.trim().to_owned()))
    }
}

/// What an id stands for.
#[derive(Clone, Debug)]
pub(crate) enum Target {
    Sweep(SweepView),
    Job(JobView),
}

/// Finds the sweep or the job of an id: ids do not say which they are.
pub(crate) async fn find(client: &Client, id: Uuid) -> Result<Target> {
    match client.sweep(SweepId(id)).await {
        Ok(sweep) => return Ok(Target::Sweep(sweep)),
        Err(error) if error.problem_status() == Some(404) => {}
        Err(error) => return Err(error.into()),
    }
    match client.job(JobId(id)).await {
        Ok(job) => Ok(Target::Job(job)),
        Err(ClientError::Problem(mut problem)) if problem.status == 404 => {
            problem.detail = format!("there is no sweep and no job {id} at {}", client.server());
            Err(ClientError::Problem(problem).into())
        }
        Err(error) => Err(error.into()),
    }
}
