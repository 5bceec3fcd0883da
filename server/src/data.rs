//! The data directory: who holds it, and what may be done to it from outside a server.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use crate::store::{Copied, OBJECTS, StoreError, TokenFile, copy};

/// The database in a data directory, and in a backup.
pub(crate) const DATABASE: &str = "roost.db";

/// The file that a server holds locked.
const LOCK: &str = "roost.lock";

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

/// Takes hold of a data directory, for as long as the file lives. The directory and the files in it become readable by their owner alone.
pub(crate) fn lock(data: &Path) -> Result<File, DataError> {
    let fail = |source| DataError::Io { path: data.to_owned(), source };
    std::fs::create_dir_all(data).and_then(|()| make_private(data)).map_err(fail)?;
    let path = data.join(LOCK);
    let lock = OpenOptions::new().create(true).truncate(false).write(true).open(path).map_err(fail)?;
    match lock.try_lock() {
        Ok(()) => Ok(lock),
        Err(std::fs::TryLockError::WouldBlock) => Err(DataError::InUse(data.to_owned())),
        Err(std::fs::TryLockError::Error(source)) => Err(fail(source)),
    }
}

/// Takes a data directory, and our files in it, away from everybody but their owner. Links are followed nowhere: their targets are
/// somebody else's to shut.
#[cfg(unix)]
fn make_private(folder: &Path) -> io::Result<()> {
    use std::fs::{Metadata, Permissions, set_permissions};
    use std::os::unix::fs::PermissionsExt;
    // A private file keeps its permissions: another user may own it, and only an owner can change them.
    let restrict = |path: &Path, metadata: &Metadata, mode: u32| {
        if metadata.permissions().mode() & 0o077 == 0 {
            return Ok(());
        }
        set_permissions(path, Permissions::from_mode(mode))
    };
    let ours =
        [DATABASE, "roost.db-wal", "roost.db-shm", "roost.db-journal", "roost.part", LOCK, OBJECTS, "worker"];
    let mut has_others = false;
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        if ours.iter().any(|ours| name == *ours) {
            let metadata = entry.metadata()?;
            if !metadata.is_symlink() {
                restrict(&entry.path(), &metadata, if metadata.is_dir() { 0o700 } else { 0o600 })?;
            }
        } else {
            // The system makes `lost+found` where a file system is mounted.
            has_others |= name != "lost+found";
        }
    }
    if !has_others {
        return restrict(folder, &std::fs::metadata(folder)?, 0o700);
    }
    // It may be somebody's home, or the folder of all temporary files: not ours to shut.
    tracing::warn!(folder = %folder.display(), "the data directory holds other files too: its permissions are left as they are");
    Ok(())
}

/// Elsewhere a new directory inherits the rights of the one around it.
#[cfg(not(unix))]
fn make_private(_folder: &Path) -> io::Result<()> {
    Ok(())
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
    let fail = |source| DataError::Io { path: into.to_owned(), source };
    std::fs::create_dir_all(into).map_err(fail)?;
    if to.exists() {
        return Err(DataError::Occupied(into.to_owned()));
    }
    let copied = copy(&from, &to).await?;
    make_private(into).map_err(fail)?;
    Ok(copied)
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
