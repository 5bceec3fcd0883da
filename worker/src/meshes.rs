//! The meshes that jobs name, on disk: each file is fetched once, whatever the number of jobs that want it.
//!
//! A file is named by its digest, written beside and renamed into place, and held against its digest whenever it is read:
//! one that was damaged is fetched again. The folder may be emptied at any time, and workers may share it.

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

/// Tries to fetch a file, over about ten seconds: a server that restarts costs no attempt.
const TRIES: u32 = 8;

/// Where the meshes of a run come from.
#[derive(Clone, Debug)]
pub enum MeshSource {
    /// They are here.
    Given(Meshes),
    /// From a server, by way of the disk.
    Server(std::sync::Arc<MeshCache>),
}

/// Why a run has no meshes. None of it is the scenario's fault.
#[derive(Debug, thiserror::Error)]
pub enum MeshFailure {
    /// The server did not give the file.
    #[error("cannot fetch mesh {digest}: {source}")]
    Fetch {
        /// Its digest.
        digest: String,
        /// Why not.
        source: ClientError,
    },
    /// What the server gave is another file.
    #[error("cannot fetch mesh {0}: the server sent a file with another digest")]
    OtherFile(String),
    /// The file is no mesh, although the server took it for one.
    #[error("mesh {digest}: {source}")]
    Unsound {
        /// Its digest.
        digest: String,
        /// What is wrong with it.
        source: MeshError,
    },
}

impl MeshSource {
    /// The meshes of these digests.
    ///
    /// # Errors
    /// When one of them cannot be had. Whether those that are given suffice is for the check of the scenario to say.
    pub async fn load(&self, digests: Vec<String>) -> Result<Meshes, MeshFailure> {
        match self {
            Self::Given(meshes) => Ok(meshes.clone()),
            Self::Server(cache) => cache.load(digests).await,
        }
    }
}

/// A folder of files from one or more servers.
#[derive(Debug)]
pub struct MeshCache {
    folder: PathBuf,
    client: Client,
    /// Held while fetching, so that jobs which want the same file wait for it instead.
    fetching: Mutex<()>,
}

impl MeshCache {
    /// The cache in a worker's state directory, filled from the client's server.
    ///
    /// # Errors
    /// When there can be no such folder.
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
                        Some(file) => file, // somebody else fetched it meanwhile
                        None => self.fetch(&digest).await?,
                    }
                }
            };
            let read = beside(move || meshes.insert(&file).map(|_| meshes)).await;
            meshes = read.map_err(|source| MeshFailure::Unsound { digest, source })?;
        }
        Ok(meshes)
    }

    /// A file from the disk; none when it is not there, or is not what it should be.
    async fn read(&self, wanted: &str) -> Option<Vec<u8>> {
        let (path, wanted) = (self.path(wanted), wanted.to_owned());
        beside(move || match fs::read(&path) {
            Ok(file) if digest(&file) == wanted => Some(file),
            Ok(_) => {
                tracing::warn!(path = %path.display(), "a damaged file in the cache of meshes is fetched again");
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

    /// Fetches a file, and keeps it if the disk lets us.
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
            if is_final || tries == TRIES {
                return Err(failure);
            }
            tracing::warn!(%failure, "trying again");
            backoff.pause().await;
        };
        tracing::info!(digest = wanted, bytes = file.len(), "fetched a mesh");
        let path = self.path(wanted);
        let (file, kept) = beside(move || {
            let kept = keep(&path, &file);
            (file, kept)
        })
        .await;
        if let Err(error) = kept {
            tracing::warn!(folder = %self.folder.display(), %error, "cannot keep a mesh; every job that wants it fetches it");
        }
        Ok(file)
    }

    async fn fetch_once(&self, wanted: &str) -> Result<Vec<u8>, MeshFailure> {
        let file = self
            .client
            .mesh_file(wanted)
            .await
            .map_err(|source| MeshFailure::Fetch { digest: wanted.to_owned(), source })?;
        let (file, found) = beside(move || {
            let found = digest(&file);
            (file, found)
        })
        .await;
        if found == wanted { Ok(file) } else { Err(MeshFailure::OtherFile(wanted.to_owned())) }
    }

    fn path(&self, digest: &str) -> PathBuf {
        self.folder.join(format!("{digest}.stl"))
    }
}

/// Writes a file so that it is whole or not there. No flush: its digest tells when it was lost after all.
fn keep(path: &Path, file: &[u8]) -> io::Result<()> {
    let beside = path.with_file_name(format!("{}.tmp", Uuid::now_v7()));
    let written = fs::write(&beside, file).and_then(|()| fs::rename(&beside, path));
    written.inspect_err(|_| {
        let _ = fs::remove_file(&beside);
    })
}

/// Work on files and large buffers, off the async threads.
async fn beside<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    spawn_blocking(work).await.expect("nothing in here panics")
}

#[cfg(test)]
mod tests;
