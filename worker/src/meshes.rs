//! Cache of meshes on disk: each file is fetched once for all jobs.
//!
//! A file is named by its digest and renamed into place when it is complete. Every read checks the digest; a damaged file is fetched again.
//! The folder may be emptied at any time, and several workers may share it.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use roost_solver::mesh::{MeshError, Meshes, digest};
use tokio::sync::Mutex;
use tokio::task::spawn_blocking;
use uuid::Uuid;

use crate::backoff::Backoff;
use crate::client::{Client, ClientError};
use crate::outbox::remove_abandoned;

/// Attempts to fetch a file, over about ten seconds, so that a restart of the server fails no job.
const MAX_TRIES: u32 = 8;

/// Where the meshes of a run come from.
#[derive(Clone, Debug)]
pub enum MeshSource {
    /// In memory.
    Given(Meshes),
    /// From a server, through the cache.
    Server(std::sync::Arc<MeshCache>),
}

/// Why the meshes of a run are missing. The scenario is not at fault.
#[derive(Debug, thiserror::Error)]
pub enum MeshFailure {
    /// The server did not send the file.
    #[error("cannot fetch mesh {digest}: {source}")]
    Fetch {
        /// Its digest.
        digest: String,
        /// Why not.
        source: ClientError,
    },
    /// The server sent another file.
    #[error("cannot fetch mesh {0}: the server sent a file with another digest")]
    WrongDigest(String),
    /// The file is not a mesh, although the server accepted it.
    #[error("mesh {digest}: {source}")]
    Invalid {
        /// Its digest.
        digest: String,
        /// Its fault.
        source: MeshError,
    },
}

impl MeshSource {
    /// The meshes of these digests.
    ///
    /// # Errors
    /// When one of them cannot be fetched. The check of the scenario finds missing meshes of [`Self::Given`].
    pub async fn load(&self, digests: Vec<String>) -> Result<Meshes, MeshFailure> {
        match self {
            Self::Given(meshes) => Ok(meshes.clone()),
            Self::Server(cache) => cache.load(digests).await,
        }
    }
}

/// A folder of STL files from one or more servers.
#[derive(Debug)]
pub struct MeshCache {
    folder: PathBuf,
    client: Client,
    /// LeasedAttempts while fetching, so that jobs which want the same file wait for it instead.
    fetching: Mutex<()>,
}

impl MeshCache {
    /// Opens the cache in a worker's state directory, filled from the client's server.
    ///
    /// # Errors
    /// When the folder cannot be created or read.
    pub fn open(state_dir: &Path, client: Client) -> io::Result<Self> {
        let folder = state_dir.join("meshes");
        fs::create_dir_all(&folder)?;
        remove_abandoned(&folder)?;
        Ok(Self { folder, client, fetching: Mutex::new(()) })
    }

    async fn load(&self, digests: Vec<String>) -> Result<Meshes, MeshFailure> {
        let mut meshes = Meshes::default();
        for digest in digests {
            let file = match self.read(&digest).await {
                Some(file) => file,
                None => {
                    let _turn = self.fetching.lock().await;
                    match self.read(&digest).await {
                        Some(file) => file, // another job fetched it meanwhile
                        None => self.fetch(&digest).await?,
                    }
                }
            };
            let read = blocking(move || meshes.insert(&file).map(|_| meshes)).await;
            meshes = read.map_err(|source| MeshFailure::Invalid { digest, source })?;
        }
        Ok(meshes)
    }

    /// A file of the cache; none when it is missing or damaged.
    async fn read(&self, wanted: &str) -> Option<Vec<u8>> {
        let (path, wanted) = (self.path(wanted), wanted.to_owned());
        blocking(move || match fs::read(&path) {
            Ok(file) if digest(&file) == wanted => Some(file),
            Ok(_) => {
                tracing::warn!(path = %path.display(), "a file in the mesh cache is damaged; it is fetched again");
                None
            }
            Err(error) => {
                if error.kind() != ErrorKind::NotFound {
                    tracing::warn!(path = %path.display(), %error, "cannot read a mesh; it is fetched again");
                }
                None
            }
        })
        .await
    }

    /// Fetches a file, and stores it in the cache if the disk allows.
    async fn fetch(&self, wanted: &str) -> Result<Vec<u8>, MeshFailure> {
        let mut backoff = Backoff::default();
        let mut tries = 0;
        let file = loop {
            tries += 1;
            let failure = match self.fetch_once(wanted).await {
                Ok(file) => break file,
                Err(failure) => failure,
            };
            let is_final = matches!(&failure, MeshFailure::Fetch { source, .. } if !source.is_transient());
            if is_final || tries == MAX_TRIES {
                return Err(failure);
            }
            tracing::warn!(%failure, "cannot fetch a mesh; retrying");
            backoff.pause().await;
        };
        tracing::info!(digest = wanted, bytes = file.len(), "fetched a mesh");
        let path = self.path(wanted);
        let (file, stored) = blocking(move || {
            let stored = store(&path, &file);
            (file, stored)
        })
        .await;
        if let Err(error) = stored {
            tracing::warn!(folder = %self.folder.display(), %error, "cannot store a mesh in the cache; every job fetches it");
        }
        Ok(file)
    }

    async fn fetch_once(&self, wanted: &str) -> Result<Vec<u8>, MeshFailure> {
        let file = self
            .client
            .mesh_file(wanted)
            .await
            .map_err(|source| MeshFailure::Fetch { digest: wanted.to_owned(), source })?;
        let (file, found) = blocking(move || {
            let found = digest(&file);
            (file, found)
        })
        .await;
        if found == wanted { Ok(file) } else { Err(MeshFailure::WrongDigest(wanted.to_owned())) }
    }

    fn path(&self, digest: &str) -> PathBuf {
        self.folder.join(format!("{digest}.stl"))
    }
}

/// Writes a file completely or not at all. It needs no fsync: a read would find a wrong digest.
fn store(path: &Path, file: &[u8]) -> io::Result<()> {
    let temporary = path.with_file_name(format!("{}.tmp", Uuid::now_v7()));
    let written = fs::write(&temporary, file).and_then(|()| fs::rename(&temporary, path));
    written.inspect_err(|_| {
        let _ = fs::remove_file(&temporary);
    })
}

/// Runs work on files and large buffers outside the async threads.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    spawn_blocking(work).await.expect("the work does not panic")
}

#[cfg(test)]
mod tests;
