//! The thread of the writer.
//!
//! Requests are parsed and answered on the threads of the server's runtime. There, the writer would wait for a free thread after each
//! statement, and every other write with it.

use std::io;

use tokio::runtime::{Builder, Handle};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

/// A thread with a runtime of its own. The writing connection is opened and used on it: a connection to PostgreSQL is read by the runtime
/// that opened it. The thread ends after its last task, when the last clone is dropped.
#[derive(Clone)]
pub(in crate::store) struct Thread {
    runtime: Handle,
    _alive: mpsc::Sender<()>,
}

impl Thread {
    /// Starts the thread.
    pub(in crate::store) fn start() -> io::Result<Self> {
        let (alive, mut ended) = mpsc::channel(1);
        let (built, runtime) = std::sync::mpsc::sync_channel(1);
        let run = move || {
            // Built here: a runtime may not be dropped on a thread of another one, which happens if no thread can start.
            let runtime = match Builder::new_current_thread().enable_all().build() {
                Ok(runtime) => runtime,
                Err(error) => return drop(built.send(Err(error))),
            };
            let _ = built.send(Ok(runtime.handle().clone()));
            runtime.block_on(async {
                let _: Option<()> = ended.recv().await;
            });
        };
        std::thread::Builder::new().name("writer".to_owned()).spawn(run)?;
        let runtime = runtime.recv().map_err(io::Error::other)??;
        Ok(Self { runtime, _alive: alive })
    }

    /// Executes `work` on the thread.
    pub(in crate::store) fn spawn<T: Send + 'static>(
        &self,
        work: impl Future<Output = T> + Send + 'static,
    ) -> JoinHandle<T> {
        let thread = self.clone();
        self.runtime.spawn(async move {
            let _alive = thread;
            work.await
        })
    }
}
