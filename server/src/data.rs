//! The data directory: who holds it, and what may be done to it from outside a server.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use crate::store::{Copied, StoreError, TokenFile, copy};

/// The database in a data directory, and in a backup.
pub(crate) const DATABASE: &str = "roost.db";

/// Why a data directory cannot be used so.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// It cannot be read or written.
    #[error("cannot use the data directory {}", path.display())]
    Io {
        /// The directory.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Somebody else uses it.
    #[error("the data directory {} is in use by another server", .0.display())]
    InUse(PathBuf),
    /// There is nothing to read.
    #[error("there is no {DATABASE} in {}", .0.display())]
    Nothing(PathBuf),
    /// It would be overwritten.
    #[error("there is a {DATABASE} in {} already: choose another folder, or move it away", .0.display())]
    Occupied(PathBuf),
    /// The database cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// Takes hold of a data directory, for as long as the file lives.
pub(crate) fn lock(data: &Path) -> Result<File, DataError> {
    let fail = |source| DataError::Io { path: data.to_owned(), source };
    std::fs::create_dir_all(data).map_err(fail)?;
    let path = data.join("roost.lock");
    let lock = OpenOptions::new().create(true).truncate(false).write(true).open(path).map_err(fail)?;
    match lock.try_lock() {
        Ok(()) => Ok(lock),
        Err(std::fs::TryLockError::WouldBlock) => Err(DataError::InUse(data.to_owned())),
        Err(std::fs::TryLockError::Error(source)) => Err(fail(source)),
    }
}

/// Opens the access tokens of a data directory, whether a server runs on it or not. Where there is none yet, it is made or is an error.
pub async fn tokens_in(data: &Path, create: bool) -> Result<TokenFile, DataError> {
    if !create && !data.join(DATABASE).exists() {
        return Err(DataError::Nothing(data.to_owned()));
    }
    match lock(data) {
        // Held until it is open: no server migrates the database meanwhile.
        Ok(_lock) => Ok(TokenFile::open(&data.join(DATABASE), true).await?),
        Err(DataError::InUse(_)) => Ok(TokenFile::open(&data.join(DATABASE), false).await?),
        Err(error) => Err(error),
    }
}

/// Copies everything in a data directory to another folder, as it is at one moment, while a server uses it or not.
pub async fn backup(data: &Path, into: &Path) -> Result<Copied, DataError> {
    let (from, to) = (data.join(DATABASE), into.join(DATABASE));
    if !from.exists() {
        return Err(DataError::Nothing(data.to_owned()));
    }
    std::fs::create_dir_all(into).map_err(|source| DataError::Io { path: into.to_owned(), source })?;
    if to.exists() {
        return Err(DataError::Occupied(into.to_owned()));
    }
    Ok(copy(&from, &to).await?)
}

/// Puts a backup into a data directory that has no database yet and that no server uses.
pub async fn restore(from: &Path, data: &Path) -> Result<Copied, DataError> {
    if !from.join(DATABASE).exists() {
        return Err(DataError::Nothing(from.to_owned()));
    }
    let _lock = lock(data)?;
    if data.join(DATABASE).exists() {
        return Err(DataError::Occupied(data.to_owned()));
    }
    Ok(copy(&from.join(DATABASE), &data.join(DATABASE)).await?)
}
