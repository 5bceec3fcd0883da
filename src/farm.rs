//! A server and one worker in this process, for `roost up`, `roost demo` and `roost study run`.

use anyhow::{Context, Result};
use roost_server::{Server, ServerConfig, ServerError};
use roost_worker::{WorkerConfig, WorkerError};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// A running server and worker. They communicate over loopback.
#[derive(Debug)]
pub(crate) struct Farm {
    /// Address of the server.
    pub(crate) address: String,
    stop_worker: CancellationToken,
    stop_server: CancellationToken,
    worker: JoinHandle<Result<(), WorkerError>>,
    server: JoinHandle<Result<(), ServerError>>,
}

impl Farm {
    /// Starts both. `worker` returns the configuration of the worker for the address of the server.
    pub(crate) async fn start(
        server: ServerConfig,
        worker: impl FnOnce(String) -> WorkerConfig,
    ) -> Result<Self> {
        let server = Server::bind(server).await?;
        let address = format!("http://{}", server.local_addr());
        // The state folder belongs to this server, even if its port changes.
        let worker = WorkerConfig { outbox_key: Some("here".to_owned()), ..worker(address.clone()) };
        let (stop_worker, stop_server) = (CancellationToken::new(), CancellationToken::new());
        Ok(Self {
            worker: tokio::spawn(roost_worker::work(worker, stop_worker.clone())),
            server: tokio::spawn(server.run(stop_server.clone())),
            address,
            stop_worker,
            stop_server,
        })
    }

    /// Waits until one of the two ends unexpectedly.
    pub(crate) async fn failure(&mut self) -> anyhow::Error {
        let ended = tokio::select! {
            ended = &mut self.worker => ended.context("the worker panicked").map(|ended| ended.context("the worker ended")),
            ended = &mut self.server => ended.context("the server panicked").map(|ended| ended.context("the server ended")),
        };
        match ended {
            Ok(Err(error)) | Err(error) => error,
            Ok(Ok(())) => anyhow::anyhow!("server or worker stopped unexpectedly"),
        }
    }

    /// Stops the worker first, so that it can return its job to the server.
    pub(crate) async fn stop(self) -> Result<()> {
        self.stop_worker.cancel();
        let worker = self.worker.await;
        self.stop_server.cancel();
        self.server.await.context("the server panicked")??;
        worker.context("the worker panicked")??;
        Ok(())
    }
}
