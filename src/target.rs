//! Which server, and which job or sweep of it.

use anyhow::Result;
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
}

impl Server {
    pub(crate) fn client(&self) -> Result<Client> {
        Ok(Client::new(&self.server)?)
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
