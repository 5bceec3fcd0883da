//! The data directory: its lock and permissions, and operations without a server: tokens, backup, restore.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use crate::store::{BackupReport, CopiedTable, Location, OBJECTS, StoreError, TokenFile, copy, transfer};

/// The database in a data directory, and in a backup.
pub(crate) const DATABASE: &str = "roost.db";

/// The file that a server holds locked.
const LOCK: &str = "roost.lock";

/// Why an operation on a data directory failed.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// The directory cannot be read or written.
    #[error("cannot use the data directory {}", path.display())]
    Io {
        /// The directory.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// A server uses the directory.
    #[error("the data directory {} is in use by another server: stop it first, or use another directory", .0.display())]
    InUse(PathBuf),
    /// The directory has no database.
    #[error("there is no {DATABASE} in {}: give a data directory that `roost serve` has used, or a backup", .0.display())]
    Nothing(PathBuf),
    /// The directory already has a database.
    #[error("{} already has a {DATABASE}: use another folder, or move the file away", .0.display())]
    Occupied(PathBuf),
    /// The database cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// Locks a data directory for as long as the returned file lives. The directory and its files become private
/// to their owner.
pub(crate) fn lock(data: &Path) -> Result<File, DataError> {
    let lock = open_lock(data)?;
    taken(data, lock.try_lock())?;
    Ok(lock)
}

/// The same for a server of a database of PostgreSQL. Its servers may share the directory: the database says which of them leads, also while
/// an earlier leader is frozen. Others may not, since each would remove the objects of the other.
pub(crate) fn lock_for(database: &str, data: &Path) -> Result<File, DataError> {
    let fail = |source| DataError::Io { path: data.to_owned(), source };
    let mut lock = open_lock(data)?;
    let mut named = String::new();
    lock.read_to_string(&mut named).map_err(fail)?;
    if named != database && lock.try_lock().is_ok() {
        // Nobody else uses it now.
        lock.rewind().and_then(|()| lock.set_len(0)).map_err(fail)?;
        lock.write_all(database.as_bytes()).and_then(|()| lock.unlock()).map_err(fail)?;
    }
    taken(data, lock.try_lock_shared())?;
    named.clear();
    lock.rewind().and_then(|()| lock.read_to_string(&mut named)).map_err(fail)?;
    if named == database { Ok(lock) } else { Err(DataError::InUse(data.to_owned())) }
}

fn open_lock(data: &Path) -> Result<File, DataError> {
    let fail = |source| DataError::Io { path: data.to_owned(), source };
    std::fs::create_dir_all(data).and_then(|()| make_private(data)).map_err(fail)?;
    let path = data.join(LOCK);
    OpenOptions::new().create(true).truncate(false).read(true).write(true).open(path).map_err(fail)
}

fn taken(data: &Path, tried: Result<(), std::fs::TryLockError>) -> Result<(), DataError> {
    tried.map_err(|error| match error {
        std::fs::TryLockError::WouldBlock => DataError::InUse(data.to_owned()),
        std::fs::TryLockError::Error(source) => DataError::Io { path: data.to_owned(), source },
    })
}

/// Makes a data directory, and Roost's files in it, private to their owner. Symbolic links are not followed:
/// their targets may belong to others.
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
            // The root folder of a file system has `lost+found`.
            has_others |= name != "lost+found";
        }
    }
    if !has_others {
        return restrict(folder, &std::fs::metadata(folder)?, 0o700);
    }
    // The folder may be a home folder or /tmp.
    tracing::warn!(folder = %folder.display(), "the data directory contains other files: its permissions are not changed");
    Ok(())
}

/// On other systems a new directory inherits the permissions of its parent.
#[cfg(not(unix))]
fn make_private(_folder: &Path) -> io::Result<()> {
    Ok(())
}

/// Opens the access tokens of a data directory, with or without a running server. `create` creates a missing
/// database.
pub async fn tokens_in(data: &Path, create: bool) -> Result<TokenFile, DataError> {
    if !create && !data.join(DATABASE).exists() {
        return Err(DataError::Nothing(data.to_owned()));
    }
    match lock(data) {
        // Locked until the file is open: no server migrates the database meanwhile.
        Ok(_lock) => Ok(TokenFile::open(&Location::File(data.join(DATABASE)), true).await?),
        Err(DataError::InUse(_)) => Ok(TokenFile::open(&Location::File(data.join(DATABASE)), false).await?),
        Err(error) => Err(error),
    }
}

/// Opens the access tokens in a database of PostgreSQL, with or without a running server.
pub async fn tokens_at(place: &Location) -> Result<TokenFile, DataError> {
    Ok(TokenFile::open(place, true).await?)
}

/// Copies the database of a stopped server to another place, which has none. A place is a data directory or a database of PostgreSQL. The
/// objects stay where they are.
pub async fn copy_database(from: &Location, to: &Location) -> Result<Vec<CopiedTable>, DataError> {
    let folder = |place: &Location| match place {
        Location::File(path) => path.parent().map(Path::to_owned),
        Location::Postgres(_) => None,
    };
    let (source, target) = (folder(from), folder(to));
    if let Some(folder) = &source
        && !folder.join(DATABASE).exists()
    {
        return Err(DataError::Nothing(folder.clone()));
    }
    if let Some(folder) = &target
        && folder.join(DATABASE).exists()
    {
        return Err(DataError::Occupied(folder.clone()));
    }
    let _locks = (source.as_deref().map(lock).transpose()?, target.as_deref().map(lock).transpose()?);
    Ok(transfer(from, to).await?)
}

/// The database of a data directory.
pub fn database_in(data: &Path) -> Location {
    Location::File(data.join(DATABASE))
}

/// Copies a data directory to another folder as of one moment, with or without a running server.
pub async fn backup(data: &Path, into: &Path) -> Result<BackupReport, DataError> {
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

/// Copies a backup to a data directory without a database and without a running server.
pub async fn restore(from: &Path, data: &Path) -> Result<BackupReport, DataError> {
    if !from.join(DATABASE).exists() {
        return Err(DataError::Nothing(from.to_owned()));
    }
    let _lock = lock(data)?;
    if data.join(DATABASE).exists() {
        return Err(DataError::Occupied(data.to_owned()));
    }
    Ok(copy(&from.join(DATABASE), &data.join(DATABASE)).await?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn servers_of_one_database_may_share_a_directory_and_others_may_not() {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path();
        let in_use = |tried: Result<File, DataError>| matches!(tried, Err(DataError::InUse(_)));
        let [leader, earlier] = [0, 1].map(|_| lock_for("postgres://db/roost", data).unwrap());
        assert!(in_use(lock_for("postgres://db/trial", data)), "of another database");
        assert!(in_use(lock(data)), "of a file");
        drop((leader, earlier));
        let file = lock(data).unwrap();
        assert!(in_use(lock_for("postgres://db/roost", data)), "beside a server of a file");
        drop(file);
        assert!(lock_for("postgres://db/trial", data).is_ok(), "nobody uses it");
    }
}
